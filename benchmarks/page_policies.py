"""Pretrained policies judged through the path of the page, with scripted people and without a browser.

    python -m benchmarks.page_policies                                   # all of pretrained/, one after another
    python -m benchmarks.page_policies nl_reach_kuka --count 200 --seed 11 --seeds 2
    python -m benchmarks.page_policies nl_reach_kuka --evaluate 1000     # evaluate.py too
    python -m benchmarks.page_policies --cards                           # measures nothing: writes figures into cards

Each instruction goes through `Session`, as it does from the page: in a fresh scene, after another instruction, after
objects were dragged, corrected in mid-motion, with the names that the page shows, and with a steady finger ("reach
this", and "Go where I point"). What was meant counts, not what was understood: a second instance of the task, which is
given what the person wanted, judges each control step, and an instruction succeeded if the last one did.
`disagreements` are instructions of which the page says "Done" where that is not so, or the other way round.

Results are added to docs/page_policies.json; `--cards` writes them into pretrained/<name>/README.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.reproduce import commit
from core.errors import ConfigError, did_you_mean
from core.program import run_program
from demo.session import Session
from demo.session_config import SavedPolicy, make_config, pretrained_policies
from tools.page_judge import JudgedInstruction, figures, interval, judge, section
from trainers.export.publish import write_section

ROOT = Path(__file__).resolve().parents[1]
SECTION = "Through the page"  # of a card


def judged_policy(policy: SavedPolicy, count: int, seeds: Sequence[int]) -> dict[str, Any]:
    """Judge a policy as the page takes it: by task, robot and control. Raises ConfigError."""
    config = make_config(task=policy.task, robot=policy.robot, control=policy.control, second_try=False)
    judged: list[JudgedInstruction] = []
    for seed in seeds:
        with closing(Session(config, seed)) as session:
            session.set_viewpoint("human")  # as play.py does
            judged += _shown(judge(session, count, seed), f"{policy.name}, seed {seed}", count)
    return {"seeds": list(seeds), **figures(judged)}


def _shown(judged: Iterator[JudgedInstruction], name: str, count: int) -> Iterator[JudgedInstruction]:
    for number, each in enumerate(judged, start=1):
        if not each.success or each.disagrees:
            print(f"{name}: {each}", file=sys.stderr)
        if number % 50 == 0:
            print(f"{name}: {number} of {count}", file=sys.stderr)
        yield each


def evaluated(policy: SavedPolicy, episodes: int, seed: int) -> dict[str, Any]:
    """Return what `evaluate.py` says of a policy."""
    import evaluate

    with TemporaryDirectory() as folder:
        words = [f"checkpoint={policy.path}", f"episodes={episodes}", f"seed={seed}"]
        result = evaluate.main([*words, f"out={Path(folder) / 'result.json'}"])
    return {"seed": seed} | {name: result[name] for name in ("episodes", "success_at_end", "ci95")}


def chosen(names: Sequence[str]) -> list[SavedPolicy]:
    """Return the policies of these names, or all. Raises ConfigError."""
    known = {policy.name: policy for policy in pretrained_policies()}
    if unknown := [name for name in names if name not in known]:
        raise ConfigError(f"{unknown[0]} is not in pretrained/" + did_you_mean(unknown[0], known))
    return [known[name] for name in names or known]


# ---- Results


def written(path: Path, name: str, result: dict[str, Any]) -> None:
    """Add a result to the file: what it lacks of an older one of this policy stays."""
    known = json.loads(path.read_text()) if path.exists() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    known[name] = known.get(name, {}) | result
    path.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n")


def main(words: Sequence[str]) -> None:
    """Judge policies, and write the results or the cards. Raises ConfigError."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("names", nargs="*", metavar="NAME", help="of pretrained/; none: all")
    options.add_argument("--count", type=int, default=200, help="instructions for each seed")
    options.add_argument("--seed", type=int, default=0, help="the first one")
    options.add_argument("--seeds", type=int, default=1, help="their number")
    options.add_argument("--evaluate", type=int, default=0, metavar="EPISODES", help="of evaluate.py; 0: leave it out")
    options.add_argument("--cards", action="store_true", help="measure nothing: write the figures into the cards")
    options.add_argument("--out", type=Path, default=ROOT / "docs" / "page_policies.json")
    given = options.parse_args(words)
    if given.count < 1 or given.seeds < 1 or given.seed < 0 or given.evaluate < 0:
        raise ConfigError("--count and --seeds must be at least 1, --seed and --evaluate at least 0")
    for policy in chosen(given.names):
        if given.cards:
            known = json.loads(given.out.read_text()) if given.out.exists() else {}
            write_section(policy.path, SECTION, section(policy.name, known.get(policy.name, {})))
            continue
        page = judged_policy(policy, given.count, range(given.seed, given.seed + given.seeds))
        result = {"date": date.today().isoformat(), "commit": commit(ROOT), "page": page}
        if given.evaluate:
            result["evaluation"] = evaluated(policy, given.evaluate, given.seed)
        written(given.out, policy.name, result)
        print(f"{policy.name}: {interval(page)}, {page['disagreements']} disagreements", flush=True)


if __name__ == "__main__":
    run_program(main, __file__)

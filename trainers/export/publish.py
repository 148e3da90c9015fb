"""Publish a run's policy: `python -m trainers.export.publish <run dir> pretrained/<name>`.

Writes the last policy, without the state that only training needs, as policy.safetensors, and its card as README.md.
Evaluate it with `python evaluate.py checkpoint=pretrained/<name>`; `python -m benchmarks.page_policies <name>` judges
it through the page, and its `--cards` adds both figures to the card.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

from core.errors import ConfigError
from core.overrides import comment
from core.program import run_program
from core.system import system_info
from trainers.export import policy_file
from trainers.reports.scores import result_of, time_to_level
from trainers.run import checkpoint
from trainers.sweeps.runs import RunRecord, command_line, find_runs, overrides_of, share_cell
from trainers.utils.files import atomic_directory, atomic_path

CARD = "README.md"
MAX_BYTES = 1_000_000  # of a file, so that it can be kept in a repository
USAGE = "give a run and a new directory: python -m trainers.export.publish <run dir> pretrained/<name>"
CARD_GROUPS = ("robot", "control", "workspace", "task", "algo", "policy")


def publish(folder: Path, place: Path) -> Path:
    """Write the policy of a run and its card to a new directory.

    Args:
        folder: of the finished run.
        place: the new directory.

    Returns:
        The new directory.

    Raises:
        ConfigError: the run has not finished, or the directory exists; nothing is written.
    """
    files = _files(folder, place)
    with atomic_directory(place) as temporary:
        for name, content in files.items():
            if len(content) >= MAX_BYTES:
                size = f"{len(content):,} bytes"
                raise ConfigError(f"{place / name} would have {size}; a file must have less than {MAX_BYTES:,}")
            (temporary / name).write_bytes(content)
    return place


def _files(folder: Path, place: Path) -> dict[str, bytes]:
    """Return the content of each file of the new directory."""
    run = _finished(folder)
    payload = checkpoint.load(folder / "checkpoints" / "last.pt")
    if payload["counters"]["frames"] != result_of(run)["frames"]:
        raise ConfigError(
            f"{folder} was resumed after its eval.json: {result_of(run)['frames']} frames there, "
            f"{payload['counters']['frames']} in the checkpoint; finish it first: python train.py resume={folder}"
        )
    payload["config"] = config = _without_resume(payload["config"])
    words = [*overrides_of(config), f"seed={config['seed']}"]
    return {policy_file.NAME: policy_file.pack(payload, checkpoint.FORMAT), CARD: _card(run, place, words)}


def write_section(place: Path, heading: str, text: str) -> None:
    """Write a section of a card, in place of the one with this heading, else before the config.

    Raises ConfigError for a directory without a card.
    """
    path = place / CARD
    try:
        parts = re.split(r"^(?=## )", path.read_text("utf-8"), flags=re.MULTILINE)
    except OSError:
        raise ConfigError(f"{place} has no {CARD}: publish a policy there first") from None
    kept = [part for part in parts if not part.startswith(f"## {heading}\n")]
    kept.insert(1, f"## {heading}\n\n{text.rstrip()}\n\n")
    with atomic_path(path) as temporary:
        temporary.write_text("".join(kept), "utf-8")


def _finished(folder: Path) -> RunRecord:
    """Return the run in `folder`. Raises ConfigError if it is not a single run or has not finished."""
    run = next((run for run in find_runs(folder) if run.folder == folder), None)
    if run is None:
        raise ConfigError(f"{folder} holds several runs; give the directory of one")
    if run.result is None:
        raise ConfigError(f"{folder} {run.status}: it has no eval.json; resume it: python train.py resume={folder}")
    return run


def _without_resume(config: dict[str, Any]) -> dict[str, Any]:
    """Return the config without the directories that the run was resumed from."""
    sweep = {"sweep": config["sweep"] | {"resume": None}} if "sweep" in config else {}
    return config | {"resume": None} | sweep


def _card(run: RunRecord, place: Path, words: Sequence[str]) -> bytes:
    """Return the card, in Markdown. words: the overrides that compose the run's config."""
    config, final = run.config, result_of(run)
    rows = [[name, config[name]["name"]] for name in CARD_GROUPS]
    rows += [["seed", config["seed"]], ["frames", f"{final['frames']:,}, in {_minutes(final['wall_s'])}"]]
    frames, seconds = time_to_level(run.evaluations, 0.9)
    if math.isfinite(frames):
        rows += [["to 90 % success", f"{frames:,.0f} frames, {_minutes(seconds)}"]]
    rows += [["date", date.fromtimestamp((run.folder / "eval.json").stat().st_mtime).isoformat()]]
    rows += [[name, text] for name, text in system_info().items()]
    changes = "\n".join(f"* `{word}`" for word in words if not word.startswith("seed=")) or "Nothing."
    text = f"""# {place.name}

{_purpose(config)}

| success_at_end (95 %) | wrong object | disturbed | episodes |
|---|---|---|---|
| {_interval(final)} | {final["wrong_object"]:.3f} | {share_cell(final.get("disturbed"))} | {final["episodes"]} |

Evaluation of the last policy of the run with deterministic actions, on episodes that training did not use.
The intervals are Wilson's. Disturbed: the share of successful episodes in which an object was moved by more than 1 cm
that the task does not move.
{_kinds(final.get("by_kind", {}))}
```
python evaluate.py checkpoint={place.as_posix()}   # evaluates it on other episodes
python -m benchmarks.page_policies {place.name}   # judges it through the page of play.py
{command_line(words)}   # trains it
```

## Config that differs from the default

{changes}

`{policy_file.NAME}` holds the whole config, the vocabulary, and the observation and action widths of the networks.

## The run

| | |
|---|---|
{_lines(rows)}

The machine and the versions are those with which this card was written.
"""
    return text.encode()


def _kinds(kinds: dict[str, Any]) -> str:
    """Return the table of success by kind of instruction; "" without one."""
    rows = [[name, _interval(part), part["episodes"]] for name, part in kinds.items()]
    return (
        f"\n| kind of instruction | success_at_end (95 %) | episodes |\n|---|---|---|\n{_lines(rows)}\n" if rows else ""
    )


def _interval(part: dict[str, Any]) -> str:
    """Return the success of an evaluation, or of a part of it, with its interval."""
    return f"{part['success_at_end']:.3f} ({part['ci95'][0]:.3f}-{part['ci95'][1]:.3f})"


def _lines(rows: Sequence[Sequence[Any]]) -> str:
    return "\n".join(f"| {' | '.join(map(str, row))} |" for row in rows)


def _minutes(seconds: float) -> str:
    return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"


def _purpose(config: dict[str, Any]) -> str:
    """Return the purpose of the task, from the comment at the top of its YAML file."""
    return comment("task", config["choices"]["task"])


def main(words: Sequence[str]) -> None:
    """Publish the run that the first word names as the directory of the second one. Raises ConfigError."""
    if len(words) != 2:
        raise ConfigError(USAGE)
    place = publish(Path(words[0]), Path(words[1]))
    sizes = ", ".join(f"{file.name} ({file.stat().st_size:,} bytes)" for file in sorted(place.iterdir()))
    print(f"{place}: {sizes}")


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(main, __file__, words)


if __name__ == "__main__":
    cli()

"""How often does a checkpoint do what it is told: `python evaluate.py checkpoint=<run dir or file> episodes=500`.

    checkpoint=...    a run directory, or a checkpoint file (best.pt, last.pt)
    episodes=500      fresh episodes, deterministic policy
    seed=0            of the evaluation, apart from every training run's own episodes
    worlds=20         that run side by side
    video=0           episodes to film as well, with the sentence on the frame
    out=<file>        where the result goes; a numbered file in the run directory otherwise
    task.num_objects=6 ...   any key of the run's config, to judge it elsewhere than it was trained

Prints success with its 95 % Wilson interval, overall and by kind of instruction, and saves it as JSON.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

from conf.overrides import apply
from conf.schema import Checked, ConfigError, read, within


@dataclass(frozen=True, kw_only=True)
class EvaluateConfig(Checked):
    checkpoint: str
    episodes: int = within(1, 10_000_000)
    seed: int = within(0, 2**31 - 1)
    worlds: int = within(1, 4096)
    video: int = within(0, 100)
    out: str | None


DEFAULTS = {"episodes": 500, "seed": 0, "worlds": 20, "video": 0, "out": None}


def parse(arguments: list[str]) -> tuple[EvaluateConfig, list[str]]:
    """Our own keys, and the overrides of the run's config that are left. Raises ConfigError."""
    own: dict[str, Any] = dict(DEFAULTS)
    overrides: list[str] = []
    names = [field.name for field in fields(EvaluateConfig)]
    for word in arguments:
        key, equals, value = word.partition("=")
        if not equals:
            raise ConfigError(f"{word}: arguments are written key=value, like checkpoint=<run dir>")
        if key in names:
            own[key] = value
        else:
            overrides.append(word)
    if "checkpoint" not in own:
        raise ConfigError("checkpoint=<run dir or file> is missing")
    return read(EvaluateConfig, own, ""), overrides


def main(arguments: list[str]) -> dict[str, Any]:
    """Evaluate, print, save. Raises ConfigError."""
    config, overrides = parse(arguments)

    from trainers import checkpoint

    path = checkpoint.find(Path(config.checkpoint))
    saved = checkpoint.load(path)
    cfg = apply(saved["config"], overrides)

    from envs.config import read_env
    from train import build_env
    from trainers.build import restore_policy
    from trainers.collection import derive_seed
    from trainers.config import read_plan
    from trainers.evaluation import evaluate
    from trainers.report import write_json
    from trainers.video import record

    make = partial(build_env, read_env(cfg))
    seed = derive_seed(config.seed, 2**20, evaluation=True)
    env = make(min(config.worlds, config.episodes), seed)
    try:
        checkpoint.check_fits(
            saved, list(env.tokenizer.vocabulary), checkpoint.widths(env.observation_spec, env.action_spec)
        )
        policy = restore_policy(read_plan(cfg), env.observation_spec, env.action_unit, saved).act
        result = evaluate(env, policy, config.episodes, seed)
    finally:
        env.close()
    out = Path(config.out) if config.out else _numbered(path)
    report = {"checkpoint": str(path), "seed": config.seed, "overrides": overrides, **result.as_dict()}
    write_json(out, report)
    if config.video:
        film = make(1, seed, render=True)
        record(film, policy, out.with_suffix(".mp4"), config.video)
        film.close()
    print(describe(report, out))
    return report


def describe(report: dict[str, Any], out: Path) -> str:
    """The result as a person reads it, overall and by kind of instruction."""
    lines = [_line(kind, part) for kind, part in report.get("by_kind", {}).items()]
    return "\n".join([*lines, _line("all", report), f"saved in {out}"])


def _line(name: str, part: dict[str, Any]) -> str:
    low, high = part["ci95"]
    return (
        f"{name:12} success_at_end {part['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f}), "
        f"success_once {part['success_once']:.3f}, wrong object {part['wrong_object']:.3f}, {part['episodes']} episodes"
    )


def _numbered(path: Path) -> Path:
    """A file in the checkpoint's run directory that does not exist yet: nothing is overwritten."""
    folder = path.parent.parent if path.parent.name == "checkpoints" else path.parent
    names = (folder / f"evaluation_{i}.json" for i in range(1, 10_000))
    return next(name for name in names if not name.exists())


def cli() -> None:
    if any(word in ("-h", "--help") for word in sys.argv[1:]):
        print(__doc__)
        return
    try:
        main(sys.argv[1:])
    except ConfigError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    cli()

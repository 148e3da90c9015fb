"""A run's policy, to be passed on: `python -m trainers.export.publish <run dir> pretrained/<name>`.

Writes the last policy alone, without what only training needs, as policy.safetensors, and README.md, its card. Judge it
with `python evaluate.py checkpoint=pretrained/<name>`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

from conf import arguments
from conf.overrides import comment
from conf.schema import ConfigError
from trainers.export import policy_file
from trainers.reports.scores import result_of, time_to_level
from trainers.run import checkpoint
from trainers.sweeps.overrides_of import overrides_of
from trainers.sweeps.runs import RunRecord, command_line, find_runs
from trainers.utils.atomic_io import atomic_directory
from trainers.utils.system_info import system_info

MOST = 1_000_000  # bytes of a file that is to be in a repository
GROUPS = ("robot", "control", "workspace", "task", "algo", "policy")


def publish(folder: Path, place: Path) -> Path:
    """Write the policy of the finished run in `folder`, and its card, to the new directory `place`; that directory.

    Raises ConfigError, and then leaves nothing.
    """
    with atomic_directory(place) as fresh:
        for name, content in _files(folder, place).items():
            if len(content) >= MOST:
                raise ConfigError(f"{place / name} would have {len(content):,} bytes; a file is to stay below {MOST:,}")
            (fresh / name).write_bytes(content)
    return place


def _files(folder: Path, place: Path) -> dict[str, bytes]:
    """What is to be in `place`."""
    run = _finished(folder)
    payload = checkpoint.load(folder / "checkpoints" / "last.pt")
    if payload["counters"]["frames"] != result_of(run)["frames"]:
        raise ConfigError(
            f"{folder} has gone on since its eval.json: {result_of(run)['frames']} frames there, "
            f"{payload['counters']['frames']} in the checkpoint; let it finish: python train.py resume={folder}"
        )
    payload["config"] = config = _own(payload["config"])
    words = [*overrides_of(config), f"seed={config['seed']}"]
    return {policy_file.NAME: policy_file.pack(payload, checkpoint.FORMAT), "README.md": _card(run, place, words)}


def _finished(folder: Path) -> RunRecord:
    """Raises ConfigError for what is not one run that has come to its end."""
    run = next((run for run in find_runs(folder) if run.folder == folder), None)
    if run is None:
        raise ConfigError(f"{folder} holds several runs; give the directory of one")
    if run.result is None:
        raise ConfigError(
            f"{folder} {run.status}: it has no eval.json; python train.py resume={folder} goes on with it"
        )
    return run


def _own(config: dict[str, Any]) -> dict[str, Any]:
    """The config without the places that it was resumed from."""
    sweep = {"sweep": config["sweep"] | {"resume": None}} if "sweep" in config else {}
    return config | {"resume": None} | sweep


def _card(run: RunRecord, place: Path, words: Sequence[str]) -> bytes:
    config, final = run.config, result_of(run)
    low, high = final["ci95"]
    rows = [[name, config[name]["name"]] for name in GROUPS]
    rows += [["seed", config["seed"]], ["frames", f"{final['frames']:,}, in {_minutes(final['wall_s'])}"]]
    frames, seconds = time_to_level(run.evaluations, 0.9)
    if math.isfinite(frames):
        rows += [["to 90 % success", f"{frames:,.0f} frames, {_minutes(seconds)}"]]
    rows += [["date", date.fromtimestamp((run.folder / "eval.json").stat().st_mtime).isoformat()]]
    rows += [[name, text] for name, text in system_info().items()]
    different = "\n".join(f"* `{word}`" for word in words if not word.startswith("seed=")) or "Nothing."
    text = f"""# {place.name}

{_purpose(words, config)}

| success_at_end (95 %) | wrong object | episodes |
|---|---|---|
| {final["success_at_end"]:.3f} ({low:.3f}-{high:.3f}) | {final["wrong_object"]:.3f} | {final["episodes"]} |

The last policy of the run, deterministic, on fresh episodes that training never drew. The interval is Wilson's.
{_kinds(final.get("by_kind", {}))}
```
python evaluate.py checkpoint={place.as_posix()}   # judges it again, on other episodes
{command_line(words)}   # how it was trained
```

## Config that differs from the default

{different}

All of the config is in `{policy_file.NAME}`, with the vocabulary and the widths that the networks were built for.

## The run

| | |
|---|---|
{_lines(rows)}

The machine is the one that this card was written on.
"""
    return text.encode()


def _kinds(kinds: dict[str, Any]) -> str:
    rows = [
        [name, f"{part['success_at_end']:.3f} ({part['ci95'][0]:.3f}-{part['ci95'][1]:.3f})", part["episodes"]]
        for name, part in kinds.items()
    ]
    return f"\n| kind of sentence | success_at_end (95 %) | episodes |\n|---|---|---|\n{_lines(rows)}\n" if rows else ""


def _lines(rows: Sequence[Sequence[Any]]) -> str:
    return "\n".join(f"| {' | '.join(map(str, row))} |" for row in rows)


def _minutes(seconds: float) -> str:
    return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"


def _purpose(words: Sequence[str], config: dict[str, Any]) -> str:
    """What the task asks for, as the comment at the head of its YAML says."""
    chosen = [word.partition("=")[2] for word in words if word.startswith("task=")]
    return comment("task", (*chosen, config["task"]["name"])[0])


def main(words: Sequence[str]) -> None:
    """Raises ConfigError."""
    if len(words) != 2:
        raise ConfigError("give a run and where it goes: python -m trainers.export.publish <run dir> pretrained/<name>")
    place = publish(Path(words[0]), Path(words[1]))
    sizes = ", ".join(f"{file.name} ({file.stat().st_size:,} bytes)" for file in sorted(place.iterdir()))
    print(f"{place}: {sizes}")


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    arguments.run(main, __doc__, words)


if __name__ == "__main__":
    cli()

"""Command-line words of sweeps: resuming one, and values in Hydra's syntax."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from omegaconf import OmegaConf

from core.command_line import check_stored
from trainers.sweeps.runs import NAME, read_starts

RESUME = "sweep.resume="
NON_JOB_PREFIXES = ("-", "hydra.", "hydra/", "sweep.")  # words that do not distinguish the jobs of a sweep


def register_resolvers() -> None:
    """Register the OmegaConf resolver that hydra.run.dir and hydra.sweep.subdir of conf/config.yaml use.

    `${tag:<scenario>}` is "" for none and "scenario<n>-" otherwise. Call it before Hydra starts, in each process.
    """
    OmegaConf.register_new_resolver("tag", _tag, replace=True)


def _tag(choice: str) -> str:
    return "" if choice == "none" else f"scenario{choice}-"


def expand_resume(words: Sequence[str]) -> list[str]:
    """Replace sweep.resume=<dir> by the directory of that sweep and, if no other override is given, by its last ones.

    Args:
        words: command-line words. Without sweep.resume, or with sweep.resume=null, they are returned unchanged.

    Returns:
        Words for Hydra's multirun mode.

    Raises:
        ConfigError: no sweep was started in the directory, or its sweep.yaml holds overrides that are refused.
    """
    own = [word for word in words if word.startswith(RESUME)]
    value = own[-1].removeprefix(RESUME) if own else "null"
    if value == "null":
        return list(words)
    folder = Path(value)
    starts = read_starts(folder)
    others = [word for word in words if word not in (*own, "-m", "--multirun")]
    if all(word.startswith(NON_JOB_PREFIXES) for word in others):
        check_stored(starts[-1]["overrides"], folder / NAME)
        others = [*starts[-1]["overrides"], *others]
    return ["--multirun", *others, f"hydra.sweep.dir={folder.absolute()}"]

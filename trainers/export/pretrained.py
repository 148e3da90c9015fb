"""The pretrained policies that come with the project, by name."""

from __future__ import annotations

from pathlib import Path

from conf.schema import did_you_mean
from trainers.export import policy_file

FOLDER = Path(__file__).resolve().parents[2] / "pretrained"  # beside the packages, in a checkout and in an install


def names() -> list[str]:
    """The names of the pretrained policies, sorted."""
    return sorted(file.parent.name for file in FOLDER.glob(f"*/{policy_file.NAME}"))


def folder_of(path: Path) -> Path | None:
    """The folder of the policy that `<name>` or `pretrained/<name>` stands for; None for any other path."""
    if path.parent in (Path(), Path("pretrained")) and path.name in names():
        return FOLDER / path.name
    return None


def suggestion(path: Path) -> str:
    """The end of an error message about a checkpoint that does not exist: all names, and the nearest one."""
    return f" ({', '.join(names())}){did_you_mean(path.name, names()).partition('; choose')[0]}"

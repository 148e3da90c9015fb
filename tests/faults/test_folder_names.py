"""Folders with any characters in their names, given to every program as they are."""

from __future__ import annotations

import importlib
import shutil
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.helpers.folder_names import NAMES
from tests.helpers.tiny_run import TINY_RUN
from tools.forked import call

FEW = ("episodes=1", "worlds=1")
SCENE = "- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n"
QUICK = ("eval.video_episodes=0", "eval.episodes=1", "eval.worlds=1")


def train_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    return [("train", *TINY_RUN, *QUICK, "total_frames=128", f"hydra.run.dir={folder}")]


def resume_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    return [("train", f"resume={folder}", *QUICK)]


def begin_with(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    words = (f"init={folder}", "total_frames=128", f"hydra.run.dir={folder}/next")
    return [("train", *TINY_RUN, *QUICK, *words), ("train", f"resume={folder}/next", *QUICK)]


def evaluate_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    return [("evaluate", f"checkpoint={folder}", f"out={folder}/out/x.json", *FEW)]


def record_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    return [("record", "expert=true", "task=reach", "episodes=1", f"out={folder}"), ("record", f"replay={folder}")]


def report_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    return [("trainers.reports.report", str(folder))]


def sweep_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    few = (*TINY_RUN, *QUICK, "total_frames=128", "sweep.jobs=1")
    return [("train", "-m", "seed=1", *few, f"hydra.sweep.dir={folder}"), ("train", "-m", f"sweep.resume={folder}")]


def play_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    small = ("workspace.cameras.film.width=64", "workspace.cameras.film.height=48", "task.max_steps=8")
    return [("play", f"--headless={folder}/a.mp4", "--say=reach {0}", f"checkpoint={folder}", *small)]


def parse_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    folder.mkdir()
    (folder / "scene.yaml").write_text(SCENE)
    return [("language.__main__", "parse", "reach the red cube", "--scene", f"{folder}/scene.yaml")]


def record_policy_there(run: Path, folder: Path) -> list[tuple[str, ...]]:
    shutil.copytree(run, folder)
    return [("record", f"checkpoint={folder}", "episodes=1", f"out={folder}/out-v0", "format=minari")]


COMMANDS = (train_there, resume_there, begin_with, evaluate_there, record_there, report_there)
COMMANDS += (sweep_there, play_there, parse_there, record_policy_there)


def _run(words: tuple[str, ...]) -> None:
    program, *rest = words
    sys.argv = [f"{program}.py", *rest]
    module = importlib.import_module(program)
    if program == "language.__main__":
        sys.exit(module.run())
    module.cli(rest)


def _failure(command: Callable, run: Path, place: Path, name: str) -> str:
    folder = place / name
    for words in command(run, folder):
        done = call(partial(_run, words), place, timeout=120.0)
        if command is sweep_there and "${" in name and done.message.endswith("give another one"):
            return ""  # jobs compose the name of the sweep's folder again: it is refused
        if done.code or done.has_traceback:
            return f"{' '.join(words)[:200]}: {done.code} {(done.err.strip().splitlines() or ['?'])[-1][:200]}"
    made = {path.name for path in place.iterdir()} - {"outputs", "multirun"}
    return "" if made == {name} else f"{command.__name__} {name!r} made {made}"


@pytest.mark.slow
def test_a_folder_of_any_name_is_used_as_it_is_written(row, tiny_run, tmp_path):
    """Each program runs in a fork."""
    import trainers.run.train_loop  # noqa: F401  imported once, before the forks

    every = [(command, name) for name in NAMES for command in COMMANDS]
    number = row.number(sample=5, thorough=len(every))
    for index, (command, name) in enumerate(every if number >= len(every) else row.rng.sample(every, number)):
        place = tmp_path / f"try-{index}"
        place.mkdir()
        row.count(_failure(command, tiny_run, place, name))
    row.check()

"""Whole runs that are stopped or killed, in processes of their own, and resumed."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tools.whole_runs import ALGORITHMS, SMALL, command, differences, finish, start, stop_at
from trainers.run.run_folder import SEMAPHORE_NAME, SEMAPHORES

pytestmark = pytest.mark.slow
FRAMES, BATCH, ROWS = 640, 64, 10  # of a run of ALGORITHMS
CASES = [  # by index: algorithm, workers, and how it is stopped
    (("ppo", "sac")[index % 2], 1 + index // 2 % 2, ("SIGTERM", "SIGKILL", "end")[index % 3]) for index in range(12)
]


def test_a_run_that_is_stopped_at_a_random_iteration_goes_on_bit_for_bit(row, tmp_path):
    number = row.number(sample=0, thorough=40)
    if number == 0:
        pytest.skip("tests/trainers/run/test_resume.py stops runs within a process; whole ones: --thorough or --tries")
    whole: dict[tuple[str, int], Path] = {}
    for index in range(number):
        algo, workers, how = CASES[index % len(CASES)]
        words = [f"algo={algo}", f"collector.workers={workers}", *SMALL, *ALGORITHMS[algo]]
        if (algo, workers) not in whole:
            whole[algo, workers] = tmp_path / f"whole-{algo}-{workers}"
            assert not finish(command(whole[algo, workers], *words))
        at, place = row.rng.randint(1, ROWS - 1), tmp_path / f"try-{index}"
        wrong = _stopped_and_resumed(place, words, how, at) or differences(whole[algo, workers], place)
        row.count(f"{algo}, {workers} workers, {how} at row {at}: {wrong}" if wrong else "")
    row.check()


def _stopped_and_resumed(place: Path, words: list[str], how: str, at: int) -> str:
    """Make one try; return the error, or ""."""
    if how == "end":
        wrong = finish(command(place, *words, f"total_frames={BATCH * at}", f"schedule_frames={FRAMES}"))
    else:
        wrong = stop_at(start(command(place, *words)), place, at, getattr(signal, how))
    return wrong or finish(command(place, f"resume={place}", f"total_frames={FRAMES}"))


def test_a_run_whose_group_is_killed_again_and_again_goes_on_bit_for_bit(row, tmp_path):
    """A run is killed some seconds after it goes on; when it ends, it is compared and another one begins."""
    number = row.number(sample=0, thorough=100)
    if number == 0:
        pytest.skip("kills at random moments need many tries: --thorough or --tries")
    words = ["algo=sac", "collector.workers=2", *SMALL, *ALGORITHMS["sac"]]
    row.figures |= {"runs": 0, "left over": 0}
    began = time.monotonic()
    assert not finish(command(tmp_path / "whole", *words))
    seconds, place, run = time.monotonic() - began, tmp_path / "run-0", 0
    while row.tries < number:
        process = start(command(place, *([f"resume={place}"] if _has_checkpoint(place) else words)))
        try:
            _, errors = process.communicate(timeout=row.rng.uniform(0.2, 1.0) * seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            row.count()
            continue
        if process.returncode:
            row.failures.append(f"it cannot go on: {errors.decode()[-300:]}")
        elif wrong := differences(tmp_path / "whole", place):
            row.failures.append(wrong)
        row.figures["runs"] += 1
        row.figures["left over"] += len(list(place.rglob(".*.tmp*"))) + len(_orphaned_semaphores())
        run += 1
        place = tmp_path / f"run-{run}"
    row.check()
    assert row.figures["left over"] == 0


def _has_checkpoint(place: Path) -> bool:
    return (place / "checkpoints" / "last.pt").exists()


def _orphaned_semaphores() -> list[Path]:
    """Return semaphores of runs whose process is gone; other runs may go on beside this one."""
    found = ((path, SEMAPHORE_NAME.fullmatch(path.name)) for path in SEMAPHORES.glob("sem.mp-deixis-*"))
    return [path for path, match in found if match and not Path(f"/proc/{match[1]}").exists()]

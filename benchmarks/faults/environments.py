"""`check_env` on the project's own tasks; `tests/envs/test_checker.py` plants the bugs that it must find."""

from __future__ import annotations

import time
from pathlib import Path
from random import Random

from benchmarks.faults.rows import Outcome, row
from core.overrides import groups
from envs import check_env, make_env
from envs.checker import EnvError

MAX_SECONDS = 20.0  # of CPU time, a task


@row("check_env", "the environment check on every task: findings, or more than 20 s", 1000)
def measure(tries: int, rng: Random, folder: Path) -> Outcome:
    """Check every task, or the first `tries`."""
    outcome = Outcome()
    for task in groups()["task"][:tries]:
        start = time.process_time()
        try:
            check_env(lambda worlds, seed, task=task: make_env([f"task={task}"], worlds, seed))  # type: ignore[misc]
            failure = ""
        except EnvError as error:
            failure = f"{task}: {' | '.join(str(error).splitlines())}"
        seconds = time.process_time() - start
        outcome.figures[task] = round(seconds, 1)
        outcome.count(failure or (f"{task}: {seconds:.1f} s" if seconds > MAX_SECONDS else ""))
    return outcome

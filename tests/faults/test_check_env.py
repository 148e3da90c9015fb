"""`check_env` on the project's own tasks; `tests/envs/test_checker.py` plants the bugs that it must find."""

from __future__ import annotations

import time

import pytest

from core.overrides import groups
from envs import check_env, make_env
from envs.checker import EnvError

MAX_SECONDS = 20.0  # of CPU time, a task


@pytest.mark.slow
def test_the_environment_check_finds_nothing_in_any_task_within_its_time(row):
    every = list(groups()["task"])
    number = row.number(sample=2, thorough=len(every))
    for task in every if number >= len(every) else row.rng.sample(every, number):
        start = time.process_time()
        try:
            check_env(lambda worlds, seed, task=task: make_env([f"task={task}"], worlds, seed))
            failure = ""
        except EnvError as error:
            failure = f"{task}: {' | '.join(str(error).splitlines())}"
        seconds = time.process_time() - start
        row.figures[task] = round(seconds, 1)
        row.count(failure or (f"{task}: {seconds:.1f} s" if seconds > MAX_SECONDS else ""))
    row.check()

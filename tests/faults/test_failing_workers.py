"""Worker processes that stop, die, raise, crash or loop in the middle of a run."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import pytest
from omegaconf import OmegaConf

from core.overrides import compose
from envs.config import read_env
from language import Tokenizer
from tests.helpers.faulty_env import make_env
from tools.whole_runs import ALGORITHMS, SMALL, differences
from trainers.collect.rollouts import WorkerPool
from trainers.config import read_training
from trainers.run.evaluator import Evaluator
from trainers.run.train_loop import TrainingRun, fit

SIGNALS = {"SIGSTOP": signal.SIGSTOP, "SIGKILL": signal.SIGKILL}
INSIDE = ("raise", "segfault", "loop")  # faults that a worker causes itself, at its next step
PHASES = ("collection", "update", "evaluation")


class WorkerFault:
    """A fault that happens once, in one phase of one iteration, and how long it took to be noticed."""

    def __init__(self, *, kind: str, phase: str, iteration: int, trigger: Path, rng: Random) -> None:
        self.kind, self.phase, self.iteration, self.trigger, self.rng = kind, phase, iteration, trigger, rng
        self.pool: Any = None
        self.collected = 0  # iteration of the batch that was asked for last
        self.waited_from = 0.0
        self.noticed: float | None = None
        self.done = False

    def happen(self) -> None:
        """Cause the fault in a worker."""
        self.done, self.waited_from = True, time.monotonic()
        if self.kind in SIGNALS:
            process = self.rng.choice(self.pool.workers).process
            os.kill(process.pid, SIGNALS[self.kind])
        else:
            self.trigger.write_text(self.kind)

    def due(self, phase: str, iteration: int) -> bool:
        """Return whether it is to happen now."""
        return not self.done and self.phase == phase and iteration >= self.iteration and self.pool is not None

    def patches(self) -> list[Any]:
        """Return the patches, as arguments of `patch.object`."""
        collect, replace = WorkerPool.collect, WorkerPool._replace
        update, evaluated = TrainingRun.add_drawn_scenes, Evaluator.request

        def collecting(pool: Any, order: Any) -> Any:
            self.pool, self.collected = pool, order.iteration
            if self.due("collection", order.iteration):
                threading.Timer(self.rng.uniform(0.0, 0.2), self.happen).start()
            if self.done and self.noticed is None:
                self.waited_from = time.monotonic()
            return collect(pool, order)

        def replacing(pool: Any, *more: Any) -> Any:
            self.noticed = self.noticed or time.monotonic() - self.waited_from
            return replace(pool, *more)

        return [
            (WorkerPool, "collect", collecting),
            (WorkerPool, "_replace", replacing),
            (TrainingRun, "add_drawn_scenes", self._before("update", update)),
            (Evaluator, "request", self._before("evaluation", evaluated)),
        ]

    def _before(self, phase: str, function: Callable) -> Callable:
        def called(*arguments: Any) -> Any:
            if self.due(phase, self.collected):
                self.happen()
            return function(*arguments)

        return called


def _train(folder: Path, overrides: list[str], fault: WorkerFault | None) -> None:
    """Run in this process with worker processes."""
    config = compose(overrides)
    trigger = folder.with_suffix(".trigger") if fault is None else fault.trigger
    make = partial(make_env, read_env(config), trigger, os.getpid())
    patches = [patch.object(*each) for each in (fault.patches() if fault else [])]
    for each in patches:
        each.start()
    try:
        plain: Any = OmegaConf.to_container(config, resolve=True)
        fit(read_training(config), make, folder, plain, list(Tokenizer.default().vocabulary))
    finally:
        for each in patches:
            each.stop()


@pytest.mark.slow
def test_a_run_whose_worker_fails_has_the_result_of_an_undisturbed_run(row, tmp_path):
    """Each fault in each phase, PPO and SAC in turn."""
    row.figures |= {"noticed after s, at most": 0.0, "never happened": 0}
    whole: dict[str, Path] = {}
    first = 3  # SAC, a segmentation fault in an update
    for index in range(first, first + row.number(sample=1, thorough=50)):
        algo = ("ppo", "sac")[index % 2]
        overrides = [f"algo={algo}", "collector.workers=2", *SMALL, *ALGORITHMS[algo]]
        if algo not in whole:
            whole[algo] = tmp_path / algo
            _train(whole[algo], overrides, None)
        kind, phase = (*SIGNALS, *INSIDE)[index % 5], PHASES[index // 2 % 3]
        place = tmp_path / f"try-{index}"
        trigger, iteration = place.with_suffix(".trigger"), row.rng.randint(1, 4)
        fault = WorkerFault(kind=kind, phase=phase, iteration=iteration, trigger=trigger, rng=row.rng)
        try:
            _train(place, overrides, fault)
            wrong = differences(whole[algo], place)
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
        row.figures["never happened"] += fault.noticed is None
        row.figures["noticed after s, at most"] = max(
            row.figures["noticed after s, at most"], round(fault.noticed or 0.0, 2)
        )
        row.count(f"{algo}, {kind} in {phase}: {wrong}" if wrong else "")
    row.check()
    assert row.figures["never happened"] < row.tries

"""Worker processes that stop, die, raise, crash or loop in the middle of a run."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from omegaconf import OmegaConf

from benchmarks.faults.rows import Outcome, row
from benchmarks.faults.runs import ALGORITHMS, SMALL, differences
from core.overrides import compose
from envs.config import EnvConfig, read_env
from envs.workspace_env import WorkspaceEnv
from language import Tokenizer
from trainers.collect.worker_pool import WorkerPool
from trainers.config import read_plan
from trainers.run.evaluator import Evaluator
from trainers.run.train_loop import TrainingRun, fit

SIGNALS = {"SIGSTOP": signal.SIGSTOP, "SIGKILL": signal.SIGKILL}
INSIDE = ("raise", "segfault", "loop")  # faults that a worker causes itself, at its next step
PHASES = ("collection", "update", "evaluation")


class FaultyEnv(WorkspaceEnv):
    """Fails at its next step as the file `trigger` says, and removes the file: only one worker fails, once.

    The file is looked for in worker processes alone.
    """

    trigger: Path | None = None

    def _step(self, tensordict: Any) -> Any:
        if self.trigger is not None and self.trigger.exists():
            fault = self.trigger.read_text()
            try:
                self.trigger.rename(self.trigger.with_suffix(".taken"))
            except FileNotFoundError:  # another worker was faster
                return super()._step(tensordict)
            fail(fault)
        return super()._step(tensordict)


def fail(fault: str) -> None:
    """Fail in this way."""
    if fault == "raise":
        raise ArithmeticError("planted")
    if fault == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    while True:
        pass


def make_env(config: EnvConfig, trigger: Path, main: int, worlds: int, seed: int) -> WorkspaceEnv:
    """Return a module-level function, so that worker processes can unpickle it."""
    env = FaultyEnv(config, worlds, seed)
    env.trigger = trigger if os.getpid() != main else None
    return env


class Fault:
    """Happens once, in one phase of one iteration, and measures how long it took to be noticed."""

    def __init__(self, kind: str, phase: str, iteration: int, trigger: Path, random: Random) -> None:
        self.kind, self.phase, self.iteration, self.trigger, self.random = kind, phase, iteration, trigger, random
        self.pool: Any = None
        self.collected = 0  # iteration of the batch that was asked for last
        self.waited_from = 0.0
        self.noticed: float | None = None
        self.done = False

    def happen(self) -> None:
        """Cause the fault in a worker."""
        self.done, self.waited_from = True, time.monotonic()
        if self.kind in SIGNALS:
            process = self.random.choice(self.pool.workers).process
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
                threading.Timer(self.random.uniform(0.0, 0.2), self.happen).start()
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


def train(folder: Path, overrides: list[str], fault: Fault | None) -> None:
    """A run in this process with worker processes."""
    config = compose(overrides)
    trigger = folder.with_suffix(".trigger") if fault is None else fault.trigger
    make = partial(make_env, read_env(config), trigger, os.getpid())
    patches = [patch.object(*each) for each in (fault.patches() if fault else [])]
    for each in patches:
        each.start()
    try:
        plain: Any = OmegaConf.to_container(config, resolve=True)
        fit(read_plan(config), make, folder, plain, list(Tokenizer.default().vocabulary))
    finally:
        for each in patches:
            each.stop()


@row("workers", "a worker stops, dies, raises, crashes or loops: the undisturbed run's result", 50)
def workers(tries: int, random: Random, folder: Path) -> Outcome:
    """Each fault in each phase, PPO and SAC in turn."""
    outcome = Outcome(figures={"noticed after s, at most": 0.0, "never happened": 0})
    whole: dict[str, Path] = {}
    for index in range(tries):
        algo = ("ppo", "sac")[index % 2]
        overrides = [f"algo={algo}", "collector.workers=2", *SMALL, *ALGORITHMS[algo]]
        if algo not in whole:
            whole[algo] = folder / algo
            train(whole[algo], overrides, None)
        kind, phase = (*SIGNALS, *INSIDE)[index % 5], PHASES[index // 2 % 3]
        place = folder / f"try-{index}"
        fault = Fault(kind, phase, random.randint(1, 4), place.with_suffix(".trigger"), random)
        try:
            train(place, overrides, fault)
            wrong = differences(whole[algo], place)
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
        outcome.tries += 1
        outcome.figures["never happened"] += fault.noticed is None
        longest = max(outcome.figures["noticed after s, at most"], round(fault.noticed or 0.0, 2))
        outcome.figures["noticed after s, at most"] = longest
        print(f"{algo} {kind} in {phase}: noticed after {fault.noticed} s {wrong}", file=sys.stderr, flush=True)
        if wrong:
            outcome.failures.append(f"{algo}, {kind} in {phase}: {wrong}")
    return outcome

"""The processes of trials: one robot each, so that no participant's steps delay those of others."""

from __future__ import annotations

import asyncio
import socket
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.errors import ConfigError
from demo.study.progress import StudyTrial, TrialJob
from demo.study.study_config import StudyConfig

ENDED = 5.0  # seconds that a killed process has to end
MOST_STARTS = 3  # of a robot's process that ends at once, after which nobody starts it again
AT_ONCE = 10.0  # seconds of a trial's clock that such a process does not reach
DIES = f"The robot could not be started, {MOST_STARTS} times. Please tell the experimenter; all that you did is kept."
FULL = "All robots are in use. One moment: you go on as soon as one is free."


@dataclass
class RunningTrial:
    """The process of a trial.

    run: number of it since the server began. asked_port: that its page goes by. port, token: of its page; 0 and ""
    until it is ready. rate: speed of its
    clock, as a share of real time. clock: seconds of it that are over. failed: why it cannot go on. left: when its
    participant was last there, of the clock that never goes back.
    """

    trial: StudyTrial
    run: int
    process: Any
    pipe: Any
    asked_port: int
    port: int = 0
    token: str = ""
    rate: float = 1.0
    clock: float = 0.0
    failed: str = ""
    goal: bool = False
    left: float = field(default_factory=time.monotonic)


class TrialHost:
    """Starts and ends the processes of trials. For the thread of the event loop.

    Args:
        study: the study.
        database: path of its database.
        context: of multiprocessing, that processes are started in.
        tell: called with a code once something has changed for this participant; "goal" or "time" for what ends a
            trial, else "".
    """

    def __init__(self, study: StudyConfig, database: Path, context: Any, tell: Callable[[str, str], None]) -> None:
        self._study, self._database, self._context, self._tell = study, database, context, tell
        self._runs = int(time.time())  # another one after a restart, so that pages load the robot again
        self._short_lives: dict[str, int] = {}  # by code: of processes in a row that ended at once
        self.running: dict[str, RunningTrial] = {}

    def start(self, trial: StudyTrial) -> None:
        """Have the robot of a trial run, unless it does. Does nothing while all places are taken."""
        current = self.running.get(trial.code)
        if current is not None and current.trial.number == trial.number:
            return
        self.end(trial.code)
        if len(self.running) >= self._study.at_once:
            return
        ours, theirs = self._context.Pipe()
        job = TrialJob(self._study, trial, self._database, _free_port())
        process = self._context.Process(target=_run_trial, args=(job, theirs), daemon=True)
        self._runs += 1
        running = RunningTrial(trial, self._runs, process, ours, job.port, clock=trial.clock)
        self.running[trial.code] = running
        loop = asyncio.get_running_loop()
        threading.Thread(target=self._run, args=(running, theirs, loop), daemon=True).start()

    def _run(self, running: RunningTrial, theirs: Any, loop: asyncio.AbstractEventLoop) -> None:
        """Start the process, and take what it tells until it ends. In a thread of its own."""
        try:
            running.process.start()
            theirs.close()
            while True:
                message = running.pipe.recv()
                loop.call_soon_threadsafe(self._take, running, message)
        except (EOFError, OSError, ValueError):
            pass
        try:
            loop.call_soon_threadsafe(self._take, running, ("ended",))
        except RuntimeError:  # the server has ended
            return

    def _take(self, running: RunningTrial, message: tuple[Any, ...]) -> None:
        code = running.trial.code
        if self.running.get(code) is not running:
            return
        match message:
            case ("ready", port, token):
                running.port, running.token = port, token
                self._tell(code, "")
            case ("pulse", clock, rate):
                running.clock, running.rate = clock, rate
            case ("goal" | "time" as why,):
                running.goal = running.goal or why == "goal"
                self._tell(code, why)
            case ("failed", text):
                running.failed = text
                print(f"the robot of participant {code} cannot go on: {text}", file=sys.stderr, flush=True)
                self._tell(code, "")
            case ("ended",):
                if running.failed:
                    running.port = 0
                else:  # killed by somebody else: it is started again, where it was, unless it ends at once
                    self._count_end(running)
                    self._tell(code, "")

    def _count_end(self, running: RunningTrial) -> None:
        """Take away a process that has ended, or say that it cannot go on if it has ended at once too often."""
        code, lived = running.trial.code, running.clock - running.trial.clock
        short = self._short_lives.get(code, 0) + 1 if lived < AT_ONCE else 0
        self._short_lives[code] = short
        if short < MOST_STARTS:
            del self.running[code]
            return
        running.failed, running.port = DIES, 0
        why = f"its process ended {short} times at once, the last time with exit code {running.process.exitcode}"
        again = "'Stop' and 'Go on' on the experimenter's page start it again"
        print(f"the robot of participant {code} cannot go on: {why}; {again}", file=sys.stderr, flush=True)

    def end(self, code: str) -> None:
        """End the process of a participant, if there is one. It writes nothing more once this returns."""
        running = self.running.pop(code, None)
        if running is None:
            return
        self._short_lives.pop(code, None)
        if running.process.pid is None:  # it is being started; it ends when it finds its pipe closed
            running.pipe.close()
            return
        running.process.kill()
        running.process.join(ENDED)

    def end_all(self) -> None:
        """End all processes."""
        for code in list(self.running):
            self.end(code)


def prepare_study(study: StudyConfig, context: Any) -> dict[str, tuple[bytes, bytes, str]]:
    """Check what a study needs, and have the expert bring about its goals, in a process of their own.

    Returns:
        What `goals.prepare_goal` returns, by the scene's name.

    Raises:
        ConfigError: a policy, task or robot is not there or does not fit; a goal cannot be reached.
    """
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_run_preparation, args=(study, theirs), daemon=True)
    process.start()
    theirs.close()
    try:
        result = ours.recv()
    except EOFError:
        raise ConfigError("the goals of the scenes cannot be prepared: see the error above") from None
    process.join(ENDED)
    if isinstance(result, str):
        raise ConfigError(result)
    return result


def _run_trial(job: TrialJob, pipe: Any) -> None:
    """In the new process, which has imported what this one does without."""
    from demo.study.trial_process import run_trial

    run_trial(job, pipe)


def _run_preparation(study: StudyConfig, pipe: Any) -> None:
    from demo.study.trial_process import run_preparation

    run_preparation(study, pipe)


def _free_port() -> int:
    """A port of this machine that no program listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])

"""A process beside training that evaluates policies and records their video."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase

from trainers.rollout.child_process import ChildProcess, detach
from trainers.rollout.evaluation import EvalResult, Interrupted, evaluate
from trainers.rollout.video import record_video
from trainers.rollout.worker_host import Failure
from trainers.utils.atomic_io import atomic_path

ALIVE = "alive"  # message that the process sends about once a second during an evaluation
ALIVE_SECONDS = 1.0
POLL_SECONDS = 0.2  # between two looks at the signals


class ProcessLostError(Exception):
    """The process has ended or does not answer. The text says which."""


@dataclass(frozen=True)
class EpisodesTask:
    """Evaluate this number of episodes over all worlds, drawn from the seed."""

    episodes: int
    seed: int

    silence = 120.0  # seconds without a sign of life before the process counts as lost: it may have to build worlds

    def run(self, env: EnvBase, policy: TensorDictModuleBase, stop: Callable[[], bool]) -> EvalResult:
        return evaluate(env, policy, self.episodes, self.seed, stop)


@dataclass(frozen=True)
class VideoTask:
    """Record this number of episodes of an environment that renders, in an mp4 file."""

    make_env: Callable[[], EnvBase]
    path: Path
    episodes: int

    @property
    def silence(self) -> float:
        return EpisodesTask.silence + 60.0 * self.episodes

    def run(self, policy: TensorDictModuleBase) -> None:
        with closing(self.make_env()) as env, atomic_path(self.path) as path:
            record_video(env, policy, path, self.episodes)


class EvaluationProcess(ChildProcess):
    """Builds its worlds for its first evaluation.

    Args:
        make_worlds: builds the worlds of evaluations; picklable.
        policy: acts in them. Its weights are in shared memory: they must not change during a task.
    """

    def __init__(self, make_worlds: Callable[[], EnvBase], policy: Any) -> None:
        super().__init__(_serve, make_worlds, policy)
        self.task: EpisodesTask | VideoTask | None = None
        self.heard_at = 0.0  # when it gave the last sign of life, as `time.monotonic` has it

    def begin(self, task: EpisodesTask | VideoTask) -> None:
        """Begin a task. The former one's answer must have been received."""
        self.task, self.heard_at = task, time.monotonic()
        self.send(task)

    def answer(self, wait: bool, stop: Callable[[], bool]) -> Any:
        """The outcome of the task: a result, True for a video, or the exception. None: not finished.

        Args:
            wait: for the answer.
            stop: called while it waits.

        Raises:
            Interrupted: `stop` returned True.
            ProcessLostError: the process has ended or was silent for too long.
        """
        assert self.task is not None
        while True:
            message = self._receive(POLL_SECONDS if wait else 0.0)
            if message is not None and message != ALIVE:
                return message
            if message is None and not wait:
                return None
            if stop():
                raise Interrupted
            if time.monotonic() - self.heard_at > self.task.silence:
                raise ProcessLostError(f"gave no sign of life for {self.task.silence:.0f} s")

    def _receive(self, seconds: float) -> Any:
        """A message that arrives within `seconds`, else None."""
        try:
            if not self.connection.poll(seconds):
                return None
            message = self.connection.recv()
        except (EOFError, OSError):
            raise ProcessLostError(self.ending()) from None
        self.heard_at = time.monotonic()
        return message


class _SignOfLife:
    """Called at each control step. Reports once a second that the task goes on. Never stops the task."""

    def __init__(self, connection: Connection) -> None:
        self.connection, self.sent_at = connection, time.monotonic()

    def __call__(self) -> bool:
        if time.monotonic() - self.sent_at > ALIVE_SECONDS:
            self.connection.send(ALIVE)
            self.sent_at = time.monotonic()
        return False


def _serve(connection: Connection, make_worlds: Callable[[], EnvBase], policy: Any) -> None:
    """Carry out tasks until the main process closes the pipe. An exception's text is sent as the answer."""
    detach()
    env: EnvBase | None = None
    try:
        while True:
            task = connection.recv()
            try:
                if isinstance(task, VideoTask):
                    task.run(policy.act)
                    answer: Any = True
                else:
                    env = make_worlds() if env is None else env
                    answer = task.run(env, policy.act, _SignOfLife(connection))
            except Exception as error:
                answer = Failure.of(error)
            connection.send(answer)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass

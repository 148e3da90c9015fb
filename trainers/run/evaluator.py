"""Evaluations and videos during training: in this process, or in one beside it that training does not wait for."""

from __future__ import annotations

import copy
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase

from core.errors import Interrupted
from trainers.collect.rollouts import CollectionError
from trainers.collect.worker import ChildProcess, Failure, MakeEnv, derive_seed, detach, raised
from trainers.evaluation.evaluation import EvalResult, evaluate
from trainers.evaluation.video import record_video
from trainers.models.policy import Policy
from trainers.utils.files import atomic_path

ALIVE = "alive"  # message that the process sends about once a second during an evaluation
ALIVE_SECONDS = 1.0
POLL_SECONDS = 0.2  # between two looks at the signals


class Evaluator:
    """Evaluates a policy on episodes that neither training nor another evaluation uses.

    A requested evaluation has the same result whichever process it runs in. If the other process is lost, this one
    does its work.

    Args:
        make_env: `make_env(worlds, seed)` builds the environment; picklable.
        policy: has the structure of the policies to evaluate.
        worlds: of an evaluation.
        seed: of the run.
        beside: whether requested tasks run in a process of their own.
    """

    def __init__(self, make_env: MakeEnv, policy: Policy, *, worlds: int, seed: int, beside: bool) -> None:
        self.make_worlds = partial(make_env, worlds, derive_seed(seed, 0, evaluation=True))
        self.seed, self.beside = seed, beside
        self.policy = copy.deepcopy(policy).cpu()  # with the weights that were requested; worlds are on the CPU
        self.env: EnvBase | None = None
        self.process: EvaluationProcess | None = None
        self.task: EpisodesTask | VideoTask | None = None  # that was requested; None once its result was taken

    def evaluate(self, policy: Policy, episodes: int, index: int, stop: Callable[[], bool]) -> EvalResult:
        """Evaluate the deterministic policy now, in this process.

        Args:
            policy: on any device.
            episodes: their number over all worlds.
            index: of the evaluation in the run; it seeds the episodes.
            stop: called at each step; True interrupts the evaluation.

        Raises:
            CollectionError: the environment raised because of a value that is not finite.
            Interrupted: `stop` returned True.
        """
        return self._evaluate(self._episodes(episodes, index), on_cpu(policy), stop)

    def request(self, weights: Mapping[str, Tensor], episodes: int, index: int) -> None:
        """Ask for an evaluation with these weights, which may change after the call. Its result must be taken."""
        self._request(weights, self._episodes(episodes, index))

    def request_video(self, weights: Mapping[str, Tensor], video: VideoTask) -> None:
        """Ask for a video with these weights. `finish_video` must be called."""
        self._request(weights, video)

    def result(self, wait: bool, stop: Callable[[], bool]) -> EvalResult | None:
        """Return the result of the requested evaluation; None if it is not finished and `wait` is False.

        Raises:
            CollectionError: as `evaluate`.
            Interrupted: `stop` returned True; the evaluation stays requested.
        """
        assert isinstance(self.task, EpisodesTask)
        answer = self._answer(wait, stop)
        if isinstance(answer, Failure):
            raise CollectionError(f"an evaluation {answer.text}") from answer.error()
        if answer is None and self.process is None:
            answer = self._evaluate(self.task, self.policy.act, stop)
        if answer is not None:
            self.task = None
        return answer

    def finish_video(self) -> None:
        """Wait until the requested video is written. Raises the exceptions of the recording."""
        assert isinstance(self.task, VideoTask)
        if self._answer(wait=True) is not True:  # none beside, it was lost, or it raised: this process raises it itself
            self.task.run(self.policy.act)
        self.task = None

    def close(self) -> None:
        """End the worlds and the process."""
        if self.env is not None:
            self.env.close()
        if self.process is not None:
            self.process.kill()

    def _episodes(self, episodes: int, index: int) -> EpisodesTask:
        return EpisodesTask(episodes, derive_seed(self.seed, index, evaluation=True))

    def _request(self, weights: Mapping[str, Tensor], task: EpisodesTask | VideoTask) -> None:
        assert self.task is None
        self.task = task
        self.policy.load_state_dict(dict(weights))
        if self.beside:
            if self.process is None:
                self.process = EvaluationProcess(self.make_worlds, self.policy.share_memory())
            self.process.begin(task)

    def _answer(self, wait: bool, stop: Callable[[], bool] = lambda: False) -> Any:
        """Return the answer of the other process; None if it has not answered, or does not exist (any more)."""
        if self.process is None:
            return None
        try:
            return self.process.answer(wait, stop)
        except ProcessLostError as error:
            print(f"warning: the evaluation process {error}; this process goes on", file=sys.stderr, flush=True)
            self.process.kill()
            self.process, self.beside = None, False
            return None

    def _worlds(self) -> EnvBase:
        if self.env is None:
            self.env = self.make_worlds()
        return self.env

    def _evaluate(self, task: EpisodesTask, act: TensorDictModuleBase, stop: Callable[[], bool]) -> EvalResult:
        with torch.random.fork_rng(devices=[]):  # an evaluation that is interrupted and repeated changes nothing
            try:
                return task.run(self._worlds(), act, stop)
            except ValueError as error:
                if not hasattr(error, "frame"):
                    raise
                raise CollectionError(f"an evaluation {raised(error)}") from error


def on_cpu(policy: Policy) -> TensorDictModuleBase:
    """Return the policy as it acts in the worlds, which are on the CPU; a copy if it learns on another device."""
    return policy.act if next(policy.parameters()).device.type == "cpu" else copy.deepcopy(policy).cpu().act


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


class ProcessLostError(Exception):
    """The process has ended or does not answer. The text says which."""


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
        """Return the outcome of the task: a result, True for a video, or the exception. None: not finished.

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
        """Return a message that arrives within `seconds`, else None."""
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

"""The evaluations of a run, on worlds of their own: in this process, or beside training in another one."""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase

from trainers.models.policy import Policy
from trainers.rollout.evaluation import EvalResult
from trainers.rollout.seeds import derive_seed
from trainers.rollout.worker import MakeEnv
from trainers.rollout.worker_host import Failure, raised
from trainers.rollout.worker_pool import CollectionError
from trainers.run.evaluation_process import EpisodesTask, EvaluationProcess, ProcessLostError, VideoTask


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

    def __init__(self, make_env: MakeEnv, policy: Policy, worlds: int, seed: int, beside: bool) -> None:
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
        """The result of the requested evaluation; None if it is not finished and `wait` is False.

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
        """The answer of the other process; None if it has not answered, or does not exist (any more)."""
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
    """The policy as it acts in the worlds, which are on the CPU; a copy if it learns on another device."""
    return policy.act if next(policy.parameters()).device.type == "cpu" else copy.deepcopy(policy).cpu().act

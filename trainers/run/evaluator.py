"""The evaluations of a run, on worlds of their own."""

from __future__ import annotations

import copy
from collections.abc import Callable

import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase

from trainers.models.policy import Policy
from trainers.rollout.evaluation import EvalResult, evaluate
from trainers.rollout.seeds import derive_seed
from trainers.rollout.worker import MakeEnv
from trainers.rollout.worker_pool import CollectionError


class Evaluator:
    """Evaluates a policy on episodes that neither training nor another evaluation uses.

    Args:
        make_env: `make_env(worlds, seed)` builds the environment.
        worlds: of an evaluation.
        seed: of the run.
    """

    def __init__(self, make_env: MakeEnv, worlds: int, seed: int) -> None:
        self.make_env, self.worlds, self.seed = make_env, worlds, seed
        self.env: EnvBase | None = None

    def make_worlds(self, count: int) -> EnvBase:
        """So many worlds like those of the evaluations."""
        return self.make_env(count, derive_seed(self.seed, 0, evaluation=True))

    def prepare(self) -> EnvBase:
        """The worlds, which are built at the first call."""
        if self.env is None:
            self.env = self.make_worlds(self.worlds)
        return self.env

    def evaluate(self, policy: Policy, episodes: int, index: int, stop: Callable[[], bool]) -> EvalResult:
        """Evaluate the deterministic policy on the episodes of this index.

        Raises:
            CollectionError: the environment raised because of a value that is not finite.
            Interrupted: `stop` returned True.
        """
        seed = derive_seed(self.seed, index, evaluation=True)
        with torch.random.fork_rng(devices=[]):  # an evaluation that is interrupted and repeated changes nothing
            try:
                return evaluate(self.prepare(), on_cpu(policy), episodes, seed, stop)
            except ValueError as error:
                if not hasattr(error, "frame"):
                    raise
                raise CollectionError(f"an evaluation raised {type(error).__name__}: {error}") from error

    def close(self) -> None:
        """End the worlds."""
        if self.env is not None:
            self.env.close()


def on_cpu(policy: Policy) -> TensorDictModuleBase:
    """The policy as it acts in the worlds, which are on the CPU; a copy if it learns on another device."""
    return policy.act if next(policy.parameters()).device.type == "cpu" else copy.deepcopy(policy).cpu().act

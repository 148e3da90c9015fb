"""The specialists of a sweep: a policy for each kind of instruction, in place of one policy for all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from core.errors import ConfigError
from trainers.environment import TrainingEnv
from trainers.run import checkpoint
from trainers.run.checkpoint import fitted_policy
from trainers.sweeps.runs import find_runs


class Specialists(TensorDictModuleBase):
    """In each world, the policy for the kind of its instruction acts.

    Args:
        policies: by kind. Each writes "action".
        kinds: returns (N,) the kinds of the present instructions. They are told, not read from the words.
    """

    def __init__(self, policies: Mapping[int, TensorDictModuleBase], kinds: Callable[[], NDArray]) -> None:
        super().__init__()
        self.policies, self._kinds = dict(policies), kinds
        first = next(iter(self.policies.values()))
        self.in_keys, self.out_keys = first.in_keys, ["action"]

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        """Write "action" (N, A) to frames (N,)."""
        kinds = torch.as_tensor(self._kinds())
        rows = {kind: (kinds == kind).nonzero().flatten() for kind in kinds.unique().tolist()}
        actions = torch.cat([self.policies[kind](frames[each])["action"] for kind, each in rows.items()])
        return frames.set("action", actions[torch.cat(list(rows.values())).argsort()])


def load_specialists(folder: Path, env: TrainingEnv, kinds: Callable[[], NDArray]) -> Specialists:
    """Return the last policies of a sweep over `task.verbs`, one verb each, to act in this environment.

    Args:
        folder: of the sweep.
        env: of a task whose kinds of instructions are verbs.
        kinds: as of `Specialists`.

    Raises:
        ConfigError: a verb has no run or several, or a policy does not fit the environment.
    """
    places: dict[str, list[Path]] = {verb: [] for verb in env.kind_names}
    for run in find_runs(folder):
        verbs = run.config.get("task", {}).get("verbs") or []
        if len(verbs) == 1 and verbs[0] in places:
            places[verbs[0]].append(run.folder)
    wrong = {verb: len(found) for verb, found in places.items() if len(found) != 1}
    if wrong:
        counts = ", ".join(f"{count} for {verb}" for verb, count in wrong.items())
        raise ConfigError(
            f"specialists={folder} must hold one run for each kind of instruction, such as task.verbs=[stack] with "
            f"task=anything; it holds {counts}"
        )
    policies = {}
    for kind, verb in enumerate(env.kind_names):
        saved = checkpoint.load(checkpoint.find(places[verb][0], key="specialists"))
        policies[kind] = fitted_policy(saved, saved["config"], env).act
    return Specialists(policies, kinds)

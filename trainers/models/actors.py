"""The actor of a policy as TorchRL's losses take it: encoded frames to "move"."""

from __future__ import annotations

from collections.abc import Sequence

from tensordict import NestedKey
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.modules import IndependentNormal, ProbabilisticActor, TanhNormal

from trainers.models.policy import Policy


def stochastic_actor(policy: Policy, passed: Sequence[NestedKey] = ()) -> ProbabilisticActor:
    """(robot, context, ...) to the distribution of "move": a normal one, or its tanh where the policy squashes.

    passed: keys that the critic reads and the actor does not. TorchRL's TD3Loss and REDQLoss give the critic only those
    entries of a frame that are inputs of the actor, so these are declared as inputs and ignored.
    """
    return ProbabilisticActor(
        TensorDictModule(_Parameters(policy), in_keys=_in_keys(policy, passed), out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        out_keys=["move"],
        distribution_class=TanhNormal if policy.bounds.squash else IndependentNormal,
        return_log_prob=True,
    )


def deterministic_actor(policy: Policy, passed: Sequence[NestedKey] = ()) -> TensorDictModule:
    """(robot, context, ...) to the mean "move" (N, A). passed: as in `stochastic_actor`."""
    return TensorDictModule(_Mean(policy), in_keys=_in_keys(policy, passed), out_keys=["move"])


class _Parameters(nn.Module):
    """The actor's loc and scale; inputs beyond the actor's are ignored."""

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.actor, self.inputs = policy.actor, 1 + len(policy.actor_keys)

    def forward(self, *values: Tensor) -> tuple[Tensor, Tensor]:
        return self.actor(*values[: self.inputs])


class _Mean(_Parameters):
    def forward(self, *values: Tensor) -> Tensor:  # type: ignore[override]
        return super().forward(*values)[0]


def _in_keys(policy: Policy, passed: Sequence[NestedKey]) -> list[NestedKey]:
    robot, *more = policy.actor_keys
    return list(dict.fromkeys([robot, policy.context_key, *more, *passed]))

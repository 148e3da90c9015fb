"""The networks of actors and critics, and the layers that they are made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torchrl.data import Binary, Bounded, TensorSpec
from torchrl.modules import BatchRenorm1d

WARMUP_STEPS = 5_000


ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU}
LOG_STD = (-4.0, 1.0)  # bounds of the logarithm of the exploration noise


class BatchRenorm(BatchRenorm1d):
    """TorchRL's BatchRenorm1d with a counter that stops at the end of the warm-up.

    TorchRL 0.14.1 discards the result of its `clamp_max`, so the counter grows on and the correction is multiplied by
    2, 3, ... after two, three, ... times `warmup_steps`.
    """

    def __init__(self, features: int) -> None:
        super().__init__(features, warmup_steps=WARMUP_STEPS)

    def forward(self, x: Tensor) -> Tensor:
        self.num_batches_tracked.clamp_(max=self.warmup_steps)
        return super().forward(x)


NORMALISATIONS: dict[str, type[nn.Module]] = {"layer": nn.LayerNorm, "batch_renorm": BatchRenorm}


def mlp(
    inputs: int, hidden: Sequence[int], outputs: int, activation: str = "relu", normalisation: str = "none"
) -> nn.Sequential:
    """Linear layers with the activation between them, and none after the last.

    normalisation: layer: before each activation. batch_renorm: of the inputs and after each activation.
    """
    layers: list[nn.Module] = [BatchRenorm(inputs)] if normalisation == "batch_renorm" else []
    for a, b in pairwise([inputs, *hidden]):
        block = [nn.Linear(a, b), ACTIVATIONS[activation]()]
        if normalisation != "none":
            block.insert(1 if normalisation == "layer" else 2, NORMALISATIONS[normalisation](b))
        layers += block
    return nn.Sequential(*layers, nn.Linear([inputs, *hidden][-1], outputs))


class Normalise(nn.Module):
    """Maps the bounds of a spec to [-1, 1]; an element that cannot vary becomes 0.

    Args:
        spec: a bounded or binary leaf of shape (N, ..., D), the same bounds for every world and, in rows, every slot.
        flat: all numbers of a world side by side, in place of rows of D numbers.

    Raises:
        ValueError: the spec has no finite bounds.
    """

    centre: Tensor
    gain: Tensor

    def __init__(self, spec: TensorSpec, flat: bool = False) -> None:
        super().__init__()
        self.dims = len(spec.shape) - 1 if flat else 1  # of a world's values that are put side by side
        width = spec.shape[-self.dims :].numel() if self.dims else 0
        if not width or not isinstance(spec, Bounded | Binary):
            raise ValueError("an observation without finite bounds cannot be normalised")
        bounds = (spec.space.low, spec.space.high) if isinstance(spec, Bounded) else (spec.zero(), spec.zero() + 1)
        low, high = (bound.reshape(-1, width)[0].float() for bound in bounds)
        half = (high - low) / 2
        if not half.isfinite().all():
            raise ValueError("an observation without finite bounds cannot be normalised")
        self.shape = low.shape
        self.register_buffer("centre", (high + low) / 2)
        self.register_buffer("gain", torch.where(half > 0, 1 / half, torch.zeros_like(half)))

    def forward(self, x: Tensor) -> Tensor:
        x = x if x.is_floating_point() else x.float()
        return ((x.flatten(-self.dims) if self.dims > 1 else x) - self.centre) * self.gain


class GaussianActor(nn.Module):
    """Robot state, context, obstacle and further observations to loc and scale (N, A) of a move.

    The scale is a parameter (usual for PPO) or a second output of the network (usual for SAC).

    Args:
        robot: normalises the robot's state.
        context: width of context and obstacle together.
        hidden: widths of the hidden layers.
        actions: A.
        activation: a key of ACTIVATIONS.
        std: initial scale.
        state_dependent_std: whether the network outputs the scale.
        further: normalise the last inputs.
    """

    def __init__(
        self,
        robot: Normalise,
        *,
        context: int,
        hidden: Sequence[int],
        actions: int,
        activation: str,
        std: float,
        state_dependent_std: bool,
        further: Sequence[Normalise] = (),
    ) -> None:
        super().__init__()
        self.robot, self.state_dependent_std, self.further = robot, state_dependent_std, nn.ModuleList(further)
        inputs = robot.shape.numel() + context + sum(each.shape.numel() for each in further)
        self.net = mlp(inputs, hidden, actions * (1 + state_dependent_std), activation)
        self.log_std = nn.Parameter(torch.full((actions,), float(torch.tensor(std).log())))
        last = self.net[-1]
        assert isinstance(last, nn.Linear)
        nn.init.orthogonal_(last.weight, 0.01)  # a mean near 0: at first only the noise moves the arm
        nn.init.zeros_(last.bias)

    def forward(self, robot: Tensor, *context: Tensor) -> tuple[Tensor, Tensor]:
        taken = len(context) - len(self.further)
        further = (normalise(value) for normalise, value in zip(self.further, context[taken:], strict=True))
        out = self.net(torch.cat([self.robot(robot), *context[:taken], *further], -1))
        if not self.state_dependent_std:
            # tanh bounds the mean: noise could not reverse a saturated command. A gripper's command far above 0 was
            # never explored below 0.
            return out.tanh(), self.log_std.clamp(*LOG_STD).exp().expand_as(out)
        loc, offset = out.chunk(2, -1)
        return loc, (self.log_std + offset).clamp(*LOG_STD).exp()


class SeveralActors(nn.Module):
    """Several actors with the same inputs. Subclasses combine their outputs."""

    def __init__(self, actors: Sequence[GaussianActor]) -> None:
        super().__init__()
        self.stages = nn.ModuleList(actors)

    @property
    def log_stds(self) -> list[nn.Parameter]:
        """(A,) of the exploration noise of each actor."""
        return [each.log_std for each in self.stages]  # type: ignore[misc]

    @property
    def log_std(self) -> Tensor:
        """(actors, A) of the exploration noise."""
        return torch.stack(tuple(self.log_stds))

    def outputs(self, robot: Tensor, *context: Tensor) -> tuple[Tensor, Tensor]:
        """loc and scale of each actor, (actors, N, A)."""
        loc, scale = zip(*(actor(robot, *context) for actor in self.stages), strict=True)
        return torch.stack(loc), torch.stack(scale)


class StagedActor(SeveralActors):
    """Several actors, selected by the stage (N,) that the task is in. The last one acts in all later stages too."""

    def forward(self, robot: Tensor, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        *context, stage = inputs
        loc, scale = self.outputs(robot, *context)
        chosen = stage.clamp(max=len(loc) - 1), torch.arange(robot.shape[0], device=robot.device)
        return loc[chosen], scale[chosen]


class VerbActor(SeveralActors):
    """One actor for each verb. The last V numbers of the context (N, C) are the probabilities that weigh them."""

    def forward(self, robot: Tensor, context: Tensor, *more: Tensor) -> tuple[Tensor, Tensor]:
        loc, scale = self.outputs(robot, context, *more)
        weights = context[:, -len(loc) :].T.unsqueeze(-1)
        return (weights * loc).sum(0), (weights * scale).sum(0)


class Critic(nn.Module):
    """`heads` independent networks on observations and, for action values, the move: values (heads, N, outputs).

    Args:
        inputs: each normalises an observation, or is the width of features that are taken as they are.
        actions: width of the move; 0 for state values.
        hidden: widths of the hidden layers.
        activation: a key of ACTIVATIONS.
        heads: number of networks.
        outputs: of each network: 1, or the number of quantiles.
        normalisation: none, or a key of NORMALISATIONS.
    """

    def __init__(
        self,
        inputs: Sequence[Normalise | int],
        *,
        actions: int,
        hidden: Sequence[int],
        activation: str,
        heads: int,
        outputs: int = 1,
        normalisation: str = "none",
    ) -> None:
        super().__init__()
        self.inputs = nn.ModuleList(each if isinstance(each, Normalise) else nn.Identity() for each in inputs)
        width = actions + sum(each.shape.numel() if isinstance(each, Normalise) else each for each in inputs)
        # Two small products of matrices are faster on a CPU than one batched one: 7.3 against 9.7 ms for a SAC step.
        self.heads = nn.ModuleList(mlp(width, hidden, outputs, activation, normalisation) for _ in range(heads))

    def forward(self, *values: Tensor) -> Tensor:
        """values: the observations (N, ...) and, for action values, the move (N, A)."""
        count = len(self.inputs)
        # Detached: the words are learned through the actor and the grounding loss, not through the critic.
        observed = [each(value.detach()) for each, value in zip(self.inputs, values[:count], strict=True)]
        x = torch.cat([*observed, *values[count:]], -1)
        return torch.stack([head(x) for head in self.heads])


class SingleCritic(Critic):
    """A critic of one head: values (N, outputs)."""

    def forward(self, *values: Tensor) -> Tensor:
        return super().forward(*values)[0]


def normal_log_prob(noise: Tensor, scale: Tensor) -> Tensor:
    """Return the log-density of loc + scale * noise under Normal(loc, scale), element by element."""
    return -0.5 * noise.square() - scale.log() - 0.5 * math.log(2 * math.pi)

"""Small parts that policies and critics are built of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torchrl.data import TensorSpec

ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU}
LOG_STD = (-4.0, 1.0)  # exploration never dies quite, and never drowns the action


def mlp(inputs: int, hidden: Sequence[int], outputs: int, activation: str = "relu") -> nn.Sequential:
    """Linear layers with the activation between them; the last one is bare."""
    widths = [inputs, *hidden]
    layers: list[nn.Module] = []
    for a, b in pairwise(widths):
        layers += [nn.Linear(a, b), ACTIVATIONS[activation]()]
    return nn.Sequential(*layers, nn.Linear(widths[-1], outputs))


class Normalise(nn.Module):
    """Bounds of a spec to [-1, 1]; an element that cannot vary becomes 0.

    spec: a bounded leaf of shape (N, ..., D), the same bounds for every world and slot.
    """

    centre: Tensor
    gain: Tensor

    def __init__(self, spec: TensorSpec) -> None:
        super().__init__()
        width = spec.shape[-1]
        low, high = (bound.reshape(-1, width)[0].float() for bound in (spec.space.low, spec.space.high))
        half = (high - low) / 2
        if not half.isfinite().all():
            raise ValueError("an observation without finite bounds cannot be normalised")
        self.shape = low.shape
        self.register_buffer("centre", (high + low) / 2)
        self.register_buffer("gain", torch.where(half > 0, 1 / half, torch.zeros_like(half)))

    def forward(self, x: Tensor) -> Tensor:
        return (x - self.centre) * self.gain


def normal_log_prob(noise: Tensor, scale: Tensor) -> Tensor:
    """The log-density of loc + scale * noise under Normal(loc, scale), element by element."""
    return -0.5 * noise.square() - scale.log() - 0.5 * math.log(2 * math.pi)


class Gaussian(nn.Module):
    """Robot state, what the words mean and what is in the way to the action's location and scale, (N, A) each.

    context: how many numbers the latter two are.
    The scale is a parameter (PPO's habit) or a second output of the network (SAC's).
    """

    def __init__(
        self,
        robot: Normalise,
        context: int,
        hidden: Sequence[int],
        actions: int,
        activation: str,
        std: float,
        by_state: bool,
    ) -> None:
        super().__init__()
        self.robot, self.by_state = robot, by_state
        self.net = mlp(robot.shape.numel() + context, hidden, actions * (1 + by_state), activation)
        self.log_std = nn.Parameter(torch.full((actions,), float(torch.tensor(std).log())))
        last = self.net[-1]
        assert isinstance(last, nn.Linear)
        nn.init.orthogonal_(last.weight, 0.01)  # begin by standing still: only the noise moves the arm
        nn.init.zeros_(last.bias)

    def forward(self, robot: Tensor, *context: Tensor) -> tuple[Tensor, Tensor]:
        out = self.net(torch.cat([self.robot(robot), *context], -1))
        if not self.by_state:
            # No mean beyond what one step can do, or noise would lose its say: a gripper's command, once it was far
            # above 0, was never tried below.
            return out.tanh(), self.log_std.clamp(*LOG_STD).exp().expand_as(out)
        loc, offset = out.chunk(2, -1)
        return loc, (self.log_std + offset).clamp(*LOG_STD).exp()


class Staged(nn.Module):
    """Several networks, one at a time: which one acts is told by the stage (N,) that the task is in.

    The last one also acts in all later stages.
    """

    def __init__(self, stages: Sequence[Gaussian]) -> None:
        super().__init__()
        self.stages = nn.ModuleList(stages)

    @property
    def log_std(self) -> Tensor:
        """(stages, A) of the exploration noise."""
        return torch.stack([each.log_std for each in self.stages])  # type: ignore[misc]

    def forward(self, robot: Tensor, *seen: Tensor) -> tuple[Tensor, Tensor]:
        *context, stage = seen
        each = [network(robot, *context) for network in self.stages]
        rows = torch.arange(len(robot), device=robot.device)
        stage = stage.clamp(max=len(each) - 1)
        loc, scale = (torch.stack(parts)[stage, rows] for parts in zip(*each, strict=True))
        return loc, scale


class Critic(nn.Module):
    """`heads` independent networks on robot, aim and, for Q, the action; their values stacked, (heads, N, 1).

    aim: the goal in metres and its bounds (a privileged critic), or features that are taken as they are.
    """

    def __init__(
        self,
        robot: Normalise,
        aim: Normalise | int,
        actions: int,
        hidden: Sequence[int],
        activation: str,
        heads: int,
    ) -> None:
        super().__init__()
        self.robot = robot
        self.aim = aim if isinstance(aim, Normalise) else nn.Identity()
        width = aim.shape.numel() if isinstance(aim, Normalise) else aim
        inputs = robot.shape.numel() + width + actions
        # Two small products of matrices are faster on a CPU than one batched one: 7.3 against 9.7 ms for a SAC step.
        self.heads = nn.ModuleList(mlp(inputs, hidden, 1, activation) for _ in range(heads))

    def forward(self, robot: Tensor, aim: Tensor, *action: Tensor) -> Tensor:
        # The critic judges, it does not teach: what the words mean is learned through the actor and the grounding.
        x = torch.cat([self.robot(robot), self.aim(aim.detach()), *action], -1)
        return torch.stack([head(x) for head in self.heads])


class Value(Critic):
    """A critic of one head without the action: values (N, 1)."""

    def forward(self, robot: Tensor, aim: Tensor, *action: Tensor) -> Tensor:
        return super().forward(robot, aim, *action)[0]

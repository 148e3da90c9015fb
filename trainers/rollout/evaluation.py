"""How often does it do what it was told: the deterministic policy, counted without bias."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

Z95 = 1.959963984540054
POINTING = ("privileged", "pointing")
# What makes a gesture hard to read, with the lower ends of the bins that it is counted in; the last one is open. angle:
# degrees between the referent and its nearest rival, as the fingertip sees them. stray: how far beside the referent the
# ray passes, 1 being that angle; up to a half, the ray itself tells them apart. distance: cm from the fingertip.
BINS: dict[str, tuple[float, ...]] = {
    "angle": (0, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30),
    "objects": tuple(range(1, 9)),
    "distance": (0, 40, 45, 50, 55, 60, 65, 70, 100, 150),
    "stray": (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1),
}


class Interrupted(Exception):
    """Somebody asked the run to stop."""


@dataclass
class EvalResult:
    """Shares of episodes in [0, 1].

    success_at_end: the episode ended in success, the task's own word for it. success_once: the gripper was at the
    referent at some step at least. wrong_object: it ended at another object. ci95: Wilson's interval of success_at_end.
    by_pointing: the episodes in which somebody pointed, by each of `BINS`; empty bins are left out.
    """

    episodes: int
    success_at_end: float
    success_once: float
    wrong_object: float
    ci95: tuple[float, float]
    mean_return: float
    mean_length: float
    by_kind: dict[str, EvalResult] = field(default_factory=dict)
    by_pointing: dict[str, list[Bin]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        out: dict[str, Any] = {name: value for name, value in vars(self).items() if not name.startswith("by_")}
        out["ci95"] = list(self.ci95)
        if self.by_kind:
            out["by_kind"] = {kind: result.as_dict() for kind, result in sorted(self.by_kind.items())}
        if self.by_pointing:
            out["by_pointing"] = {name: [each.as_dict() for each in bins] for name, bins in self.by_pointing.items()}
        return out


@dataclass(frozen=True)
class Bin:
    """Episodes whose measure is in [low, high); high is None where the bin is open."""

    low: float
    high: float | None
    episodes: int
    success_at_end: float
    ci95: tuple[float, float]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        rest = {"episodes": self.episodes, "success_at_end": self.success_at_end, "ci95": list(self.ci95)}
        return {"range": [self.low, self.high], **rest}


@dataclass(frozen=True)
class Episode:
    """pointing: its measures by the names of `BINS`; empty where nobody pointed."""

    kind: int
    success: bool
    once: bool
    wrong: bool
    total: float
    length: int
    pointing: dict[str, float] = field(default_factory=dict)


def wilson(successes: int, n: int, z: float = Z95) -> tuple[float, float]:
    """Wilson's score interval for a share of n trials (1927); 95 % by default. (0, 1) for no trials."""
    if n == 0:
        return 0.0, 1.0
    share, zz = successes / n, z * z / n
    middle = (share + zz / 2) / (1 + zz)
    half = z * math.sqrt(share * (1 - share) / n + zz / (4 * n)) / (1 + zz)
    return max(0.0, middle - half), min(1.0, middle + half)


def quotas(episodes: int, worlds: int) -> list[int]:
    """How many episodes of each world count: its first ones, decided beforehand.

    Counting the first `episodes` to end would favour short ones, and those are the successes.
    """
    return [episodes // worlds + (world < episodes % worlds) for world in range(worlds)]


def evaluate(
    env: EnvBase,
    policy: TensorDictModuleBase,
    episodes: int,
    seed: int | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> EvalResult:
    """Exactly `episodes` episodes of the deterministic policy.

    env: batch_size (N,), on the policy's device. policy: writes "action"; never sees the privileged keys.
    seed: given to the environment first. stop: asked at each step; raises Interrupted once it says so.
    """
    if seed is not None:
        env.set_seed(seed)
    ended = _play(env, policy, quotas(episodes, env.batch_size[0]), stop)
    names = env.kind_names
    kinds = {names[kind]: [e for e in ended if e.kind == kind] for kind in sorted({e.kind for e in ended})}
    result = _summary(ended)
    result.by_kind = {name: _summary(group) for name, group in kinds.items()}
    result.by_pointing = by_pointing(ended)
    return result


@torch.no_grad()
def _play(env: EnvBase, policy: TensorDictModuleBase, left: list[int], stop: Callable[[], bool]) -> list[Episode]:
    worlds = len(left)
    total, once, length = (
        torch.zeros(worlds),
        torch.zeros(worlds, dtype=torch.bool),
        torch.zeros(worlds, dtype=torch.int64),
    )
    ended: list[Episode] = []
    state = env.reset()
    shown = _Shown(state)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while any(left):
            if stop():
                raise Interrupted
            state["action"] = policy(state.exclude("privileged"))["action"]
            kind = state["privileged", "kind"]
            step, state = env.step_and_maybe_reset(state)
            after = step["next"]
            total += after["reward"].flatten()
            shown.follow(after)
            once |= after["at_goal"].flatten() | after["success"].flatten()
            length += 1
            for world in after["done"].flatten().nonzero().flatten().tolist():
                if left[world]:
                    left[world] -= 1
                    ended.append(
                        Episode(
                            kind=int(kind[world]),
                            success=bool(after["success"][world]),
                            once=bool(once[world]),
                            wrong=bool(after["wrong_object"][world]),
                            total=float(total[world]),
                            length=int(length[world]),
                            pointing=shown.measures(world),
                        )
                    )
                total[world], once[world], length[world] = 0.0, False, 0
            shown.begin(state, after["done"].flatten())
    return ended


class _Shown:
    """What each world's finger shows, as privileged/pointing has it, and among how many objects.

    Taken as an episode begins, before anything is pushed, and again for as long as the finger moves: an episode in
    which it goes on to another object counts by that one. Nothing where the environment has no such keys.
    """

    def __init__(self, state: TensorDictBase) -> None:
        self._rows = _row(state) if POINTING in state.keys(include_nested=True) else None

    def begin(self, state: TensorDictBase, begun: Tensor) -> None:
        """state: after the reset of the worlds that have begun, (N,) bool."""
        if self._rows is not None:
            self._rows = torch.where(begun[:, None], _row(state), self._rows)

    def follow(self, state: TensorDictBase) -> None:
        """state: after a step."""
        if self._rows is not None:
            fresh = _row(state)
            moved = (fresh[:, :-4] != self._rows[:, :-4]).any(-1, keepdim=True)
            self._rows = torch.where(moved, fresh, self._rows)

    def measures(self, world: int) -> dict[str, float]:
        """By the names of `BINS`; empty where nothing is shown."""
        error, apart, metres, objects = [0.0] * 4 if self._rows is None else self._rows[world, -4:].tolist()
        if metres == 0:
            return {}
        out = {"objects": objects, "distance": 100 * metres}
        if objects > 1:  # else there is no rival
            out |= {"angle": math.degrees(apart), "stray": error / max(apart, 1e-9)}
        return out


def _row(state: TensorDictBase) -> Tensor:
    """(N, ...) the gesture, privileged/pointing (3,), and the number of objects."""
    return torch.cat([state["gesture"], state[POINTING], state["objects_mask"].sum(-1, keepdim=True)], -1)


def by_pointing(ended: Sequence[Episode]) -> dict[str, list[Bin]]:
    """Success in each bin that any episode falls into, under the names of `BINS`; {} where nobody pointed."""
    out = {name: _bins([(e.pointing[name], e.success) for e in ended if name in e.pointing], name) for name in BINS}
    return {name: bins for name, bins in out.items() if bins}


def _bins(measured: Sequence[tuple[float, bool]], name: str) -> list[Bin]:
    edges, ends = BINS[name], (*BINS[name][1:], None)
    groups: list[list[bool]] = [[] for _ in edges]
    for value, success in measured:
        groups[max(bisect_right(edges, value) - 1, 0)].append(success)
    return [
        Bin(low, high, len(group), sum(group) / len(group), wilson(sum(group), len(group)))
        for low, high, group in zip(edges, ends, groups, strict=True)
        if group
    ]


def _summary(ended: list[Episode]) -> EvalResult:
    n = len(ended)
    successes = sum(e.success for e in ended)
    return EvalResult(
        episodes=n,
        success_at_end=successes / n,
        success_once=sum(e.once for e in ended) / n,
        wrong_object=sum(e.wrong for e in ended) / n,
        ci95=wilson(successes, n),
        mean_return=sum(e.total for e in ended) / n,
        mean_length=sum(e.length for e in ended) / n,
    )

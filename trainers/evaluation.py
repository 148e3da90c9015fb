"""How often does it do what it was told: the deterministic policy, counted without bias."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

Z95 = 1.959963984540054


class Interrupted(Exception):
    """Somebody asked the run to stop."""


@dataclass
class EvalResult:
    """Shares of episodes in [0, 1].

    success_at_end: the episode ended in success, the task's own word for it. success_once: the gripper was at the
    referent at some step at least. wrong_object: it ended at another object. ci95: Wilson's interval of success_at_end.
    """

    episodes: int
    success_at_end: float
    success_once: float
    wrong_object: float
    ci95: tuple[float, float]
    mean_return: float
    mean_length: float
    by_kind: dict[str, EvalResult] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        out: dict[str, Any] = {name: value for name, value in vars(self).items() if name != "by_kind"}
        out["ci95"] = list(self.ci95)
        if self.by_kind:
            out["by_kind"] = {kind: result.as_dict() for kind, result in sorted(self.by_kind.items())}
        return out


@dataclass(frozen=True)
class Episode:
    kind: int
    success: bool
    once: bool
    wrong: bool
    total: float
    length: int


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
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while any(left):
            if stop():
                raise Interrupted
            state["action"] = policy(state.exclude("privileged"))["action"]
            kind = state["privileged", "kind"]
            step, state = env.step_and_maybe_reset(state)
            after = step["next"]
            total += after["reward"].flatten()
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
                        )
                    )
                total[world], once[world], length[world] = 0.0, False, 0
    return ended


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

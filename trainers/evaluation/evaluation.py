"""Evaluation: the deterministic policy over a fixed number of episodes, and statistics of how they ended."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs.utils import ExplorationType, set_exploration_type

from core.errors import Interrupted
from trainers.environment import TrainingEnv

MOVED, MOVED_FAR = 0.01, 0.03  # metres above which an object counts as moved, and as moved far


Z95 = 1.959963984540054
POINTING = ("privileged", "pointing")
# Measures of how difficult a gesture is to read, with the lower edges of their bins; the last bin is open.
# angle: between the referent and its nearest rival, seen from the fingertip, degrees. objects: their number.
# distance: from the fingertip to the referent, cm. stray: angle between ray and referent, relative to `angle`; up to
# 0.5, the ray alone identifies the referent.
BINS: dict[str, tuple[float, ...]] = {
    "angle": (0, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30),
    "objects": tuple(range(1, 9)),
    "distance": (0, 40, 45, 50, 55, 60, 65, 70, 100, 150),
    "stray": (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1),
}


def evaluate(
    env: TrainingEnv,
    policy: TensorDictModuleBase,
    episodes: int,
    seed: int | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> EvalResult:
    """Evaluate the deterministic policy over exactly `episodes` episodes.

    Args:
        env: batch_size (N,), on the policy's device.
        policy: writes "action"; it does not receive the privileged keys.
        episodes: their number over all worlds.
        seed: set on the environment first, unless it is None.
        stop: called at each step; True interrupts the evaluation.

    Raises:
        Interrupted: `stop` returned True.
    """
    return summarize(run_episodes(env, policy, episodes, seed, stop), env.kind_names)


def run_episodes(
    env: TrainingEnv,
    policy: TensorDictModuleBase,
    episodes: int,
    seed: int | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> list[EpisodeOutcome]:
    """Return the episodes of `evaluate`, in the order in which they ended."""
    if seed is not None:
        env.set_seed(seed)
    return _run_episodes(env, policy, quotas(episodes, env.batch_size[0]), stop)


@torch.no_grad()
def _run_episodes(
    env: TrainingEnv, policy: TensorDictModuleBase, left: list[int], stop: Callable[[], bool]
) -> list[EpisodeOutcome]:
    """left: how many episodes of each world are still to be counted; it is changed."""
    worlds = len(left)
    total_reward = torch.zeros(worlds)
    at_referent = torch.zeros(worlds, dtype=torch.bool)
    length = torch.zeros(worlds, dtype=torch.int64)
    outcomes: list[EpisodeOutcome] = []
    state = env.reset()
    pointing, displacements = _PointingMeasures(state), Displacements(env, state)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        while any(left):
            if stop():
                raise Interrupted
            state["action"] = policy(state.exclude("privileged"))["action"]
            kind = state["privileged", "kind"]
            step, state = env.step_and_maybe_reset(state)
            after = step["next"]
            total_reward += after["reward"].flatten()
            pointing.follow(after)
            displacements.follow(after)
            at_referent |= after["at_goal"].flatten() | after["success"].flatten()
            length += 1
            for world in after["done"].flatten().nonzero().flatten().tolist():
                if left[world]:
                    left[world] -= 1
                    outcomes.append(
                        EpisodeOutcome(
                            kind=int(kind[world]),
                            success=bool(after["success"][world]),
                            at_referent=bool(at_referent[world]),
                            wrong_object=bool(after["wrong_object"][world]),
                            total_reward=float(total_reward[world]),
                            length=int(length[world]),
                            pointing=pointing.measures(world),
                            displacement=displacements.of(world, after),
                        )
                    )
                total_reward[world], at_referent[world], length[world] = 0.0, False, 0
            for measured in (pointing, displacements):
                measured.begin(state, after["done"].flatten())
    return outcomes


@dataclass(frozen=True)
class Displacement:
    """How far objects were moved in an episode: the greatest distance from where they began, metres.

    referent: None if the task is to move it. others: of all other objects, the one that was moved furthest.
    In an episode with several referents that the task is to move, none of them counts.
    out_of_reach: the referent lay out of the gripper's reach at the end; None if the task is to move it.
    """

    referent: float | None = 0.0
    others: float = 0.0
    out_of_reach: bool | None = False

    @property
    def disturbed(self) -> bool:
        """Whether an object was moved that the task does not move."""
        return max(self.others, self.referent or 0.0) > MOVED


@dataclass(frozen=True)
class EpisodeOutcome:
    """How an episode ended.

    kind: index of the kind of instruction. at_referent: the gripper was at the referent at one step at least.
    pointing: the measures of `BINS`; empty without a gesture. displacement: how far objects were moved.
    """

    kind: int
    success: bool
    at_referent: bool
    wrong_object: bool
    total_reward: float
    length: int
    pointing: dict[str, float] = field(default_factory=dict)
    displacement: Displacement = Displacement()


@dataclass
class EvalResult:
    """Statistics over episodes; rates are in [0, 1].

    success_at_end: the episode ended in success, as the task defines it. success_once: the gripper was at the referent
    at one step at least. wrong_object: the episode ended at another object. ci95: Wilson's interval of success_at_end.
    disturbed: of the successful episodes, the share in which an object was moved by more than 1 cm that the task does
    not move; None without a success. moved: the shares of `moved_shares`.
    by_kind: the same by kind of instruction. by_pointing: the episodes with a gesture, by each measure of `BINS`; empty
    bins are left out.
    """

    episodes: int
    success_at_end: float
    success_once: float
    wrong_object: float
    ci95: tuple[float, float]
    mean_return: float
    mean_length: float
    disturbed: float | None = None
    moved: dict[str, float | None] = field(default_factory=dict)
    by_kind: dict[str, EvalResult] = field(default_factory=dict)
    by_pointing: dict[str, list[Bin]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        out: dict[str, Any] = {name: value for name, value in vars(self).items() if not name.startswith("by_")}
        out["ci95"] = list(self.ci95)
        if self.by_kind:
            out["by_kind"] = {kind: result.as_dict() for kind, result in sorted(self.by_kind.items())}
        if self.by_pointing:
            out["by_pointing"] = {name: [each.as_dict() for each in bins] for name, bins in self.by_pointing.items()}
        return out


@dataclass(frozen=True)
class Bin:
    """The episodes whose measure is in [low, high); high is None for the last bin, which is open."""

    low: float
    high: float | None
    episodes: int
    success_at_end: float
    ci95: tuple[float, float]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        rest = {"episodes": self.episodes, "success_at_end": self.success_at_end, "ci95": list(self.ci95)}
        return {"range": [self.low, self.high], **rest}


def summarize(outcomes: list[EpisodeOutcome], kind_names: Sequence[str]) -> EvalResult:
    """Return statistics over episodes. kind_names: names of the values of `EpisodeOutcome.kind`."""
    kinds = {kind_names[kind]: [e for e in outcomes if e.kind == kind] for kind in sorted({e.kind for e in outcomes})}
    result = _summary(outcomes)
    result.by_kind = {name: _summary(group) for name, group in kinds.items()}
    result.by_pointing = by_pointing(outcomes)
    return result


def _summary(outcomes: list[EpisodeOutcome]) -> EvalResult:
    n = len(outcomes)
    successful = [e.displacement for e in outcomes if e.success]
    return EvalResult(
        episodes=n,
        success_at_end=len(successful) / n,
        success_once=sum(e.at_referent for e in outcomes) / n,
        wrong_object=sum(e.wrong_object for e in outcomes) / n,
        ci95=wilson(len(successful), n),
        mean_return=sum(e.total_reward for e in outcomes) / n,
        mean_length=sum(e.length for e in outcomes) / n,
        disturbed=share([displacement.disturbed for displacement in successful]),
        moved=moved_shares(successful, [e.displacement for e in outcomes]),
    )


def by_pointing(outcomes: Sequence[EpisodeOutcome]) -> dict[str, list[Bin]]:
    """Return success in each bin that holds an episode, by the names of `BINS`; {} without gestures."""
    out = {name: _bins([(e.pointing[name], e.success) for e in outcomes if name in e.pointing], name) for name in BINS}
    return {name: bins for name, bins in out.items() if bins}


def _bins(measured: Sequence[tuple[float, bool]], name: str) -> list[Bin]:
    """measured: the measure and the success of each episode."""
    edges, ends = BINS[name], (*BINS[name][1:], None)
    groups: list[list[bool]] = [[] for _ in edges]
    for value, success in measured:
        groups[max(bisect_right(edges, value) - 1, 0)].append(success)
    return [
        Bin(low, high, len(group), sum(group) / len(group), wilson(sum(group), len(group)))
        for low, high, group in zip(edges, ends, groups, strict=True)
        if group
    ]


def moved_shares(successful: Sequence[Displacement], ended: Sequence[Displacement]) -> dict[str, float | None]:
    """Shares of episodes by how far objects were moved; None for a share of nothing.

    referent_1cm, referent_3cm, others_1cm: of the successful episodes, those in which the referent, or another object,
    was moved by more than that. swept_out_of_reach: of all episodes, those that ended with the referent out of reach.
    Shares of the referent are None if the task is to move it.
    """
    return {
        "referent_1cm": share([each.referent > MOVED for each in successful if each.referent is not None]),
        "referent_3cm": share([each.referent > MOVED_FAR for each in successful if each.referent is not None]),
        "others_1cm": share([each.others > MOVED for each in successful]),
        "swept_out_of_reach": share([each.out_of_reach for each in ended if each.out_of_reach is not None]),
    }


def share(flags: Sequence[bool]) -> float | None:
    """Return the share of true flags; None of no flags."""
    return sum(flags) / len(flags) if flags else None


def wilson(successes: int, n: int, z: float = Z95) -> tuple[float, float]:
    """Wilson's score interval (1927) for the success rate of n trials; 95 % by default. (0, 1) for no trials."""
    if n == 0:
        return 0.0, 1.0
    share, zz = successes / n, z * z / n
    middle = (share + zz / 2) / (1 + zz)
    half = z * math.sqrt(share * (1 - share) / n + zz / (4 * n)) / (1 + zz)
    return max(0.0, middle - half), min(1.0, middle + half)


def quotas(episodes: int, worlds: int) -> list[int]:
    """Return how many episodes of each world are counted: its first ones.

    The numbers are fixed in advance, because counting the first `episodes` episodes to end would favour short ones, and
    successful episodes are shorter.
    """
    return [episodes // worlds + (world < episodes % worlds) for world in range(worlds)]


class _PointingMeasures:
    """For each world, the measures of the gesture (privileged/pointing) and the number of objects.

    They are read when an episode begins, before an object is moved, and again at each step in which the gesture moves:
    an episode whose gesture moves to another object is counted by the later object. Without such observations there are
    no measures.
    """

    def __init__(self, state: TensorDictBase) -> None:
        self._rows = _pointing_row(state) if POINTING in state.keys(include_nested=True) else None

    def begin(self, state: TensorDictBase, started: Tensor) -> None:
        """Read the measures of new episodes. started: (N,) bool, the worlds that `state` has just reset."""
        if self._rows is not None:
            self._rows = torch.where(started[:, None], _pointing_row(state), self._rows)

    def follow(self, state: TensorDictBase) -> None:
        """Read the measures of worlds whose gesture has moved. state: after a step."""
        if self._rows is not None:
            rows = _pointing_row(state)
            moved = (rows[:, :-4] != self._rows[:, :-4]).any(-1, keepdim=True)
            self._rows = torch.where(moved, rows, self._rows)

    def measures(self, world: int) -> dict[str, float]:
        """Return the measures of `BINS` by name; {} if nothing is pointed at."""
        error, angle, metres, objects = [0.0] * 4 if self._rows is None else self._rows[world, -4:].tolist()
        if metres == 0:
            return {}
        out = {"objects": objects, "distance": 100 * metres}
        if objects > 1:  # otherwise there is no rival
            out |= {"angle": math.degrees(angle), "stray": error / max(angle, 1e-9)}
        return out


def _pointing_row(state: TensorDictBase) -> Tensor:
    """Return the gesture, privileged/pointing (3,) and the number of objects side by side, (N, ...)."""
    return torch.cat([state["gesture"], state[POINTING], state["objects_mask"].sum(-1, keepdim=True)], -1)


class Displacements:
    """Follows the objects of N worlds by "privileged/places", or the first three columns of "objects" if exact.

    Args:
        env: has `moves_referent` and `is_reachable`.
        state: the first observation of the episodes.
    """

    def __init__(self, env: TrainingEnv, state: TensorDictBase) -> None:
        self._env = env
        self._begun = _places(state)
        self._furthest = torch.zeros(self._begun.shape[:2])
        self._meant = _referents(state)  # (N, K) which have been referents in the episode

    def begin(self, state: TensorDictBase, started: torch.Tensor) -> None:
        """Forget the former episodes. started: (N,) bool, the worlds that `state` has just reset."""
        self._begun = torch.where(started[:, None, None], _places(state), self._begun)
        self._furthest = torch.where(started[:, None], 0.0, self._furthest)
        self._meant = torch.where(started[:, None], _referents(state), self._meant)

    def follow(self, state: TensorDictBase) -> None:
        """Measure all worlds. state: after a step. Slots that show no object are 0 all along."""
        apart = (_places(state) - self._begun).square().sum(-1).sqrt()
        self._furthest = torch.maximum(self._furthest, apart)
        self._meant |= _referents(state)

    def of(self, world: int, state: TensorDictBase) -> Displacement:
        """Return the displacement in a world whose episode ends with `state`."""
        if self._env.moves_referent:
            return Displacement(None, max(self._furthest[world][~self._meant[world]].tolist(), default=0.0), None)
        referent = int(state["privileged", "referent"][world])
        distances = self._furthest[world].tolist()
        moved = distances.pop(referent)
        others = max(distances, default=0.0)
        place = _places(state)[world, referent]
        return Displacement(moved, others, not self._env.is_reachable(place))


def _referents(state: TensorDictBase) -> torch.Tensor:
    """Return which object is the referent, (N, K) bool."""
    return F.one_hot(state["privileged", "referent"].long(), state["objects_mask"].shape[-1]).bool()


def _places(state: TensorDictBase) -> torch.Tensor:
    """Return the true positions (N, K, 3), metres, where those of "objects" are observed with noise."""
    true = state.get(("privileged", "places"), None)
    return state["objects"][..., :3] if true is None else true


class Played(Protocol):
    """How such an episode ended."""

    @property
    def success(self) -> bool: ...

    @property
    def wrong_object(self) -> bool: ...


def summarize_by_hand(played: Sequence[Played]) -> dict[str, Any]:
    """Return plain values for JSON."""
    successes = sum(each.success for each in played)
    return {
        "by_hand": True,
        "episodes": len(played),
        "success_at_end": successes / max(len(played), 1),
        "wrong_object": sum(each.wrong_object for each in played) / max(len(played), 1),
        "ci95": list(wilson(successes, len(played))),
        "played": [vars(each) for each in played],
    }

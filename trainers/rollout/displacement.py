"""How far objects are moved in the episodes of an evaluation, except the object that the task moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase

from trainers.environment import TrainingEnv

MOVED, MOVED_FAR = 0.01, 0.03  # metres above which an object counts as moved, and as moved far


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
        """The displacement in a world whose episode ends with `state`."""
        if self._env.moves_referent:
            return Displacement(None, max(self._furthest[world][~self._meant[world]].tolist(), default=0.0), None)
        referent = int(state["privileged", "referent"][world])
        distances = self._furthest[world].tolist()
        moved = distances.pop(referent)
        others = max(distances, default=0.0)
        place = _places(state)[world, referent]
        return Displacement(moved, others, not self._env.is_reachable(place))


def _referents(state: TensorDictBase) -> torch.Tensor:
    """(N, K) which object is the referent."""
    return F.one_hot(state["privileged", "referent"].long(), state["objects_mask"].shape[-1]).bool()


def _places(state: TensorDictBase) -> torch.Tensor:
    """(N, K, 3) metres: the true positions, where those of "objects" are observed with noise."""
    true = state.get(("privileged", "places"), None)
    return state["objects"][..., :3] if true is None else true


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
    """The share of true flags; None of no flags."""
    return sum(flags) / len(flags) if flags else None

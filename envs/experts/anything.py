"""Anything: acts as the verb's expert, but first releases other objects, and moves up before it moves sideways."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.experts.base import EXPERTS, UP, AimingExpert, Array, Slots, choose_rows, register_expert
from envs.experts.devices import DeviceExpert
from envs.experts.furniture import fittings_from
from envs.experts.pick_and_place import Fetch, HandOverExpert, LiftExpert, PlaceExpert
from envs.experts.reach import ReachExpert
from envs.tasks import NOTHING, Task
from envs.tasks.anything import Anything
from envs.tasks.shared.fittings import FITTING_NUMBERS
from envs.tasks.shared.geometry import length
from envs.tasks.shared.open_hand import HAND_NUMBER
from envs.workspace_env import WorkspaceEnv
from language.verbs import HANDING

HOVER = 0.14  # metres above an object at which grippers travel: over stacks of two
HEIGHT = 0.12  # metres above their targets at which objects are carried: over stacks of two
BESIDE, CLEAR = 0.05, 0.06  # metres beside and over a handle from which a gripper may go sideways
SHUT_WITHIN = 0.09  # metres beside a device within which fingers are shut; farther away they may release objects
SINK = 0.02  # metres that fingers go down in a control step; if faster, a panda that was going up leaves the vertical
STRAIGHT = 0.05  # metres from a device along x up to which a gripper stays between the fittings
HAND_NEAR, HAND_FAR = (
    0.075,
    0.095,
)  # metres beside a hand: up to the first a gripper stays above its objects, from the second on it need not
OVER_HAND = 0.1  # metres over a hand at which a gripper passes: above an object on it
INSIDE = 0.01  # metres inside that line at which a gripper counts as between the fittings
SAG = 0.02  # up to this many metres below its aim a gripper moves sideways at full speed; from twice as many not at all


@register_expert("anything")
class AnythingExpert(AimingExpert):
    """Moves each world's gripper with the expert of its verb."""

    def __init__(self, env: WorkspaceEnv, task: Task | None = None) -> None:
        super().__init__(env, task)
        assert isinstance(self._task, Anything)
        self._members = [self._member(member) for member in self._task.members]
        self._operates = np.array([isinstance(member, DeviceExpert) for member in self._members])
        self._handing = self._task.verbs.index(HANDING) if self._task.config.hand else NOTHING
        self._beside = fittings_from(env)

    def _member(self, task: Task) -> AimingExpert:
        member = EXPERTS[task.config.name](self._env, task)
        assert isinstance(member, AimingExpert)
        if isinstance(member, Fetch | ReachExpert):
            member.hover = HOVER
        if isinstance(member, HandOverExpert):
            member.least_hover = HOVER
        if isinstance(member, PlaceExpert):
            member.height = HEIGHT
        if isinstance(member, DeviceExpert):
            member.shut_within = SHUT_WITHIN
        if isinstance(member, LiftExpert):  # the object may stand on another one, at a height that is not remembered
            member.more += task.config.object_size
        return member

    def aim(self, referent: Slots, target: Slots) -> tuple[Array, NDArray[np.bool_]]:
        state, gripper = self._env.state, self._env.gripper
        aims = [member.aim(referent, target) for member in self._members]
        place, close = (np.stack(parts)[state.kind, self._rows] for parts in zip(*aims, strict=True))
        place = self._over_the_hand(place, state.kind == self._handing)
        sideways = np.clip(2.0 - (place - gripper)[:, 2] / SAG, 0.0, 1.0)[:, None]
        place[:, :2] = gripper[:, :2] + sideways * (place - gripper)[:, :2]
        place = self._past_the_lid(place)
        if self._env.grip_depth == 0:
            place[:, 2] = np.maximum(place[:, 2], gripper[:, 2] - SINK)
        leaves = self._at_other_handle(referent)
        place = choose_rows(leaves, gripper + HOVER * UP, place)
        other = (state.held != NOTHING) & (state.held != referent)
        return choose_rows(other, gripper, place), close & ~other

    def _over_the_hand(self, place: Array, handing: NDArray[np.bool_]) -> Array:
        """Return the places (N, 3), raised above what lies on the hand for grippers near it that bring nothing there.

        handing: (N,) whether something is to be handed over.
        """
        state, gripper = self._env.state, self._env.gripper
        if self._handing == NOTHING:
            return place
        hands = (state.nouns == HAND_NUMBER) & state.shown
        palm = self._place(hands.argmax(axis=1))
        near = np.clip((HAND_FAR - length((gripper - palm)[:, :2])) / (HAND_FAR - HAND_NEAR), 0.0, 1.0)
        elsewhere = hands.any(axis=1) & ~(handing & (state.held == state.referent))
        place[elsewhere, 2] = np.maximum(place[:, 2], near * (palm[:, 2] + OVER_HAND))[elsewhere]
        return place

    def _past_the_lid(self, place: Array) -> Array:
        """Return the places (N, 3), or waypoints to them from a fitting, past its open lid.

        A gripper goes down only once it is away from the fitting. It moves to a device along y, and then along x.
        """
        gripper, place = self._env.gripper, place.copy()
        at = np.abs(gripper[:, 1]) > self._beside
        far = self._operates[self._env.state.kind] & (place[:, 0] - gripper[:, 0] > STRAIGHT)
        place[far & at, 0] = gripper[far & at, 0]
        place[far, 1] = np.clip(place[far, 1], INSIDE - self._beside, self._beside - INSIDE)
        leaves = at & (far | (np.abs(place[:, 1]) < self._beside))
        place[leaves, 2] = np.maximum(place, gripper)[leaves, 2]
        return place

    def _at_other_handle(self, referent: Slots) -> NDArray[np.bool_]:
        """(N,) whether a gripper is at the handle of a fitting that is not the referent: it goes up from there."""
        state = self._env.state
        offset = self._env.gripper[:, None] - state.objects
        at = (length(offset[..., :2]) < BESIDE) & (offset[..., 2] < CLEAR) & (offset[..., 2] > -CLEAR) & state.shown
        at &= np.isin(state.nouns, FITTING_NUMBERS)
        at[self._rows, referent] = False
        return np.any(at, axis=1)

"""What every world's gripper is told, and what it holds.

The last number of an action shuts the gripper above 0 and opens it below, and nothing keeps it as it was: where a band
about 0 did, or a bias towards what is held, policies left it to their noise to open: their mean action never let go.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.sim.robot import RobotConfig
from envs.sim.world import World
from envs.tasks import NOTHING, State

UNIT = 0.5  # of the command: noise that moves an arm well should not have its gripper flutter
STEP = 0.02  # metres that a finger goes in a control step, 0.4 m/s: a moment's noise neither grasps nor drops
REACH = 0.1  # metres from the gripper centre to the centre of what it could hold, at most


class GripController:
    """closed: (N,) which grippers are told to be shut. held: (N,) of `state`, the slots that they hold, or NOTHING.

    kind: "magnet" or "fingers"; none: nothing is gripped, and the fingers stay apart or shut.
    apart: where nothing is gripped, whether they stay apart: what is only reached fits between them, and what is shut
    pushes it away.
    lag: physics steps after its command that a gripper lets go.
    below: metres from the gripper centre down to the centre of an object that it holds.
    """

    def __init__(
        self,
        kind: str | None,
        robot: RobotConfig,
        object_size: float,
        worlds: Sequence[World],
        state: State,
        lag: int = 0,
        apart: bool = False,
    ) -> None:
        self._worlds, self._state, self.grips, self._lag = worlds, state, kind is not None, lag
        self.below = object_size / 2 if kind == "magnet" else 0.0
        self.closed, self.held = np.zeros(len(worlds), bool), state.held
        self.held[:] = NOTHING
        self._opening = robot.finger_opening if kind == "fingers" or (kind is None and apart) else 0.0
        self._around = object_size / 2 if kind == "fingers" else 0.0
        self._fingers, self._wide = len(robot.fingers), np.full(len(worlds), self._opening)
        self._scale = robot.finger_opening

    @property
    def width(self) -> int:
        """How many numbers an action has for the gripper."""
        return int(self.grips)

    @property
    def targets(self) -> NDArray[np.float64]:
        """(N, F) where the fingers are to go, metres."""
        return np.repeat(self._wide[:, None], self._fingers, axis=1)

    def opening(self, held: bool) -> float:
        """Where each finger begins an episode, metres."""
        return self._around if held else self._opening

    def command(self, wish: NDArray[np.float64]) -> None:
        """Shut where wish (N,) is above 0, open elsewhere."""
        self.closed = wish > 0
        if self._opening:
            self._wide = np.clip(self._wide + np.where(self.closed, -STEP, STEP), 0.0, self._opening)
        if self._lag or not self._opening:
            for i in np.flatnonzero(~self.closed & (self.held != NOTHING)).tolist():
                self._worlds[i].let_go(self._lag)
                self.held[i] = NOTHING

    def begin(self, i: int, slot: int, shown: NDArray[np.bool_], centre: NDArray[np.float64]) -> None:
        """World i begins an episode holding the object of this slot, or NOTHING, with its gripper centre there.

        shown: (K,) the slots that it shows.
        """
        self.closed[i], self.held[i] = slot != NOTHING, slot
        self._wide[i] = 0.0 if slot != NOTHING else self._opening
        if slot != NOTHING:
            self._worlds[i].seize(int(shown[:slot].sum()), centre.tolist())

    def feel(self) -> None:
        """Find out what is held after a control step."""
        state = self._state
        offset = state.objects - state.gripper[:, None]
        near = state.movable & ((offset * offset).sum(-1) < REACH**2)
        could = near.any(1) & (self.closed if not self._opening else self._wide < self._opening)
        self.held[~could] = NOTHING
        for i in np.flatnonzero(could).tolist():
            slots = np.flatnonzero(state.shown[i])  # a world numbers only what it shows
            number = self._worlds[i].held(np.flatnonzero(near[i, slots]).tolist(), state.gripper[i].tolist())
            self.held[i] = NOTHING if number == NOTHING else slots[number]

    def seen(self, joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 1 or 3) in [0, 1]: how far the fingers are open; then, where it can grip, how far it is told to
        be shut, and whether anything is held. joints: (N, J + F), metres of the fingers last."""
        wide = np.zeros((len(joints), 1))
        if self._fingers:
            wide = joints[:, -self._fingers :].mean(1, keepdims=True) / self._scale
        if not self.grips:
            return wide
        shut = 1 - self._wide / self._opening if self._opening else self.closed
        return np.concatenate((wide, shut[:, None], (self.held != NOTHING)[:, None]), axis=1)

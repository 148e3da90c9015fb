"""The command of every world's gripper, and the object that each holds.

The last number of an action closes the gripper above 0 and opens it below. There is no hysteresis: with a band about 0,
or a bias towards the present state, only exploration noise released objects, and the mean action never did.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.sim.gripper import opening_around
from envs.sim.robot_config import RobotConfig
from envs.sim.world import SimulatedWorld
from envs.tasks import NOTHING, State

ACTION_UNIT = 0.5  # reduced gain, so that noise of the arm's scale does not toggle the gripper
FINGER_STEP = 0.02  # metres a fingertip moves in a control step, 0.4 m/s: brief noise neither grasps nor drops
APART = 0.9  # share of their greatest opening from which fingers no longer touch what they have released
FINGERTIPS = 0.008  # metres below the gripper centre that fingers end
FACE_GIVES = 0.005  # metres by which the soft face of a magnet gives way where it presses on something
MAX_DISTANCE = 0.1  # metres from the gripper centre to the centre of an object that it could hold


class GripController:
    """Commands the grippers of N worlds, and knows what they hold.

    Attributes:
        closed: (N,) which grippers are commanded to close.
        held: (N,) of `state`, the slots that they hold, or NOTHING.
        grip_depth: metres from the gripper centre down to the centre of an object that it holds.
        tips: metres from the gripper centre down to what it presses on.
        can_grip: whether anything can be gripped.

    Args:
        gripper: "magnet", "fingers" or "hinge"; None: nothing is gripped, and the fingers stay apart or closed.
        robot: whose fingers they are.
        object_size: metres.
        worlds, state: the worlds and the arrays of their state.
        release_lag: physics steps from the command to open until the gripper releases.
        apart: where nothing is gripped, whether the fingers stay apart. An object that is only reached fits between
            them; closed fingers push it away.
    """

    def __init__(
        self,
        *,
        gripper: str | None,
        robot: RobotConfig,
        object_size: float,
        worlds: Sequence[SimulatedWorld],
        state: State,
        release_lag: int = 0,
        apart: bool = False,
    ) -> None:
        self._worlds, self._state, self.can_grip, self._lag = worlds, state, gripper is not None, release_lag
        self.grip_depth = object_size / 2 if gripper == "magnet" else 0.0
        self.closed, self.held = np.zeros(len(worlds), bool), state.held
        self.held[:] = NOTHING
        moves = gripper in ("fingers", "hinge") or (gripper is None and apart)
        self._max_opening = robot.finger_opening if moves else 0.0
        self._opening_around_object = opening_around(robot, object_size) if gripper in ("fingers", "hinge") else 0.0
        self._num_fingers, self._opening = len(robot.fingers), np.full(len(worlds), self._max_opening)
        self._by_fingers = bool(robot.fingers) and gripper != "magnet"
        self.tips = FINGERTIPS if self._by_fingers else -FACE_GIVES * (gripper == "magnet")
        self._robot, self._step = robot, FINGER_STEP
        if robot.hinge and robot.on_hinge:
            self._step /= robot.hinge.length

    @property
    def width(self) -> int:
        """How many numbers an action has for the gripper: 0 or 1."""
        return int(self.can_grip)

    @property
    def targets(self) -> NDArray[np.float64]:
        """(N, F) target positions of the fingers, metres; of a jaw on a hinge, radians."""
        return np.repeat(self._robot.finger_position(self._opening)[:, None], self._num_fingers, axis=1)

    def initial_opening(self, held: bool) -> float:
        """Return the opening of each finger at the beginning of an episode, metres or radians.

        held: whether the episode begins with an object held.
        """
        return self._opening_around_object if held else self._max_opening

    def command(self, command: NDArray[np.float64]) -> None:
        """Close where command (N,) is above 0, open elsewhere."""
        self.closed = command > 0
        if self._max_opening:
            step = np.where(self.closed, -self._step, self._step)
            self._opening = np.clip(self._opening + step, 0.0, self._max_opening)
        self._let_go()

    @property
    def opening(self) -> NDArray[np.float64]:
        """(N,) in [0, 1]: how far each gripper is commanded to be open. A magnet that is on is at 0."""
        if self._by_fingers:
            return self._opening / self._robot.finger_opening
        return np.where(self.closed, 0.0, 1.0)

    def follow(self, opening: NDArray[np.float64]) -> None:
        """Command the grippers by `opening` (N,) of another controller, in place of `command`."""
        self.closed = opening < (1.0 if self._by_fingers else 0.5)
        if self._by_fingers:
            self._opening = opening * self._robot.finger_opening
        self._let_go()

    def _let_go(self) -> None:
        """Release what magnets that are off hold, and what is to be released at an exact time."""
        if self._lag or not self._max_opening:
            for i in np.flatnonzero(~self.closed & (self.held != NOTHING)).tolist():
                self._worlds[i].release(self._lag)
                self.held[i] = NOTHING

    def begin(self, i: int, slot: int, shown: NDArray[np.bool_], centre: NDArray[np.float64]) -> None:
        """Begin an episode of world i that holds the object of this slot, or NOTHING.

        Args:
            i: the world.
            slot: of the held object, or NOTHING.
            shown: (K,) which slots the episode shows.
            centre: (3,) position of the gripper, metres.
        """
        self.closed[i], self.held[i] = slot != NOTHING, slot
        self._opening[i] = 0.0 if slot != NOTHING else self._max_opening
        if slot != NOTHING:
            self._worlds[i].attach(int(shown[:slot].sum()), centre.tolist())

    def update_grasps(self) -> None:
        """After a control step: closed grippers take hold of what they touch, and `held` is updated."""
        state = self._state
        offset = state.objects - state.gripper[:, None]
        near = state.movable & ((offset * offset).sum(-1) < MAX_DISTANCE**2)
        could = near.any(1) & (self.closed if not self._max_opening else self._opening < self._max_opening)
        self.held[~could] = NOTHING
        for i in np.flatnonzero(could).tolist():
            slots, world = np.flatnonzero(state.shown[i]), self._worlds[i]  # a world numbers only what it shows
            world.update_grasp(np.flatnonzero(near[i, slots]).tolist(), state.gripper[i].tolist())
            self.held[i] = NOTHING if world.held is None else slots[world.held]

    def are_apart(self, joints: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether the fingers are as far apart as they get. joints: (N, J + F), those of the fingers last."""
        if not self._max_opening:
            return np.ones(len(joints), bool)
        return self._openings(joints) > APART * self._max_opening

    def _openings(self, joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) how far the fingers are open, metres or radians."""
        return self._robot.finger_opening_at(joints[:, -self._num_fingers :].mean(1))

    def observation(self, joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 1 or 3) in [0, 1]: how far the fingers are open; where it can grip, also how far they are commanded to be
        closed, and whether anything is held. joints: (N, J + F), those of the fingers last."""
        opening = np.zeros((len(joints), 1))
        if self._num_fingers:
            opening = (self._openings(joints) / self._robot.finger_opening)[:, None]
        if not self.can_grip:
            return opening
        closing = 1 - self._opening / self._max_opening if self._max_opening else self.closed
        return np.concatenate((opening, closing[:, None], (self.held != NOTHING)[:, None]), axis=1)

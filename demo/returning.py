"""The way back to the rest position, where policies are trained to start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.interactive.interactive_env import InteractiveEnv

Array = NDArray[np.float64]
LOW = 0.15  # metres: below this height, the gripper first goes straight up
NEAR = 0.06  # metres from the rest position at which the gripper counts as there
MAX_STEPS = 60  # control steps of the way


class Return:
    """Brings the gripper back: straight up at first, so that it drags no object along.

    holds: (1,) whether the gripper is closed: it keeps what it held as the return began, and takes nothing on its way.
    """

    def __init__(self, env: InteractiveEnv) -> None:
        """low: metres below which the gripper goes straight up; over a board, where stacks end."""
        self._env = env
        self._steps = 0
        self.holds = np.zeros(1, bool)
        self._low = min(float(env.rest_position[2]), env.config.workspace.gripper_box[-1]) - NEAR / 2
        self._low = self._low if env.task.traits.stacks else LOW

    def start(self) -> None:
        """Starts the return, unless the gripper is at rest already."""
        self._steps = 0 if self._is_there() else MAX_STEPS
        self.holds = np.array([self._env.held is not None])

    def skip(self) -> None:
        """Leaves the gripper where it is."""
        self._steps = 0

    @property
    def is_high(self) -> bool:
        """Whether the gripper is above all objects on the table."""
        return bool(self._env.gripper[0, 2] > self._low)

    @property
    def is_over(self) -> bool:
        """Whether the gripper has arrived, or has taken too long."""
        return self._steps <= 0 or self._is_there()

    def step(self) -> None:
        """To be called after each control step on the way."""
        self._steps -= 1

    def next_position(self) -> Array:
        """(3,) metres: where the gripper goes next."""
        gripper = self._env.gripper[0]
        return self._env.rest_position if self.is_high else gripper + [0.0, 0.0, LOW]

    def _is_there(self) -> bool:
        return bool(np.linalg.norm(self._env.gripper[0] - self._env.rest_position) < NEAR)

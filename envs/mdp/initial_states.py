"""Joint angles for episodes that begin with the gripper somewhere over the table."""

from __future__ import annotations

import numpy as np

from envs.sim.kinematics import Array, Kinematics

GRID = (5, 9, 5)  # places along x, y and z
REFINING = 8  # steps of inverse kinematics from the nearest of those


class InitialStates:
    """box: (2, 3), lowest and highest corner of where grippers may be, metres."""

    def __init__(self, chain: Kinematics, box: Array) -> None:
        self._chain, self._rotation = chain, chain.forward(chain.rest[None]).rotation[0]
        axes = [np.linspace(low, high, count) for low, high, count in zip(*box, GRID, strict=True)]
        self._places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        rest = np.repeat(chain.rest[None], len(self._places), axis=0)
        self._joints = chain.solve(rest, self._places, self._rotation, iterations=60)

    def joints(self, position: Array) -> Array:
        """(J,) with the gripper at position (3,), metres, pointing down."""
        nearest = ((self._places - position) ** 2).sum(1).argmin()
        return self._chain.solve(self._joints[[nearest]], position[None], self._rotation, REFINING)[0]

"""Joint angles at which episodes begin: about the rest pose, or with the gripper where the curriculum puts it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.random import Generator

from envs.sim.kinematics import Array, Kinematics
from envs.tasks import EpisodeSpec

GRID = (5, 9, 5)  # positions along x, y and z that are solved beforehand
REFINING_STEPS = 8  # of inverse kinematics, from the nearest of those


class InitialStates:
    """Draws joint angles.

    Args:
        chain: the arm.
        noise: radians that each joint may be from its rest pose.
        box: (2, 3), lowest and highest corner of where grippers may be, metres, for episodes that the curriculum
            begins elsewhere; None: there is no curriculum.
    """

    def __init__(self, chain: Kinematics, noise: float, box: Array | None = None) -> None:
        self._chain, self._noise, self._rotation = chain, noise, chain.forward(chain.rest[None]).rotation[0]
        self._positions = self._joints = np.zeros((0, 3))
        if box is not None:
            self._positions, self._joints = _solved_grid(chain, tuple(map(tuple, box.tolist())))

    def draw(self, episode: EpisodeSpec, below: float, rng: Generator) -> Array:
        """(J,) for this episode. below: metres from the gripper centre down to the centre of an object it holds."""
        joints = self._chain.rest + rng.uniform(-self._noise, self._noise, len(self._chain.rest))
        if episode.start is None or not len(self._positions):
            return joints
        return self.joints(episode.scene.positions[episode.referent] + episode.start.offset + [0.0, 0.0, below])

    def joints(self, position: Array) -> Array:
        """(J,) with the gripper at position (3,), metres, pointing down."""
        nearest = ((self._positions - position) ** 2).sum(1).argmin()
        return self._chain.solve(self._joints[[nearest]], position[None], self._rotation, REFINING_STEPS)[0]


@lru_cache(maxsize=64)
def _solved_grid(chain: Kinematics, box: tuple[tuple[float, ...], ...]) -> tuple[Array, Array]:
    """Positions (P, 3) all over the box, and joints (P, J) with the gripper there, oriented as at rest."""
    axes = [np.linspace(low, high, count) for low, high, count in zip(*box, GRID, strict=True)]
    positions = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    rest = np.repeat(chain.rest[None], len(positions), axis=0)
    rotation = chain.forward(chain.rest[None]).rotation[0]
    return positions, chain.solve(rest, positions, rotation, iterations=60)

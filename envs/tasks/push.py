"""Push: move an object over the table to a place without ever holding it."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.base import Array, State
from envs.tasks.manipulation import Manipulation
from envs.tasks.ways import clear_ways, funnel, horizontal, length
from language import Placed, Scene

ROOM = 0.06  # metres from the border of where objects are put to those that are pushed: a gripper must get behind them
BEHIND = 0.03  # metres from an object's side to the centre of a gripper that is about to push it
NEAR = 0.05  # metres further away that a gripper begins, at most, and above the object's middle
LOST = 0.02  # metres beyond that border at which no gripper gets behind them any more
# The funnel to the place behind, metres: narrow and steep, since the object is in the way of who comes from beyond it.
MOUTH, SLOPE, ABOVE = 0.015, 2.0, 0.08


class Push(Manipulation):
    """ "push the green cube to the same position as the transparent red cube".

    Success: the referent lies within `radius` of its target, at rest, for `hold_steps` steps. Pushed to where nobody
    can push it back from, it is lost, and the episode has failed.
    Potentials: approach (metres that the gripper has to go to the place behind the object, as seen from its target,
    along a funnel over it, negative; 0 once the object is there), transport (metres from object to target, negative)
    and rest (the share of `hold_steps` that it has lain there).
    """

    verb = "push"
    fails = True
    potentials = ("approach", "transport", "rest")

    def _fits(self, placed: Placed) -> bool:
        return self._has_room(placed) and clear_ways(placed)

    def _has_room(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        inner = np.array([[x0, y0], [x1, y1]]) + [[ROOM], [-ROOM]]
        places = placed.scene.positions[~placed.scene.targets, :2]
        return bool(((places >= inner[0]) & (places <= inner[1])).all())

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._there(state) & (self._still >= 1)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        x0, x1, y0, y1 = self._area
        x, y = self._referent(state)[:, :2].T
        inside = (x > x0 - LOST) & (x < x1 + LOST) & (y > y0 - LOST) & (y < y1 + LOST)
        return ~inside & ~self._there(state)

    def _there(self, state: State) -> NDArray[np.bool_]:
        return length(self._goal(state) - self._referent(state)) <= self.config.radius

    def _potentials(self, state: State) -> dict[str, Array]:
        place, goal = self._referent(state), self._goal(state)
        behind = place - self._behind() * horizontal(goal - place)
        return {
            "approach": np.where(self._there(state), 0.0, -funnel(state.gripper - behind, ABOVE, MOUTH, SLOPE)),
            "transport": -length(goal - place),
            "rest": np.minimum(self._reached / self.config.hold_steps, 1.0),
        }

    def _behind(self) -> float:
        return self.config.object_size / 2 + BEHIND

    def _near(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """The gripper begins low behind the object."""
        assert target is not None
        way = horizontal(scene.positions[target] - scene.positions[referent])
        back, up = rng.uniform(0.0, NEAR, 2)
        return up * np.array([0.0, 0.0, 1.0]) - (self._behind() + back) * way

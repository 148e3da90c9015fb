"""Push: move an object over the table to its target without gripping it."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from envs.tasks.geometry import horizontal, length, paths_are_clear, share_at_goal
from envs.tasks.manipulation import Manipulation
from envs.tasks.registry import register_task
from envs.tasks.types import Array, Column, State
from language import Placed, Scene

MARGIN = 0.06  # metres from the border of the object area to pushed objects, so that a gripper fits behind them
BEHIND = 0.02  # metres from an object's side to the centre of a gripper that is about to push it
NEAR = 0.05  # greatest further distance, and height over the object's middle, at which a gripper begins, metres
FASTEST = 0.03  # bound of the observed sliding, metres per control step
LOST = 0.02  # metres beyond that border at which no gripper can push an object back
SLACK = 0.04  # further metres that a gripper may be behind: pushed objects slide ahead of it
# Height in metres of the gripper on its way to behind the object, by its horizontal distance: it must pass above.
MOUTH, SLOPE, ABOVE = 0.015, 2.0, 0.08


@register_task("push", "nl_push", verb="push")
class Push(Manipulation):
    """ "push the green cube to the same position as the transparent red cube".

    Success: the referent lies within `radius` of its target, at rest, for `hold_steps` steps. The episode fails
    once the referent is `LOST`: no gripper can push it back.
    Potentials: approach (metres that the gripper has to go, up, over and down, to the place behind the object, as seen
    from its target, negative; 0 once the object is there), transport (metres from object to target, negative) and rest
    (the share of `success_steps` that it has lain there).
    """

    fails = True
    columns = (
        Column("slid x (m)", -FASTEST, FASTEST),
        Column("slid y (m)", -FASTEST, FASTEST),
        Column("lies at a target", 0.0, 1.0),
    )
    potentials = ("approach", "transport", "rest")

    def seen(self, state: State) -> Array:
        return np.concatenate((self._moved[..., :2], share_at_goal(state, self.config.radius)[..., None]), axis=2)

    @property
    def memory(self) -> Array:
        """(N, 3) the share of `success_steps` that the referent has lain at its target, and how it slides."""
        sliding = np.clip(0.5 + self._motion[:, :2] / (2 * FASTEST), 0.0, 1.0)
        return np.concatenate((self._lain()[:, None], sliding), axis=1)

    def _is_feasible(self, placed: Placed) -> bool:
        return self._inside_margin(placed) and paths_are_clear(placed)

    def _inside_margin(self, placed: Placed) -> bool:
        x0, x1, y0, y1 = self._area
        inner = np.array([[x0, y0], [x1, y1]]) + [[MARGIN], [-MARGIN]]
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
        return length(self._goal(state) - self._referent(state)) <= self.config.success_radius

    def _potentials(self, state: State) -> dict[str, Array]:
        place, goal = self._referent(state), self._goal(state)
        to_go = self._to_go(state.gripper - place, horizontal(goal - place))
        return {
            "approach": np.where(self._there(state), 0.0, -to_go),
            "transport": -length(goal - place),
            "rest": self._lain(),
        }

    def _lain(self) -> Array:
        """(N,) the share of `success_steps` that the referent has lain at its target."""
        return np.minimum(self._reached / self.config.success_steps, 1.0)

    def _to_go(self, offset: Array, way: Array) -> Array:
        """(N,) metres from a gripper at `offset` (N, 3) to a place behind an object that is to move along `way` (N, 3).

        The horizontal distance plus that in height. A gripper that is too low has to go up and down again.
        """
        back = -(offset * way).sum(-1)
        behind = np.clip(back, self._behind(), self._behind() + SLACK)
        aside = length((offset + behind[:, None] * way)[:, :2])
        wanted = np.clip(SLOPE * (aside - MOUTH), 0.0, ABOVE)
        return aside + np.maximum(np.abs(offset[:, 2]), 2 * wanted - offset[:, 2])

    def _behind(self) -> float:
        return self.config.object_size / 2 + BEHIND

    def _near_offset(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """The gripper begins low behind the object."""
        assert target is not None
        way = horizontal(scene.positions[target] - scene.positions[referent])
        back, up = rng.uniform(0.0, NEAR, 2)
        return up * np.array([0.0, 0.0, 1.0]) - (self._behind() + back) * way

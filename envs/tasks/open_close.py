"""Open and close: pull a drawer or the door of a fridge by its handle until it is open, or shut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.tasks.furnished import OPEN, SHUT, Furnished
from envs.tasks.geometry import funnel
from envs.tasks.manipulation import Manipulation
from envs.tasks.pick_and_place import ABOVE, MOUTH
from envs.tasks.registry import register_task
from envs.tasks.types import Array, State
from language import Placed


class OpenClose(Furnished, Manipulation):
    """The referent is a fitting. It stays where it is left.

    Success: it is open, or shut, for `hold_steps` steps, pulled or pushed. Another object, or another fitting's handle,
    that is moved is the wrong object.
    Potentials: approach (metres from gripper to handle along a funnel above it, negative; 0 while it is held or the
    goal is reached), grasp (1 while it is held or the goal is reached) and operate (the share of the way there).
    """

    potentials = ("approach", "grasp", "operate")

    def _share(self, state: State) -> Array:
        """(N,) the share by which the referent is open."""
        each = self._rows, state.referent
        return self.shares(state.nouns[each], state.objects[each])

    def _potentials(self, state: State) -> dict[str, Array]:
        has = (state.held == state.referent) | self._at_goal(state)
        way = funnel(state.gripper - self._referent(state), ABOVE, MOUTH)
        return {
            "approach": np.where(has, 0.0, -way),
            "grasp": has.astype(np.float64),
            "operate": np.clip(self._done(state), 0.0, 1.0),
        }

    def _done(self, state: State) -> Array:
        """(N,) the share of the way to the goal."""
        return self._share(state) / OPEN

    def _at_goal(self, state: State) -> NDArray[np.bool_]:
        return self._done(state) >= 1.0

    def _stays(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which objects are to stay where they are: objects in the referent move with it."""
        along = self._inside(state.nouns, state.objects)[self._rows, :, state.referent]
        return super()._stays(state) & ~along

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are not yet open."""
        return self._fits(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) < SHUT)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self._movable(placed).any())


@register_task("nl_open", verb="open")
class Open(OpenClose):
    """ "open the drawer"."""


@register_task("nl_close", verb="close")
class Close(OpenClose):
    """ "close the fridge"."""

    def _done(self, state: State) -> Array:
        return (1.0 - self._share(state)) / (1.0 - SHUT)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are open."""
        return self._fits(placed) & (self.shares(placed.scene.nouns, placed.scene.positions) > OPEN)

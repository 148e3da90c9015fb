"""Open, close, put in and take out: tasks with the fittings of the workspace, a drawer and a fridge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.pick_and_place import ABOVE, MOUTH, PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.fittings import FITTING_COLUMNS, OPEN, SHUT, FittingStarts, SceneFittings
from envs.tasks.shared.free_places import FREE_COLUMNS, FreeTable
from envs.tasks.shared.geometry import funnel
from envs.tasks.shared.manipulation import SCENES, Manipulation
from envs.tasks.shared.types import Array, EpisodeSpec, State
from language import FITTINGS, Placed, Scene

PUSHED = 0.25  # share by which the fitting of the instruction may be opened or closed by accident
JITTER = 0.012  # metres from the middle of a fitting at which an object in it begins, at most
WIDE_OPEN = (0.94, 1.0)  # shares at which a fitting is open far enough for objects to go in and out


class OpenClose(Manipulation):
    """The referent is a fitting. It stays where it is left.

    Success: it is open, or shut, for `hold_steps` steps, pulled or pushed.
    """

    traits = replace(Manipulation.traits, grips=True)
    fixtures: tuple[str, ...] = FITTINGS
    columns = FITTING_COLUMNS
    fitting_starts = FittingStarts()
    fittings: SceneFittings
    potentials = ("approach", "grasp", "operate")

    def _share(self, state: State) -> Array:
        """(N,) the share by which the referent is open."""
        each = self._rows, state.referent
        return self.fittings.shares(state.nouns[each], state.objects[each])

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
        along = self.fittings.inside(state.nouns, state.objects)[self._rows, :, state.referent]
        return super()._stays(state) & ~along

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are not yet open."""
        return self.fittings.are_shut(placed)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self._movable(placed).any())


@register_task("nl_open", verb="open")
class Open(OpenClose):
    """Open the drawer or the fridge by its handle.

    Instruction: "open the drawer".
    Success: it is open by `OPEN` of its range, for `hold_steps` steps.
    Failure: wrong_object, once another object, or another fitting's handle, has been moved.
    Reward terms: approach (metres from gripper to handle along a funnel above it, negative; 0 while it is held or the
        goal is reached), grasp (1 while it is held or the goal is reached) and operate (the share of the way there);
        success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects counts the fittings; needs workspace=room.
    """


@register_task("nl_close", verb="close")
class Close(OpenClose):
    """Close the drawer or the fridge by its handle.

    Instruction: "close the fridge".
    Success: it is open by no more than `SHUT` of its range, for `hold_steps` steps.
    Failure: wrong_object, once another object, or another fitting's handle, has been moved.
    Reward terms: as of `Open`: approach, grasp and operate; success, wrong_object, wrong_target (always 0) and time.
    Config keys: num_objects counts the fittings; needs workspace=room.
    """

    def _done(self, state: State) -> Array:
        return (1.0 - self._share(state)) / (1.0 - SHUT)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) the fittings that are open."""
        return self.fittings.are_open(placed)


class OpenedFittings:
    """How far the fittings were open as each world's episode began.

    Args:
        fittings: of the task.
        worlds, slots: N and K.
    """

    def __init__(self, fittings: SceneFittings, worlds: int, slots: int) -> None:
        self._fittings = fittings
        self._shares = np.zeros((worlds, slots))

    def note(self, worlds: NDArray[np.int64], state: State) -> None:
        """Take the shares by which fittings are open in these worlds."""
        self._shares[worlds] = self._fittings.shares(state.nouns, state.objects)[worlds]

    def were_pushed(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the fittings of the instructions, the targets, have been pushed by `PUSHED` since."""
        each = np.arange(len(state.target)), state.target
        shares = self._fittings.shares(state.nouns[each], state.objects[each])
        return np.abs(shares - self._shares[each]) > PUSHED


@register_task("nl_put_in", verb="put_in")
class PutIn(PickAndPlace):
    """Put a loose object in the drawer or the fridge, which is open.

    Instruction: "put the red cube in the drawer".
    Success: the object has been picked up and lies in the fitting, released and at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; wrong_target, where it was left in another fitting;
        failed, once the fitting of the instruction has been pushed by `PUSHED` of its range.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`; success, wrong_object,
        wrong_target, failed and time.
    Config keys: num_objects counts the fittings; needs workspace=room.
    """

    traits = replace(PickAndPlace.traits, real_goals=True, fails=True)
    fixtures: tuple[str, ...] = FITTINGS
    columns = FITTING_COLUMNS
    fitting_starts = FittingStarts(shut=0.25, wide=WIDE_OPEN)
    fittings: SceneFittings

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self._opened = OpenedFittings(self.fittings, worlds, self.config.slots)

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._raised[worlds] = (state.held == state.referent)[worlds]
        self._opened.note(worlds, state)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        return self._opened.were_pushed(state)

    def _goal(self, state: State) -> Array:
        each = self._rows, state.target
        return self.fittings.middles(state.nouns[each], state.objects[each])

    def _referent_in(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which fittings the referents are in."""
        return self.fittings.inside(state.nouns, state.objects)[self._rows, state.referent]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        return self._referent_in(state)[self._rows, state.target]

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        there = self._referent_in(state)
        there[self._rows, state.target] = False
        return (there & state.goals).any(1) & self._is_left(state)

    # ---- drawing

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        return self.fittings.are_open(placed)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        return super()._movable(placed) & ~self.fittings.among(placed)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self.possible_goals(placed).any() and self._movable(placed).any())


@register_task("nl_take_out", verb="take_out")
class TakeOut(PickAndPlace):
    """Take an object out of the drawer or the fridge. One lies in each of them, and one or more on the table.

    Instruction: "take the red cube out of the fridge".
    Success: the object has been picked up and stands on the table, beside all others, released and at rest, for
        `hold_steps` steps.
    Failure: wrong_object, once another object has been moved; failed, once the fitting of the instruction has been
        pushed by `PUSHED` of its range.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`, with a place of the table that was
        free as the episode began as the target; success, wrong_object, wrong_target (always 0), failed and time.
    Config keys: num_objects counts the fittings; needs workspace=room.
    """

    traits = replace(PickAndPlace.traits, real_goals=True, fails=True)
    fixtures: tuple[str, ...] = FITTINGS
    columns = (*FITTING_COLUMNS, *FREE_COLUMNS)
    fitting_starts = FittingStarts(shut=0.0, wide=WIDE_OPEN)
    fittings: SceneFittings

    # ---- evaluating

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        config = self.config
        self._opened = OpenedFittings(self.fittings, worlds, config.slots)
        self._table = FreeTable(self._area, config.object_size, worlds, config.slots)

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        self._raised[worlds] = (state.held == state.referent)[worlds]
        self._opened.note(worlds, state)
        self._table.note(worlds, state)

    def seen(self, state: State) -> Array:
        return np.concatenate((super().seen(state), self._table.offsets(state)[..., :2]), axis=-1)

    def described(self, episode: EpisodeSpec) -> Array:
        return np.concatenate((super().described(episode), self._table.described(episode)[:, :2]), axis=-1)

    def _failed(self, state: State) -> NDArray[np.bool_]:
        return self._opened.were_pushed(state)

    def _goal(self, state: State) -> Array:
        return self._table.places[self._rows, state.referent]

    def _referent_in(self, state: State) -> NDArray[np.bool_]:
        """(N, K) which fittings the referents are in."""
        return self.fittings.inside(state.nouns, state.objects)[self._rows, state.referent]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        """(N,) whether the referent stands on the table, beside all others."""
        return self._table.stands(state) & ~self._referent_in(state).any(1)

    def _misplaced(self, state: State) -> NDArray[np.bool_]:
        return np.zeros(len(self._rows), bool)

    # ---- drawing

    def possible_goals(self, placed: Placed) -> NDArray[np.bool_]:
        return self.fittings.are_open(placed)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self.possible_goals(placed).any() and self._movable(placed).any())

    def _scene(self, rng: Generator) -> Scene:
        """Draw a scene whose first objects lie in the fittings."""
        scene = super()._scene(rng)
        places, count = scene.positions.copy(), len(FITTINGS)
        jitter = rng.uniform(-JITTER, JITTER, (count, 3)) * [1.0, 1.0, 0.0]
        places[:count] = self.fittings.middles(scene.nouns[-count:], places[-count:]) + jitter
        return scene.moved(places)

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects lie in a fitting."""
        return np.any(self.fittings.inside(placed.scene.nouns, placed.scene.positions), axis=1)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draw an episode whose referent lies in its target."""
        for _ in range(SCENES):
            episode = super()._draw(rng)
            if self._lies_in_target(episode):
                return episode
        raise ConfigError(f"task.name={self.config.name}: nothing lies in a fitting")

    def _each_in_turn(self, rng: Generator) -> list[EpisodeSpec]:
        return [episode for episode in super()._each_in_turn(rng) if self._lies_in_target(episode)]

    def _lies_in_target(self, episode: EpisodeSpec) -> bool:
        scene = episode.scene
        assert episode.target is not None
        return bool(self.fittings.inside(scene.nouns, scene.positions)[episode.referent, episode.target])

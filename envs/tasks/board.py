"""Rearrange: move an object of the stacks on a board to another cell, or onto another stack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.tasks.pick_and_place import CLEAR, LIFT, PickAndPlace
from envs.tasks.shared.base import register_task
from envs.tasks.shared.geometry import funnel, length, tops_on_the_way, with_object_at
from envs.tasks.shared.manipulation import SCENES
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import NOTHING, Array, Column, EpisodeSpec, GripperStart, State
from human import Person
from language import COLORS, NOUNS, Placed, Scene

ROUNDING = 1e-6  # of a cell
MOST_STACKED = 0.8  # greatest share of objects that are put on others as long as there are free cells
SHAPES = ("cube", "pyramid")
PYRAMIDS = 0.15  # share of the objects on top of stacks that are pyramids, where no words name the objects
IN_THE_AIR = 0.25  # share of the targets that are in the air, where no words name the objects
STRAIGHT_UP = 0.5  # share of those that are over the object itself
HEIGHTS = (0.1, 0.02)  # metres at which the observed height over what is on the way is clipped: far and near
OFFSETS = 0.012  # ... and the offset from where the gripper would hold an object
CLEARANCE = 0.012  # metres between a carried object and the tops of stacks
LEAST_HEIGHT = 0.03  # metres above its end at which a way over the board is rewarded, at least
MOUTH, SLOPE = 0.005, 6.0  # of the funnels: between stacks only straight up and down
BESIDE = 0.003  # metres beside its object at which an episode begins over it, at most
LOWERED = 0.4  # share of the episodes with a held object in which it is straight over its target, at any height


@dataclass(frozen=True)
class Grid:
    """Square cells that fill an area. Columns go along x, rows along y, levels up.

    area: x0, x1, y0, y1. cell: width of a cell. size: width and height of an object. All in metres.
    """

    area: Sequence[float]
    cell: float
    size: float

    @property
    def columns(self) -> int:
        return int((self.area[1] - self.area[0]) / self.cell + ROUNDING)

    @property
    def rows(self) -> int:
        return int((self.area[3] - self.area[2]) / self.cell + ROUNDING)

    def place(self, column: float, row: float, level: float) -> Array:
        """(3,) the middle of an object in this cell and at this level, metres. Levels count from 0."""
        x, y = self.area[0] + (column + 0.5) * self.cell, self.area[2] + (row + 0.5) * self.cell
        return np.array([x, y, (level + 0.5) * self.size])

    def cells(self, places: Array) -> NDArray[np.int64]:
        """(K, 3) column, row and level of the cells on the grid nearest to places (K, 3), metres."""
        offset = places - self.place(0, 0, 0)
        cells = np.rint(offset / [self.cell, self.cell, self.size]).astype(np.int64)
        return np.clip(cells, 0, [self.columns - 1, self.rows - 1, np.iinfo(np.int64).max])

    def draw(self, rng: Generator, count: int, targets: int, levels: int) -> Array:
        """(count + targets, 3) places of objects in random stacks, then free places for targets in as many cells.

        Raises ConfigError where they do not fit.
        """
        free = self.columns * self.rows
        if count + targets > free * levels - targets * (levels - 1) or targets > free:
            raise ConfigError(
                f"task.num_objects={count} objects in stacks of task.levels={levels} and {targets} targets do not fit "
                f"into workspace.object_area={list(self.area)}"
            )
        heights, cells = np.zeros(free, np.int64), []
        goals = rng.permutation(free)[:targets]
        room = np.full(free, levels)
        room[goals] -= 1
        share = rng.uniform(0.0, MOST_STACKED)
        for _ in range(count):
            cells.append(self._next(heights, room, share, rng))
            heights[cells[-1][0]] += 1
        cells += [(int(goal), int(heights[goal])) for goal in goals]
        return np.array([self.place(cell // self.rows, cell % self.rows, level) for cell, level in cells])

    def _next(
        self, heights: NDArray[np.int64], room: NDArray[np.int64], share: float, rng: Generator
    ) -> tuple[int, int]:
        """Return the cell and level of one more object: with this share on a stack, else in an empty cell."""
        open_ = heights < room
        stacked, empty = np.flatnonzero(open_ & (heights > 0)), np.flatnonzero(open_ & (heights == 0))
        on_stack = len(stacked) > 0 and (rng.random() < share or not len(empty))
        cell = int(rng.choice(stacked if on_stack else empty))
        return cell, int(heights[cell])


def above(positions: Array, size: float) -> NDArray[np.bool_]:
    """(K, K) whether the second of two places (K, 3) is over the first, in the same stack; size: of objects, metres."""
    offset = positions[None] - positions[:, None]
    return (np.abs(offset[..., :2]).max(-1) < size) & (offset[..., 2] > size / 2)


@register_task("rearrange", "nl_rearrange", verb="pick_and_place")
class Rearrange(PickAndPlace):
    """Bring an object on top of a stack to a free place of the board: an empty cell, or the top of another stack.

    A see-through target marks the place. Without words, a column of the objects marks the referent, and some targets
    are in the air: an object is brought there and not released.

    Instruction: "pick the red cube and place it to the same position as the transparent green cube"; or none.
    Success: the referent has been held, and lies within half a cell of its target along x and along y, at the same
        level, released (in the air: held) and at rest, for `hold_steps` steps.
    Failure: wrong_object, once another object has been moved by half a cell; wrong_target, once it was left at another
        target.
    Reward terms: approach, grasp, lift, transport and release as of `PickAndPlace`, along funnels over the highest
        stack of the board; success, wrong_object, wrong_target and time.
    Config keys: num_objects, min_objects, num_targets, levels, spacing (of cells), kinds; needs workspace=board.
    """

    traits = replace(PickAndPlace.traits, stacks=True, marks=True)
    nouns = ("cube",)
    shapes = SHAPES
    columns = (
        Column("is the one to be moved; 0 where words say it", 0.0, 1.0),
        Column("is in the air", 0.0, 1.0),
        Column("metres from the tops on the straight way to it up to the gripper", -HEIGHTS[0], HEIGHTS[0]),
        Column("the same from where the middle of an object passes over those tops", -HEIGHTS[1], HEIGHTS[1]),
        *(Column(f"metres along {axis} from where the gripper would hold it", -OFFSETS, OFFSETS) for axis in "xyz"),
    )

    def _configure(self, config: TaskConfig, person: Person | None) -> None:
        self.disturbed = config.spacing / 2
        self._grid = Grid(self._area, config.spacing, config.object_size)
        super()._configure(config, person)

    def _allocate(self, worlds: int) -> None:
        super()._allocate(worlds)
        self.in_the_air = np.zeros(worlds, bool)  # whether nothing is below the target, so that it is held there
        self._travel = np.zeros(worlds)  # height of an object's centre at which it is carried over all others, metres

    def seen(self, state: State) -> Array:
        slots, size = np.arange(state.shown.shape[1]), self.config.object_size
        free = state.movable & (slots != state.held[:, None])
        others = free[:, None] & (slots != slots[:, None])
        height = state.gripper[:, 2:] - tops_on_the_way(
            state.objects, others, starts=state.gripper[:, :2], ends=state.objects[..., :2], size=size
        )
        marked = (slots == state.referent[:, None]) & (not self.traits.speaks)
        flags = marked, _is_in_the_air(state.objects, free, size), height, height - CLEARANCE - size / 2
        offset = state.objects - state.gripper[:, None] + [0.0, 0.0, size / 2]
        return np.concatenate((np.stack(flags, axis=2), offset), axis=2)

    # ---- evaluating

    def _reset_memory(self, worlds: NDArray[np.int64], state: State) -> None:
        super()._reset_memory(worlds, state)
        others = state.movable.copy()
        others[self._rows, state.referent] = False
        highest = np.where(others, state.objects[..., 2], 0.0).max(1) + self.config.object_size + CLEARANCE
        self._travel[worlds] = highest[worlds]
        in_the_air = _is_in_the_air(state.objects, others, self.config.object_size)[self._rows, state.target]
        self.in_the_air[worlds] = in_the_air[worlds]

    def _is_near_goal(self, state: State) -> NDArray[np.bool_]:
        offset = np.abs(self._goal(state) - self._referent(state))
        level = offset[:, 2] < self.config.object_size / 2
        return (offset[:, :2].max(1) <= self.config.success_radius) & level

    def _placed_there(self, state: State) -> NDArray[np.bool_]:
        there = (self._raised >= LIFT / CLEAR) & self._is_near_goal(state)
        return there & (state.held == np.where(self.in_the_air, state.referent, NOTHING))

    def _way_to_object(self, state: State) -> Array:
        place = self._referent(state)
        return funnel(state.gripper - place, self._height_above(place), MOUTH, SLOPE)

    def _way_to_goal(self, state: State) -> Array:
        goal = self._goal(state)
        return funnel(self._referent(state) - goal, self._height_above(goal), MOUTH, SLOPE)

    def _height_above(self, place: Array) -> Array:
        """(N,) metres above place (N, 3) at which the gripper and its load pass over all stacks."""
        return np.maximum(self._travel - place[:, 2], LEAST_HEIGHT)

    # ---- drawing

    def _scene(self, rng: Generator) -> Scene:
        config = self.config
        count = self._draw_count(rng)
        places = self._grid.draw(rng, count, config.num_targets, config.levels)
        if not self.traits.speaks and config.levels > 1 and rng.random() < IN_THE_AIR:
            places[count:, 2] += rng.integers(1, config.levels, size=config.num_targets) * config.object_size
            places[count:, 2] = np.minimum(places[count:, 2], self._grid.place(0, 0, config.levels - 1)[2])
        colors = rng.integers(len(COLORS), size=len(places))
        nouns = np.full(len(places), list(NOUNS).index("cube"))
        targets = np.arange(len(places)) >= count
        return Scene.from_arrays(nouns, colors, places, config.object_size, targets=targets, viewpoint=config.viewpoint)

    def _draw(self, rng: Generator) -> EpisodeSpec:
        """Draw as in other tasks, but some objects are only to be taken up: their target is over them, in the air."""
        episode = super()._draw(rng)
        scene, referent, target = episode.scene, episode.referent, episode.target
        begins_there = episode.start is None or not episode.start.held
        if self.traits.speaks or target is None or not begins_there or rng.random() >= STRAIGHT_UP:
            return episode
        others = ~scene.targets & (np.arange(len(scene)) != referent)
        if not _is_in_the_air(scene.positions[None], others[None], self.config.object_size)[0, target]:
            return episode
        place = np.append(scene.positions[referent, :2], scene.positions[target, 2])
        higher = place[2] > scene.positions[referent, 2] + self.config.object_size / 2
        return replace(episode, scene=with_object_at(scene, target, place)) if higher else episode

    def _draw_scene(self, rng: Generator) -> tuple[Placed, NDArray[np.bool_]]:
        """Draw as in other tasks, but only one object that can be moved and its target need a name."""
        for _ in range(SCENES):
            placed = self._placed(rng)
            nameable = np.ones(len(placed.scene), bool)
            if self.traits.speaks:
                nameable = self._sentences.nameable(placed.scene)
            if (self._movable(placed) & nameable).any() and (self.possible_goals(placed) & nameable).any():
                return placed, nameable
        raise ConfigError(f"task.kinds={list(self.config.kinds)} names no object on top of a stack, and no target")

    def _movable(self, placed: Placed) -> NDArray[np.bool_]:
        """(K,) which objects are on top of a stack without a target."""
        return super()._movable(placed) & ~above(placed.scene.positions, self.config.object_size).any(1)

    def _is_feasible(self, placed: Placed) -> bool:
        return bool(self._movable(placed).any())

    def episode(self, placed: Placed, referent: int, target: int | None, rng: Generator) -> EpisodeSpec:
        """Return the episode as in other tasks. Without words, some objects on top of stacks are pyramids."""
        pyramids = self._movable(placed) & (rng.random(len(placed.scene)) < (0.0 if self.traits.speaks else PYRAMIDS))
        shapes = np.where(pyramids, SHAPES.index("pyramid"), SHAPES.index("cube"))
        episode = super().episode(placed, referent, target, rng)
        return replace(episode, shapes=shapes, resting=np.ones(len(placed.scene), bool))

    def _draw_start(
        self, placed: Placed, referent: int, target: int | None, rng: Generator
    ) -> tuple[GripperStart | None, Scene]:
        """Draw as in other tasks, but nothing begins released in the air."""
        start, scene = super()._draw_start(placed, referent, target, rng)
        released = start is not None and not start.held and scene is not placed.scene
        others = ~scene.targets & (np.arange(len(scene)) != referent)
        if released and _is_in_the_air(scene.positions[None], others[None], self.config.object_size)[0, target]:
            return None, placed.scene
        return start, scene

    def relabel(self, placed: Placed, moments: State, rng: Generator) -> EpisodeSpec | None:
        """Relabel as in other tasks; the target is moved to the level where the object was left, too."""
        episode = super().relabel(placed, moments, rng)
        if episode is None or episode.target is None:
            return None
        target = episode.scene.positions[episode.target]
        ways = moments.objects[:, episode.referent]
        when = int(length(ways[:, :2] - target[:2]).argmin())
        if moments.held[when] == episode.referent:
            return None  # no target is in the air
        goal = np.append(target[:2], ways[when, 2])
        return replace(episode, scene=with_object_at(episode.scene, episode.target, goal))

    def _near_offset(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Array:
        """Straight over the referent, up to where the gripper passes over all stacks."""
        most = max(self._over_all(scene, referent) - scene.positions[referent, 2], LEAST_HEIGHT)
        return rng.uniform([-BESIDE, -BESIDE, 0.0], [BESIDE, BESIDE, most])

    def _held_scene(self, scene: Scene, referent: int, target: int | None, rng: Generator) -> Scene | None:
        """Return the scene with the referent over all stacks, or straight over the target."""
        highest = self._over_all(scene, referent)
        place = rng.uniform(self._low, self._high)
        place[2] = highest
        if target is not None and rng.random() < LOWERED:
            goal = scene.positions[target]
            place = np.append(goal[:2], rng.uniform(goal[2], max(highest, goal[2])))
        return with_object_at(scene, referent, place)

    def _over_all(self, scene: Scene, referent: int) -> float:
        """Metres above the table at which the middle of a carried object passes over all others."""
        others = ~scene.targets & (np.arange(len(scene)) != referent)
        top = float(scene.positions[others, 2].max(initial=0.0))
        return top + self.config.object_size + CLEARANCE

    @property
    def _low(self) -> Array:
        return self._grid.place(0, 0, 0)

    @property
    def _high(self) -> Array:
        return self._grid.place(self._grid.columns - 1, self._grid.rows - 1, 0)


def _is_in_the_air(places: Array, solid: NDArray[np.bool_], size: float) -> NDArray[np.bool_]:
    """(N, K) whether no solid object, and not the table, is right below each place (N, K, 3), metres.

    solid: (N, K) which objects could carry another one. size: of objects, metres.
    """
    offset = places[:, :, None] - places[:, None]
    below = (np.abs(offset[..., :2]).max(-1) < size) & (np.abs(offset[..., 2] - size) < size / 2)
    return (places[..., 2] > size) & ~(below & solid[:, None]).any(2)

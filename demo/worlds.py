"""The world that words are about, as the language sees it: of a table, a room or a board."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from demo import board, room
from envs.interactive.interactive_env import InteractiveEnv, object_names
from envs.tasks.shared.fittings import OPEN
from language import Scene, WorldModel, table
from language.verbs import ROOM

BIT = 1.5  # "a bit", in radii within which an object counts as being at its place
Home = Mapping[int, tuple[float, float]]


def numbers_of(env: InteractiveEnv) -> NDArray[np.int64]:
    """The numbers in `env.scene()` of the things of the world."""
    return board.movable(env) if env.task.traits.stacks else np.arange(len(env.scene()))


def seen_from(scene: Scene, viewpoint: str) -> Scene:
    """The scene, with left and right as they are from this viewpoint."""
    if scene.viewpoint == viewpoint:
        return scene
    return Scene.from_arrays(scene.nouns, scene.colors, scene.positions, scene.sizes, scene.targets, viewpoint)


def world_of(env: InteractiveEnv, scene: Scene, home: Home) -> WorldModel:
    """The world as it is.

    Args:
        env: whose objects words are about.
        scene: the objects, with see-through ones at their own places, from the viewpoint of who speaks.
        home: the place (x, y) of each object where it belongs, metres.
    """
    if env.task.traits.stacks:
        return board.world_of(env, scene.viewpoint)
    area = tuple(env.config.workspace.object_area)
    if not env.task.verbs:
        traits = env.task.traits
        verbs = None if traits.moves or traits.grips or traits.operates else (env.task.verb,)
        return table(scene, env.held, bounds=area, little=BIT * env.config.task.radius, home=home, verbs=verbs)
    found = room.room_of(env, scene)
    inside = {int(thing): int(box) for thing, box in np.argwhere(found.inside | found.handed)}
    opened = np.flatnonzero(found.fits & (found.shares >= OPEN)).tolist()
    moved = dict(zip(np.flatnonzero(found.devices).tolist(), found.moved[found.devices].tolist(), strict=True))
    return table(
        scene,
        env.held if env.held is not None and found.loose[env.held] else None,
        bounds=area,
        inside=inside,
        open=frozenset(opened),
        moved=moved,
        home=home,
        flat_only=True,
        verbs=ROOM,
    )


def names_of(env: InteractiveEnv, scene: Scene) -> list[str]:
    """The name of each object of a scene, from its viewpoint."""
    if env.task.verbs:
        return room.names_of(scene)
    return board.object_names(env, scene.viewpoint) if env.task.traits.stacks else object_names(scene)


def homes(scene: Scene) -> dict[int, tuple[float, float]]:
    """Where each object stands, x and y in metres."""
    return {index: (x, y) for index, (x, y, _) in enumerate(scene.positions.tolist())}


def pointed_in(sentence: str, words: Sequence[str]) -> int:
    """How many words of a sentence need a gesture."""
    return sum(word.strip(".,!?") in words for word in sentence.lower().split())

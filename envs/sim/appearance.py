"""Random looks of one world: colours of furniture, robot, person and objects, and things of unknown shapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pybullet as bullet
from numpy.random import Generator
from numpy.typing import NDArray

from envs.sim.world import SimulatedWorld
from human import Body

Array = NDArray[np.float64]
PARKED = (0.0, 0.0, -40.0)  # metres: where unknown things are that a picture does not show
SHAPES: tuple[tuple[int, dict], ...] = (  # of unknown things, metres; none is as wide as high
    (bullet.GEOM_BOX, {"halfExtents": [0.05, 0.012, 0.008]}),
    (bullet.GEOM_BOX, {"halfExtents": [0.02, 0.02, 0.06]}),
    (bullet.GEOM_BOX, {"halfExtents": [0.06, 0.045, 0.006]}),
    (bullet.GEOM_CAPSULE, {"radius": 0.012, "length": 0.09}),
    (bullet.GEOM_CYLINDER, {"radius": 0.045, "length": 0.006}),
    (bullet.GEOM_CYLINDER, {"radius": 0.012, "length": 0.12}),
    (bullet.GEOM_CAPSULE, {"radius": 0.02, "length": 0.05}),
    (bullet.GEOM_BOX, {"halfExtents": [0.012, 0.09, 0.03]}),
)
SKIN_TONES = np.array(((0.3, 0.18, 0.1), (0.98, 0.84, 0.75)))  # the darkest and the lightest


class Appearance:
    """Changes how a world looks; poses of objects, fittings and devices are left alone.

    Args:
        world: with visuals.
    """

    def __init__(self, world: SimulatedWorld) -> None:
        self._client = world.client
        bodies = [bullet.getBodyUniqueId(i, self._client) for i in range(bullet.getNumBodies(self._client))]
        robot = world.robot.body
        person = world.person.body if isinstance(world.person, Body) else None
        moving = {*world.pool.bodies, *world.devices.bodies, *world.furniture.bodies.values()}
        if world.palm is not None:
            moving.add(world.palm.body)
        self._robot = self._shapes([robot])
        self._person = self._shapes([] if person is None else [person])
        self._furniture = self._shapes([body for body in bodies if body not in {robot, person, *moving}])
        self.furniture = sorted({body for body, *_ in self._furniture})
        self._unknown = [self._thing(kind, sides) for kind, sides in SHAPES]

    def _shapes(self, bodies: Sequence[int]) -> list[tuple[int, int, int, Array]]:
        """Return (body, link, index of the shape within it, RGBA) of the shapes that are seen."""
        found = []
        for body in bodies:
            counts: Counter[int] = Counter()
            for shape in bullet.getVisualShapeData(body, physicsClientId=self._client):
                if shape[7][3] == 1.0:
                    found.append((body, shape[1], counts[shape[1]], np.array(shape[7])))
                counts[shape[1]] += 1
        return found

    def _thing(self, kind: int, sides: dict) -> int:
        visual = bullet.createVisualShape(kind, **sides, physicsClientId=self._client)
        return bullet.createMultiBody(0, -1, visual, PARKED, physicsClientId=self._client)

    def recolor(self, rng: Generator) -> None:
        """Give furniture, robot and person other colours."""
        for body, link, index, rgba in self._furniture:
            color = np.clip(rgba[:3] * rng.uniform(0.7, 1.2) + rng.normal(0.0, 0.05, 3), 0, 1)
            self._paint(body, link, index, color if rng.random() < 0.6 else rng.uniform(0.0, 1.0, 3))
        gain = rng.uniform(0.7, 1.25, 3) if rng.random() < 0.5 else np.ones(3)
        for body, link, index, rgba in self._robot:
            self._paint(body, link, index, np.clip(rgba[:3] * gain, 0, 1))
        self._recolor_person(rng)

    def _recolor_person(self, rng: Generator) -> None:
        """Give shapes that have the same colour the same other one; skin stays a tone of skin."""
        new: dict[tuple[float, ...], Array] = {}
        for body, link, index, rgba in self._person:
            key = tuple(np.round(rgba[:3], 2))
            if key not in new:
                share = rng.random()
                skin = (1 - share) * SKIN_TONES[0] + share * SKIN_TONES[1]
                new[key] = skin if rgba[0] > rgba[2] + 0.1 else rng.uniform(0.0, 1.0, 3)
            self._paint(body, link, index, np.clip(new[key], 0, 1))

    def _paint(self, body: int, link: int, index: int, color: Array) -> None:
        bullet.changeVisualShape(body, link, index, rgbaColor=[*color.tolist(), 1], physicsClientId=self._client)

    def scatter(self, places: Sequence[Sequence[float]], rng: Generator) -> None:
        """Lay unknown things at these places (x, y), metres, in random colours, and put the others away."""
        shown = rng.permutation(len(self._unknown))[: len(places)].tolist()
        for number, body in enumerate(self._unknown):
            if number not in shown:
                bullet.resetBasePositionAndOrientation(body, PARKED, (0, 0, 0, 1), self._client)
        for number, (x, y) in zip(shown, places, strict=False):
            body, yaw = self._unknown[number], rng.uniform(0, np.pi)
            quaternion = (0.0, 0.0, np.sin(yaw), np.cos(yaw))
            bullet.resetBasePositionAndOrientation(body, (x, y, _height(number)), quaternion, self._client)
            bullet.changeVisualShape(body, -1, rgbaColor=[*rng.uniform(0, 1, 3), 1], physicsClientId=self._client)


def _height(number: int) -> float:
    """Return the height of an unknown thing's middle as it stands on the table, metres."""
    kind, sides = SHAPES[number]
    if kind == bullet.GEOM_BOX:
        return float(sides["halfExtents"][2])
    return float(sides["length"] / 2 + (sides["radius"] if kind == bullet.GEOM_CAPSULE else 0.0))

"""The objects of one world: bodies that are made once, and what an episode shows of them, devices and fittings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from pathlib import Path

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.file_cache import cached_text
from envs.sim.device_bodies import DeviceBodies, Pose
from envs.sim.furniture import LINK, Furniture, Palm
from envs.sim.gripper import BASE, Holdable
from envs.sim.rendering import Renderer, paint
from language import DEVICES, FITTINGS, HAND, NOUNS

PARKED = (0.0, 0.0, -5.0)  # metres: where objects sleep that the episode does not show
MASS = 0.1  # kg
DYNAMICS = {
    "lateralFriction": 0.8,
    "rollingFriction": 0.002,
    "spinningFriction": 0.002,
    "linearDamping": 0.1,
    "angularDamping": 0.3,
}
USUAL = (1.0, 1.0)  # factors of an object's mass and lateral friction
RESTING_GAP = 1e-3  # metres above the table that an object may be placed and still be at rest
NAMES = tuple(NOUNS)


# ---- loose objects


class Mobility(IntEnum):
    """How an object reacts when something runs into it."""

    FREE = 0  # it is pushed
    FIXED = 1  # it stays where it is
    GHOST = 2  # it has no collision shape: a see-through marker

    @classmethod
    def of(cls, targets: NDArray[np.bool_], fixed: NDArray[np.bool_] | None) -> NDArray[np.int64]:
        """(K,) the mobility of each object. targets, fixed: (K,) bool; without `fixed`, all but targets are free."""
        return np.where(targets, cls.GHOST, np.where(False if fixed is None else fixed, cls.FIXED, cls.FREE))


@dataclass(frozen=True)
class PoolSpec:
    """The bodies that a pool holds.

    nouns: the shapes ("cube", "sphere", "cylinder", "pyramid"). counts: bodies of each noun, for each `Mobility` in
    its order. size: width and height of an object, metres.
    """

    nouns: Sequence[str]
    counts: Sequence[int]
    size: float


class ObjectPool:
    """The object bodies of one PyBullet client.

    A body never changes its mobility. Bullet moves a body whose mobility changes to the end of its lists, and the
    same seed would give other bits than in a fresh world.

    dynamics: factors of the mass and lateral friction of the free bodies that are shown next. bodies: all bodies.
    movable: those that can move. shown: the bodies of the current episode, in the order of its objects. nouns: their
    shapes.

    Args:
        spec: which bodies to make.
        client: PyBullet's client.
        visuals: load visual shapes.
        sleeping: let bodies at rest sleep.
    """

    def __init__(self, spec: PoolSpec, client: int, visuals: bool, sleeping: bool) -> None:
        self._client, self._visuals, self._sleeping = client, visuals, sleeping
        self._spec = spec
        self.nouns: list[str] = []
        self._pool = [
            [[self._make(noun, spec.size, mobility) for _ in range(count)] for noun in spec.nouns]
            for mobility, count in zip(Mobility, spec.counts, strict=True)
        ]
        self.movable = {body for bodies in self._pool[Mobility.FREE] for body in bodies}
        self.dynamics = USUAL
        self._dynamics: dict[int, tuple[float, float]] = {}  # present factors, unless always `USUAL`
        self.bodies = self.shown = [body for pool in self._pool for bodies in pool for body in bodies]
        self._free: list[int] = []
        self._resting_height = spec.size / 2 + RESTING_GAP
        self.pose = partial(bullet.getBasePositionAndOrientation, physicsClientId=client)

    def show(
        self,
        *,
        nouns: Sequence[int],
        mobilities: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
        resting: Sequence[bool] | None = None,
    ) -> None:
        """Place one body of the pool for each object. An object above the table falls; others sleep until touched.

        Args:
            nouns, mobilities: (K,) indices into the pool.
            positions: (K, 3) metres.
            yaw: (K,) radians.
            resting: (K,) which objects rest on others, and sleep although they are above the table; None: none.
        """
        unused = [[list(reversed(bodies)) for bodies in pool] for pool in self._pool]
        self.shown = [unused[mobility][noun].pop() for mobility, noun in zip(mobilities, nouns, strict=True)]
        self.nouns = [self._spec.nouns[noun] for noun in nouns]
        self._free = [body for body, mobility in zip(self.shown, mobilities, strict=True) if mobility == Mobility.FREE]
        rests = [False] * len(self.shown) if resting is None else resting
        for body in self._free:
            self._set_dynamics(body)
        for body, mobility, position, angle, still in zip(self.shown, mobilities, positions, yaw, rests, strict=True):
            self._place(body, position, angle)
            if mobility == Mobility.FREE and position[2] > self._resting_height and not still:
                self._wake(body)

    def wake(self) -> None:
        """Wake the shown bodies that can move. Bullet does not wake a body on a link when the link moves."""
        for body in self._free:
            self._wake(body)

    def park(self) -> None:
        """Move the shown bodies out of the workspace, apart from each other, and let them sleep."""
        for body in self.shown:
            self._place(body, (PARKED[0] + body, PARKED[1], PARKED[2]))

    def poses(self) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
        """(position, quaternion) of each shown body."""
        return [self.pose(body) for body in self.shown]

    def move(self, number: int, position: Sequence[float]) -> None:
        """Move a shown body to position (3,), metres, within an episode. It keeps its orientation, and falls."""
        body = self.shown[number]
        bullet.resetBasePositionAndOrientation(body, position, self.pose(body)[1], self._client)
        bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)
        self._wake(body)

    def put(self, poses: Sequence[tuple[Sequence[float], Sequence[float]]]) -> None:
        """Put each shown body at a position (3,), metres, and a quaternion (4,): where it is seen, without physics."""
        for body, (position, quaternion) in zip(self.shown, poses, strict=True):
            bullet.resetBasePositionAndOrientation(body, position, quaternion, self._client)

    def _make(self, noun: str, size: float, mobility: Mobility) -> int:
        shape_type, sides = _geometry(noun, size)
        shape = visual = -1
        if mobility != Mobility.GHOST:
            shape = bullet.createCollisionShape(shape_type, **sides, physicsClientId=self._client)
        if self._visuals:
            if shape_type == bullet.GEOM_CYLINDER:
                sides = {"radius": sides["radius"], "length": sides["height"]}
            visual = bullet.createVisualShape(shape_type, **sides, physicsClientId=self._client)
        mass = MASS if mobility == Mobility.FREE else 0
        body = bullet.createMultiBody(mass, shape, visual, PARKED, physicsClientId=self._client)
        bullet.changeDynamics(body, -1, **DYNAMICS, physicsClientId=self._client)
        return body

    def _set_dynamics(self, body: int) -> None:
        if self._dynamics.get(body, USUAL) != self.dynamics:
            mass, friction = MASS * self.dynamics[0], DYNAMICS["lateralFriction"] * self.dynamics[1]
            bullet.changeDynamics(body, -1, mass=mass, lateralFriction=friction, physicsClientId=self._client)
            self._dynamics[body] = self.dynamics

    def _place(self, body: int, position: Sequence[float], yaw: float = 0.0) -> None:
        quaternion = (0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
        bullet.resetBasePositionAndOrientation(body, position, quaternion, self._client)
        bullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)
        self._sleep(body)

    def _sleep(self, body: int) -> None:
        state = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
        if not self._sleeping:
            state = bullet.ACTIVATION_STATE_DISABLE_SLEEPING
        bullet.changeDynamics(body, -1, activationState=state, physicsClientId=self._client)

    def _wake(self, body: int) -> None:
        bullet.changeDynamics(body, -1, activationState=bullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=self._client)


def _geometry(noun: str, size: float) -> tuple[int, dict]:
    """PyBullet's shape type and dimensions of an object that is `size` metres wide and high."""
    shapes: dict[str, tuple[int, dict]] = {
        "cube": (bullet.GEOM_BOX, {"halfExtents": [size / 2] * 3}),
        "sphere": (bullet.GEOM_SPHERE, {"radius": size / 2}),
        "cylinder": (bullet.GEOM_CYLINDER, {"radius": size / 2, "height": size}),
    }
    if noun == "pyramid":
        return bullet.GEOM_MESH, {"fileName": str(_pyramid()), "meshScale": [size] * 3}
    return shapes[noun]


def _pyramid() -> Path:
    """Return an OBJ file with a square pyramid, 1 wide and 1 high, about the middle of its height."""
    base = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    sides = [((*base[i], -0.5), (*base[(i + 1) % 4], -0.5), (0.0, 0.0, 0.5)) for i in range(4)]
    floor = [((*base[0], -0.5), (*base[i + 1], -0.5), (*base[i], -0.5)) for i in (1, 2)]
    points = [point for face in (*sides, *floor) for point in face]
    rows = ["v {} {} {}".format(*point) for point in points]
    rows += [f"f {i + 1} {i + 2} {i + 3}" for i in range(0, len(points), 3)]
    return cached_text("pyramid.obj", "\n".join([*rows, ""]))


# ---- all objects of an episode


class ShownObjects:
    """Objects are identified by their number among those that are shown, whatever they are.

    holdable: for each of them, the body or handle that a gripper can hold.

    Args:
        pool, devices, furniture: whose bodies are shown.
        renderer: draws see-through objects; None in a world without visuals.
        client: PyBullet's client.
        palm: the person's open hand, if they hold out one.
    """

    def __init__(
        self,
        *,
        pool: ObjectPool,
        devices: DeviceBodies,
        furniture: Furniture,
        renderer: Renderer | None,
        client: int,
        palm: Palm | None = None,
    ) -> None:
        self._pool, self._devices, self._furniture = pool, devices, furniture
        self._renderer, self._client = renderer, client
        self._palm = palm
        self._fittings: list[str] = []
        self._palms: list[Palm] = []  # one, or none
        self._order: list[int] | None = None  # of objects among loose ones, devices, fittings, palms; None: the same
        self.holdable: list[Holdable] = []

    def show(
        self,
        *,
        nouns: Sequence[int],
        mobilities: Sequence[int],
        positions: Sequence[Sequence[float]],
        yaw: Sequence[float],
        colors: Sequence[Sequence[float]],
        resting: Sequence[bool] | None = None,
        shares: Sequence[float] | None = None,
    ) -> None:
        """Place the objects of the next episode. The arguments are those of `SimulatedWorld.reset`."""
        rests = [False] * len(nouns) if resting is None else resting
        loose, devices, fittings, palms = groups = _grouped(nouns)
        self._devices.show(
            nouns=[NAMES[nouns[k]] for k in devices],
            places=_chosen(devices, positions),
            yaw=_chosen(devices, yaw),
            colors=_chosen(devices, colors),
            shares=None if shares is None else _chosen(devices, shares),
        )
        self._pool.show(
            nouns=_chosen(loose, nouns),
            mobilities=_chosen(loose, mobilities),
            positions=_chosen(loose, positions),
            yaw=_chosen(loose, yaw),
            resting=_chosen(loose, rests),
        )
        self._paint(_chosen(loose, mobilities), _chosen(loose, colors))
        self._fittings = [NAMES[nouns[k]] for k in fittings]
        for name, k in zip(self._fittings, fittings, strict=True):
            self._furniture.show(name, 0.0 if shares is None else shares[k], colors[k])
        self._palms = [self._palm] * len(palms) if self._palm is not None else []
        for palm, k in zip(self._palms, palms, strict=True):
            palm.show(positions[k])
        order = [number for numbers in groups for number in numbers]
        self._order = None if order == sorted(order) else np.argsort(order).tolist()
        self.holdable = self._in_order(self._all_holdable())

    def poses(self) -> list[Pose]:
        """(position, quaternion) of each object; of a device or a fitting, that of its handle."""
        poses = self._pool.poses() + self._devices.poses()
        poses += [self._furniture.handle_pose(name) for name in self._fittings]
        return self._in_order(poses + [palm.pose() for palm in self._palms])

    def _in_order(self, things: list) -> list:
        return things if self._order is None else [things[number] for number in self._order]

    def _paint(self, mobilities: list, colors: list) -> None:
        """Paint the loose objects, where anything is drawn."""
        if self._renderer is None:
            return
        for body, mobility, color in zip(self._pool.shown, mobilities, colors, strict=True):
            paint(body, color, self._client)
            if mobility == Mobility.GHOST:
                self._renderer.set_see_through(body, BASE, color)

    def _all_holdable(self) -> list[Holdable]:
        loose = [Holdable(body, partial(self._pool.pose, body)) for body in self._pool.shown]
        devices = [Holdable(body, partial(self._devices.pose, body), LINK) for body in self._devices.shown]
        handles = [
            Holdable(self._furniture.bodies[name], partial(self._furniture.handle_pose, name), LINK)
            for name in self._fittings
        ]
        return loose + devices + handles + [Holdable(palm.body, palm.pose, LINK) for palm in self._palms]


def _grouped(nouns: Sequence[int]) -> tuple[list[int], list[int], list[int], list[int]]:
    """Return the numbers of the loose objects, the devices, the fittings and the palms.

    nouns: indices; of loose ones, into the pool.
    """
    nouns_of = DEVICES, FITTINGS, (HAND,)
    devices, fittings, palms = ([i for i, noun in enumerate(nouns) if NAMES[noun] in names] for names in nouns_of)
    loose = [i for i in range(len(nouns)) if i not in devices and i not in fittings and i not in palms]
    return loose, devices, fittings, palms


def _chosen(numbers: Sequence[int], values: Sequence) -> list:
    """Return the values with these numbers."""
    return [values[number] for number in numbers]

"""The robot as a body in a PyBullet client of its own: where its shapes are, and which of them touch."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pybullet as bullet
from numpy.typing import NDArray

from core.system import captured_stdout
from envs.sim.robot import bullet_reason
from envs.sim.urdf_file import URDFError, decoded_name

Array = NDArray[np.float64]
FLAGS = bullet.URDF_IGNORE_VISUAL_SHAPES
CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))  # of a box of 1 m
LARGEST = 20.0  # metres of a shape
NEAR = 1e-3  # metres within which Bullet looks for points; with 0 it finds none between boxes
DEEP = 0.004  # metres that hulls of neighbours may be in each other; meshes of arms are not convex


class ImportedBody:
    """A URDF in a client, its links not merged, its base fixed at the origin. Raises URDFError where it does not load.

    Close it after use.
    """

    def __init__(self, path: Path) -> None:
        self._client = bullet.connect(bullet.DIRECT)
        try:
            with captured_stdout() as printed:
                try:
                    self._body = bullet.loadURDF(
                        str(path), useFixedBase=True, flags=FLAGS, physicsClientId=self._client
                    )
                except bullet.error:
                    self._body = -1
            if self._body < 0:
                raise URDFError(f"does not load: {bullet_reason(*printed)}")
        except BaseException:
            self.close()
            raise
        count = bullet.getNumJoints(self._body, self._client)
        info = [bullet.getJointInfo(self._body, j, self._client) for j in range(count)]
        self._joints = {decoded_name(each[1]): number for number, each in enumerate(info)}
        base = decoded_name(bullet.getBodyInfo(self._body, self._client)[0])
        self._links = {base: -1} | {decoded_name(each[12]): number for number, each in enumerate(info)}
        self._parents = {number: each[16] for number, each in enumerate(info)}
        self._moving = {number for number, each in enumerate(info) if each[2] != bullet.JOINT_FIXED}
        with captured_stdout():  # Bullet prints a question mark for each capsule
            self._points = {name: self._shape_points(number) for name, number in self._links.items()}
        try:
            self._check_sizes()
        except URDFError:
            self.close()
            raise

    def close(self) -> None:
        """Free the client. Idempotent."""
        if self._client >= 0:
            bullet.disconnect(self._client)
        self._client = -1

    def _check_sizes(self) -> None:
        """Raise URDFError for a shape that is no part of an arm at a table."""
        for name, points in self._points.items():
            size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
            if not size < LARGEST:
                raise URDFError(
                    f"has link {name} with a shape of {size:.3g} m: URDFs are in metres; a mesh in millimetres needs "
                    'scale="0.001 0.001 0.001"'
                )

    def points(self, links: Iterable[str]) -> Array:
        """(P, 3) corners of the collision shapes of links, all joints at 0, in the frame of the root link."""
        found = [self._points[link] for link in links if link in self._points]
        return np.concatenate(found) if found else np.zeros((0, 3))

    def _shape_points(self, link: int) -> Array:
        """(P, 3) corners of the link's collision shapes, in the client's frame with all joints at 0."""
        place = self._frame(link)
        parts = []
        for index, shape in enumerate(bullet.getCollisionShapeData(self._body, link, self._client)):
            local = _transform(shape[5], shape[6])
            if shape[2] == bullet.GEOM_MESH and index == 0:
                points = np.array(
                    bullet.getMeshData(self._body, link, 0, bullet.MESH_DATA_SIMULATION_MESH, self._client)[1]
                ).reshape(-1, 3)
                parts.append(points @ place[:3, :3].T + place[:3, 3])
            elif shape[2] != bullet.GEOM_MESH:
                points = CORNERS * _size(shape)
                whole = place @ local
                parts.append(points @ whole[:3, :3].T + whole[:3, 3])
        return np.concatenate(parts) if parts else np.zeros((0, 3))

    def _frame(self, link: int) -> Array:
        """(4, 4) the frame of the link's centre of mass."""
        if link < 0:
            return _transform(*bullet.getBasePositionAndOrientation(self._body, self._client))
        state = bullet.getLinkState(self._body, link, computeForwardKinematics=True, physicsClientId=self._client)
        return _transform(state[0], state[1])

    def masses(self) -> dict[str, float]:
        """Return each link's mass, kg, as Bullet has it."""
        return {n: bullet.getDynamicsInfo(self._body, j, self._client)[0] for n, j in self._links.items()}

    def place(self, angles: Mapping[str, float]) -> None:
        """Put joints, given by name, at these values."""
        for name, value in angles.items():
            bullet.resetJointState(self._body, self._joints[name], value, 0.0, self._client)
        bullet.performCollisionDetection(self._client)

    def sunk(self, links: Iterable[str], height: float, edge: float) -> bool:
        """Whether one of these links is below `height` and beyond x = edge, metres, as the joints are now."""
        boxes = [
            bullet.getAABB(self._body, self._links[each], self._client) for each in links if len(self._points[each])
        ]
        return any(low[2] < height - DEEP and high[0] > edge for low, high in boxes)

    def touching(self, moving: Iterable[str]) -> list[tuple[str, str]]:
        """Return the pairs of links that are in each other as the joints are now, but neighbours.

        moving: the links that the arm's joints move; two that none moves are no pair.
        """
        moved, names = set(moving), [name for name in self._links if len(self._points[name])]
        found = []
        for one, other in itertools.combinations(names, 2):
            if (one in moved or other in moved) and not self._near(one, other):
                a, b = self._links[one], self._links[other]
                near = bullet.getClosestPoints(self._body, self._body, NEAR, a, b, physicsClientId=self._client)
                if any(contact[8] < -DEEP for contact in near):
                    found.append((one, other))
        return found

    def _near(self, one: str, other: str) -> bool:
        """Whether at most two moving joints are between the links: hulls of such touch where the meshes do not."""
        above = [set(self._above(self._links[name])) for name in (one, other)]
        return len((above[0] ^ above[1]) & self._moving) <= 2

    def _above(self, link: int) -> list[int]:
        chain = [link]
        while link >= 0:
            link = self._parents[link]
            chain.append(link)
        return chain


def _size(shape: tuple) -> Array:
    """(3,) sides of the box around a primitive shape, metres."""
    kind, (a, b, c) = shape[2], shape[3]
    if kind == bullet.GEOM_BOX:
        return np.array((a, b, c))
    if kind == bullet.GEOM_SPHERE:
        return np.full(3, 2 * a)
    height = a + (2 * b if kind == bullet.GEOM_CAPSULE else 0.0)
    return np.array((2 * b, 2 * b, height))  # a cylinder or a capsule along z


def _transform(position: Iterable[float], quaternion: Iterable[float]) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion(tuple(quaternion)), (3, 3))
    matrix[:3, 3] = tuple(position)
    return matrix

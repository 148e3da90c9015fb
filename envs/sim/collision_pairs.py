"""The pairs of near bodies that Bullet keeps from one physics step to the next."""

from __future__ import annotations

from collections.abc import Collection

import pybullet as bullet

from envs.sim.gripper import BASE

# Bullet's own collision group and mask of what moves, and of what does not.
MOVING_FILTER, FIXED_FILTER = (1, -1), (2, -3)
CLEANED = 3  # steps within which Bullet takes a body at rest to be fixed; only then it looks for parted pairs


class CollisionPairs:
    """The pairs of the bodies that one PyBullet client has when this is made.

    client: PyBullet's client. movable: the bodies whose base moves; links always do.
    """

    def __init__(self, client: int, movable: Collection[int]) -> None:
        self._client = client
        self._filters: list[tuple[int, int, int, int]] = []  # body, link, group and mask, in the order of creation
        for body in range(bullet.getNumBodies(client)):
            for link in range(BASE, bullet.getNumJoints(body, client)):
                if bullet.getCollisionShapeData(body, link, client):
                    moves = link != BASE or body in movable
                    self._filters.append((body, link, *(MOVING_FILTER if moves else FIXED_FILTER)))

    def forget(self) -> None:
        """Drop all pairs, and the margins of the bounding boxes from which they follow; Bullet finds both again.

        Bullet keeps a bounding box that a body has left only slightly, and a pair for some steps after its bodies have
        parted. Both would carry one episode into the next, and the same seed would give other bits than in a fresh
        world. Setting a collision filter, even to its present value, makes the box anew and drops all its pairs.

        How many steps a parted pair is kept follows from Bullet's place in its list of pairs, which it remembers. A
        list of one pair leads it back to the first place: the robot's base and its first link, which always touch.
        """
        for body, link, *_ in self._filters:
            bullet.setCollisionFilterGroupMask(body, link, 0, 0, self._client)
        for each in self._filters[:2]:
            bullet.setCollisionFilterGroupMask(*each, self._client)
        for _ in range(CLEANED):
            bullet.performCollisionDetection(self._client)
        for each in self._filters:
            bullet.setCollisionFilterGroupMask(*each, self._client)

"""The pointing arm: joint angles that point at a target, motions between postures, and the ray of the finger.

Pure NumPy: nothing touches the person, so a simulated body is needed only to draw them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from conf.schema import did_you_mean
from human.config import STYLES
from human.pointing_ik import Array, AttachedPoint, PointingChain

FINGERTIP = "r_index3_endeffector"
LINE_STARTS = dict(zip(STYLES, ("r_index2", "r_hand", "eyes"), strict=True))  # style -> link where its line starts
MIN_DISTANCE = 0.03  # metres from the fingertip; anything nearer is touched, not pointed at


class Unreachable(ValueError):
    """No posture points at the target. The text is the whole message."""


@dataclass(frozen=True)
class ArmModel:
    """Kinematics of an arm.

    chain: the J joints that move in pointing.
    rest: (J,) radians, the posture that pointing starts from.
    points: FINGERTIP and each link of LINE_STARTS, by name.
    other: the joints of the other arm, which holds out an open hand; None if the body has none.
    """

    chain: PointingChain
    rest: Array
    points: dict[str, AttachedPoint]
    other: PointingChain | None = None


class PointingArm:
    """The arm of a person who stands at a fixed place.

    After `move`, call `advance` after every physics step for as long as `moving` is True.

    Attributes:
        low, high: (J,) radians, limits of the joints that move in pointing, ordered from the body outwards.
        rest: (J,) radians, the posture that pointing starts from.
        angles: (J,) radians, the present posture.
        target: (3,) metres in the workspace frame, the last target of `point_at`. Initially it lies on the ray of
            `rest`, on the table or 1 m from the fingertip, whichever is nearer.
        moving: bool, whether a motion is in progress.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model, self.rest = model, model.rest
        self._chain, self._points = model.chain, model.points
        self.low, self.high = model.chain.low, model.chain.high
        self._initial_guesses = [self.rest, *_other_guesses(self.rest, self.low, self.high)]
        self._from = self._to = self.angles = self.rest
        self._duration = self._elapsed = 0  # physics steps of the motion
        self.moving = False
        self.pose(self.rest)
        origin, direction = self.ray()
        self.target = origin + direction * min(1.0, _distance_to_table(origin, direction))

    @property
    def hanging(self) -> Array:
        """(J,) radians, the lowered arm: every joint as near to 0 as its limits allow."""
        return np.clip(0.0, self.low, self.high)

    @property
    def eyes(self) -> Array:
        """(3,) metres, the point between the eyes."""
        return self._places(LINE_STARTS["eye"])[0]

    # ---- Inverse kinematics

    def solve(self, target: ArrayLike, style: str = "finger") -> Array:
        """Returns joint angles (J,) at which the style's line goes through the target.

        The result depends on the target and the style alone; the arm does not move.

        Args:
            target: (3,) metres in the workspace frame.
            style: "finger", "wrist" or "eye".

        Raises:
            Unreachable: no posture points there.
            ValueError: an unknown style, or a target that is not 3 finite numbers.
        """
        return self.aim(target, style)[0]

    def aim(self, target: ArrayLike, style: str = "finger") -> tuple[Array, Array, Array]:
        """Like `solve`; also returns the ray at the solution.

        Returns:
            Joint angles (J,), the ray's origin (3,) in metres and its unit direction (3,).
        """
        goal = np.asarray(target, np.float64)
        if goal.shape != (3,) or not np.isfinite(goal).all():
            raise ValueError(f"target={goal.tolist()} must be 3 finite numbers")
        tip, behind = self._points[FINGERTIP], self._points[line_start(style)]
        for start in self._initial_guesses:
            solution = self._chain.solve(start, goal, tip, behind)
            if solution is not None and math.dist(solution[1][0], goal) >= MIN_DISTANCE:
                joints, ends = solution
                return joints, *ray_through(*ends)
        place = ", ".join(f"{metres:.3f}" for metres in goal)
        raise Unreachable(f"target=({place}) m: the person can't point there (style={style})")

    def ray(self, style: str = "finger") -> tuple[Array, Array]:
        """Returns the style's present ray: the fingertip (3,) in metres and a unit direction (3,)."""
        return ray_through(*self._places(FINGERTIP, line_start(style)))

    def _places(self, *links: str) -> list[Array]:
        """The positions of these links in the present posture, (3,) metres each."""
        frames = self._chain.frames(self.angles)
        return [self._chain.place(self._points[link], frames) for link in links]

    # ---- Motions

    def point_at(self, position: ArrayLike, relative: bool = False, style: str = "finger", frames: int = 0) -> None:
        """Points at a position.

        Args:
            position: (3,) metres in the workspace frame.
            relative: whether `position` is an offset from the last target.
            style: "finger", "wrist" or "eye".
            frames: physics steps that the motion takes; 0: immediate.

        Raises:
            Unreachable: no posture points there. The arm and `target` stay as they are.
        """
        target = np.asarray(position, np.float64) + (self.target if relative else 0.0)
        joints = self.solve(target, style)
        self.target = target
        self.move(joints, frames)

    def relax(self) -> None:
        """Lowers the arm immediately."""
        self.pose(self.hanging)

    def pose(self, joints: ArrayLike) -> None:
        """Sets the joint angles (J,) immediately."""
        self.moving = False
        self._set_angles(np.asarray(joints, np.float64))

    def move(self, joints: ArrayLike, frames: int) -> None:
        """Starts a motion to joint angles (J,) that takes `frames` physics steps; 0: immediate."""
        if frames <= 0:
            self.pose(joints)
            return
        self._from, self._to = self.angles, np.asarray(joints, np.float64)
        self._duration, self._elapsed, self.moving = frames, 0, True

    def advance(self) -> None:
        """Advances a motion by one physics step. The speed rises and falls smoothly (cubic smoothstep)."""
        self._elapsed += 1
        self.moving = self._elapsed < self._duration
        share = self._elapsed / self._duration
        share *= share * (3 - 2 * share)
        self._set_angles(self._from + share * (self._to - self._from) if self.moving else self._to)

    def _set_angles(self, joints: Array) -> None:
        self.angles = joints


def line_start(style: str) -> str:
    """Returns the link where the style's line starts. Raises ValueError for an unknown style."""
    if style not in LINE_STARTS:
        raise ValueError(f"style={style}" + did_you_mean(style, LINE_STARTS))
    return LINE_STARTS[style]


def ray_through(tip: Array, behind: Array) -> tuple[Array, Array]:
    """Returns the ray from the point `behind` (3,) through the tip (3,): the tip and the unit direction."""
    offset = tip - behind
    return tip, offset / math.sqrt(offset @ offset)


def _distance_to_table(origin: Array, direction: Array) -> float:
    """Metres along the ray to the height of the table top; inf if the ray does not meet it."""
    return -origin[2] / direction[2] if origin[2] * direction[2] < 0 else math.inf


def _other_guesses(rest: Array, low: Array, high: Array) -> list[Array]:
    """Initial guesses of the solver for targets where `rest` does not converge, spread from `rest` to the limits.

    The generator is seeded, so that they are the same for every arm.
    """
    generator = np.random.Generator(np.random.PCG64(0))
    shares = np.linspace(0.3, 1.0, 6)[:, None]
    return list(rest + shares * (generator.uniform(low, high, (6, len(rest))) - rest))

"""The arm that points: finds the posture in which its line goes through a place, takes it, and says its ray.

Numbers alone: nothing touches a person, so an arm that nobody looks at needs no body in a simulator.
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
LINE_STARTS = dict(zip(STYLES, ("r_index2", "r_hand", "eyes"), strict=True))  # where each style's line starts
NEAREST = 0.03  # metres from the fingertip: what is nearer is touched, not pointed at


class Unreachable(ValueError):
    """No posture points there. The text is the whole message."""


@dataclass(frozen=True)
class ArmModel:
    """How an arm is made. rest: (J,) radians, the posture that it points from. points: TIP and REARS by their names."""

    chain: PointingChain
    rest: Array
    points: dict[str, AttachedPoint]


class PointingArm:
    """Of a person who stands where they stand.

    low, high, rest, angles: (J,) radians of the joints that move in pointing, from the body on: their limits, the
    posture that they point from, and where they are now. target: (3,) metres in the workspace frame, what `point_at`
    was last given; at first where `rest` points, on the table or 1 m from the fingertip, whichever is nearer.

    After `move` call `stepped` after every physics step for as long as `moving`, a bool.
    """

    def __init__(self, build: ArmModel) -> None:
        self.build, self.rest = build, build.rest
        self._chain, self._points = build.chain, build.points
        self.low, self.high = build.chain.low, build.chain.high
        self._starts = [self.rest, *_other_starts(self.rest, self.low, self.high)]
        self._from = self._to = self.angles = self.rest
        self._frames = self._since = 0
        self.moving = False
        self.pose(self.rest)
        origin, direction = self.ray()
        self.target = origin + direction * min(1.0, _fall(origin, direction))

    @property
    def hanging(self) -> Array:
        """(J,) angles at which the arm hangs: every joint as near to 0 as its limits let it."""
        return np.clip(0.0, self.low, self.high)

    @property
    def eyes(self) -> Array:
        """(3,) metres, between the eyes."""
        return self._places(LINE_STARTS["eye"])[0]

    # ------------------------------------------------------------------------------------------------- where to

    def solve(self, target: ArrayLike, style: str = "finger") -> Array:
        """Joint angles (J,) at which the style's line goes through target (3,), metres in the workspace frame.

        The same for the same target, whatever was asked before; the arm stays as it is. Raises Unreachable.
        """
        return self.aim(target, style)[0]

    def aim(self, target: ArrayLike, style: str = "finger") -> tuple[Array, Array, Array]:
        """As `solve`, and the `ray` of those angles: its origin (3,) and direction (3,), without a posture taken."""
        goal = np.asarray(target, np.float64)
        if goal.shape != (3,) or not np.isfinite(goal).all():
            raise ValueError(f"target={goal.tolist()} must be 3 finite numbers")
        tip, behind = self._points[FINGERTIP], self._points[line_start(style)]
        for start in self._starts:
            aimed = self._chain.aim(start, goal, tip, behind)
            if aimed is not None and math.dist(aimed[1][0], goal) >= NEAREST:
                joints, ends = aimed
                return joints, *ray_through(*ends)
        place = ", ".join(f"{metres:.3f}" for metres in goal)
        raise Unreachable(f"target=({place}) m: the person can't point there (style={style})")

    def ray(self, style: str = "finger") -> tuple[Array, Array]:
        """The fingertip (3,), metres, and the unit direction (3,) of the style's line, as the arm is now."""
        return ray_through(*self._places(FINGERTIP, line_start(style)))

    def _places(self, *links: str) -> list[Array]:
        """(3,) metres each, where these links are now."""
        frames = self._chain.frames(self.angles)
        return [self._chain.place(self._points[link], frames) for link in links]

    # -------------------------------------------------------------------------------------------------- motions

    def point_at(self, position: ArrayLike, relative: bool = False, style: str = "finger", frames: int = 0) -> None:
        """Point at position (3,), metres; relative: counted from the last target. Raises Unreachable, and stays.

        frames: physics steps that the arm takes to get there; 0: at once.
        """
        target = np.asarray(position, np.float64) + (self.target if relative else 0.0)
        joints = self.solve(target, style)
        self.target = target
        self.move(joints, frames)

    def relax(self) -> None:
        """At once let the arm hang."""
        self.pose(self.hanging)

    def pose(self, joints: ArrayLike) -> None:
        """Be at these angles (J,) at once."""
        self.moving = False
        self._take(np.asarray(joints, np.float64))

    def move(self, joints: ArrayLike, frames: int) -> None:
        """Go to these angles (J,) within that many physics steps; 0: at once."""
        if frames <= 0:
            self.pose(joints)
            return
        self._from, self._to = self.angles, np.asarray(joints, np.float64)
        self._frames, self._since, self.moving = frames, 0, True

    def advance(self) -> None:
        """Tells an arm that is `moving` that a physics step has passed: it gathers speed, and slows down."""
        self._since += 1
        self.moving = self._since < self._frames
        share = self._since / self._frames
        share *= share * (3 - 2 * share)
        self._take(self._from + share * (self._to - self._from) if self.moving else self._to)

    def _take(self, joints: Array) -> None:
        self.angles = joints


def line_start(style: str) -> str:
    """The link where the style's line starts. Raises ValueError for an unknown style."""
    if style not in LINE_STARTS:
        raise ValueError(f"style={style}" + did_you_mean(style, LINE_STARTS))
    return LINE_STARTS[style]


def ray_through(tip: Array, behind: Array) -> tuple[Array, Array]:
    """The ray from a point (3,) behind through the tip (3,): the tip, and the unit direction."""
    offset = tip - behind
    return tip, offset / math.sqrt(offset @ offset)


def _fall(origin: Array, direction: Array) -> float:
    """Metres along the ray to the table top's height; inf: it doesn't go down there."""
    return -origin[2] / direction[2] if origin[2] * direction[2] < 0 else math.inf


def _other_starts(rest: Array, low: Array, high: Array) -> list[Array]:
    """Where to try from next when `rest` leads nowhere: always the same, spread between it and the limits."""
    generator = np.random.Generator(np.random.PCG64(0))
    shares = np.linspace(0.3, 1.0, 6)[:, None]
    return list(rest + shares * (generator.uniform(low, high, (6, len(rest))) - rest))

"""The person's arms: the right one points, the left one holds out an open hand.

`PointingChain` solves the inverse kinematics of pointing: joint angles at which the line through two points of a body
meets a target. It needs NumPy alone, so no simulated body has to be moved. Angles are in radians; positions are in
metres in the frame in which the chain was read. `PointingArm` adds styles and motions, `OfferingArm` the palm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import did_you_mean
from human.config import STYLES

Array = NDArray[np.float64]

# ---- Pointing
FINGERTIP = "r_index3_endeffector"
LINE_STARTS = dict(zip(STYLES, ("r_index2", "r_hand", "eyes"), strict=True))  # style -> link where its line starts
MIN_DISTANCE = 0.03  # metres from the fingertip; anything nearer is touched, not pointed at
TOLERANCE = math.radians(0.02)  # largest angle between the line and the target
MAX_ITERATIONS = 15
MAX_TURN = 0.7  # radians that a joint may turn in one iteration; larger steps overshoot
DAMPING = 1e-8
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # cyclic coordinate shifts of a cross product

# ---- Offering
OFFERING_JOINTS = (
    "l_shoulder_flexion",
    "l_shoulder_abduction",
    "l_shoulder_rotation",
    "l_elbow_flexion",
    "l_forearm_pronation",
    "l_wrist_flexion",
    "l_wrist_deviation",
)
OFFERING_REST = np.array([0.9, 0.1, -0.2, 0.8, -1.2, 0.2, 0.0])  # radians: solutions are near this posture
HAND = len(OFFERING_JOINTS) - 1  # the joint that carries the hand
PALM = np.array([0.0, -0.018, -0.055])  # metres in the hand's frame: the middle of the palm's surface
NORMAL = np.array([0.0, -0.1, 0.0])  # metres in the hand's frame, away from the palm
UP = np.array([0.0, 0.0, 0.1])  # metres: the direction of NORMAL if the palm faces up
PALM_TOLERANCE = 2e-3  # metres, of the palm and of the end of its normal
PALM_ITERATIONS = 150
PALM_TURN = 0.3  # radians that a joint may turn in one iteration
PALM_DAMPING = 1e-6
NULLSPACE_GAIN = 0.1  # share of the way to OFFERING_REST that joints turn in an iteration, with the palm in place


class Unreachable(ValueError):
    """No posture points at the target. The text is the whole message."""


@dataclass(frozen=True)
class AttachedPoint:
    """A point (3,) in the child frame of joint number `joint` of the chain; joint -1 is the fixed ground."""

    joint: int
    place: Array


class _PointingError(NamedTuple):
    """The angular error of the line from `rear` through `tip`, seen from the tip.

    sine: (2,) sine of the angle between the line and the direction to the target. Beyond a right angle its norm is
        1; otherwise a target behind the hand would have no error.
    across: (2, 3) unit vectors in which the sine is expressed.
    sight: (3,) unit vector from the tip to the target.
    distance: metres from the tip to the target.
    cosine: of the same angle.
    length: metres from the rear point to the tip.
    """

    sine: Array
    across: Array
    sight: Array
    distance: float
    cosine: float
    length: float

    @classmethod
    def of(cls, ends: Array, target: Array) -> _PointingError:
        """Return the error of a line. ends: (2, 3), the tip and the rear point. target: (3,)."""
        sight, distance = _unit(target - ends[0])
        line, length = _unit(ends[0] - ends[1])
        across, cosine = _orthonormal_pair(line), float(sight @ line)
        sine = across @ sight
        if cosine < 0:
            sine = sine / max(math.sqrt(sine @ sine), 1e-6)
        return cls(sine, across, sight, distance, cosine, length)

    def jacobian(self, ends: Array) -> Array:
        """Return (2, J), the derivative of `sine` by the joint angles; ends: (2, 3, J), those of tip and rear."""
        tip, rear = ends
        from_shift = self.across @ (tip - self.sight[:, None] * (self.sight @ tip)) / self.distance
        from_turn = self.across @ (tip - rear) / self.length
        return -from_shift - from_turn * (self.cosine if self.cosine > 0.1 else 1.0)


class PointingChain:
    """Revolute joints, each carried by an earlier joint or by the ground.

    Attributes:
        parents: for each joint, the index of the joint that carries it; -1: the ground.
        low, high: (J,) joint limits.
    """

    def __init__(self, *, parents: Sequence[int], steps: Array, axes: Array, low: Array, high: Array) -> None:
        """Build the chain of J joints.

        Args:
            parents: for each joint, the index of the joint that carries it; -1: the ground.
            steps: (J, 4, 4) transforms from the parent's child frame to the joint's own frame at angle zero.
            axes: (J, 3) unit vectors in the joint's frame.
            low, high: (J,) joint limits.
        """
        self.parents, self.low, self.high = list(parents), low, high
        self._axes = axes[..., None]
        cross = np.zeros((len(axes), 4, 4))
        cross[:, :3, :3] = np.cross(np.eye(3), axes[:, None])  # matrix of the cross product with the axis
        # Rodrigues' formula: a joint's frame is still + sin * first + (1 - cos) * second.
        self._still, self._first, self._second = steps, steps @ cross, steps @ cross @ cross
        self._carried = np.array([[self._carries(j, k) for j in range(len(axes))] for k in [*range(len(axes)), -1]])

    def _carries(self, joint: int, descendant: int) -> bool:
        while descendant > joint:
            descendant = self.parents[descendant]
        return descendant == joint

    def frames(self, angles: Array) -> Array:
        """Return the joints' child frames, (J, 4, 4), at angles (J,)."""
        sines, versines = np.sin(angles)[:, None, None], (1 - np.cos(angles))[:, None, None]
        frames = self._still + sines * self._first + versines * self._second
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                np.matmul(frames[parent], frames[joint], out=frames[joint])
        return frames

    def place(self, point: AttachedPoint, frames: Array) -> Array:
        """Return the position (3,) of a point, given the child frames (J, 4, 4)."""
        if point.joint < 0:
            return point.place
        return frames[point.joint, :3, :3] @ point.place + frames[point.joint, :3, 3]

    def solve(self, start: Array, target: Array, tip: AttachedPoint, rear: AttachedPoint) -> tuple[Array, Array] | None:
        """Return angles near `start` at which the line from `rear` through `tip` goes on through the target.

        Among the solutions it takes the one with the smallest sum of squared turns from `start`, within the limits.

        Args:
            start: (J,) angles.
            target: (3,) metres.
            tip, rear: the points that define the line.

        Returns:
            Angles (J,) and the positions (2, 3) of tip and rear at these angles; None without convergence.
        """
        angles = start
        for _ in range(MAX_ITERATIONS):
            frames = self.frames(angles)
            ends = np.array([self.place(tip, frames), self.place(rear, frames)])
            error = _PointingError.of(ends, target)
            if error.sine @ error.sine < TOLERANCE**2:
                return angles, ends
            jacobian = error.jacobian(self.point_jacobians(frames, ends, (tip.joint, rear.joint)))
            turn = self._nearest(start, jacobian, jacobian @ angles - error.sine) - angles
            angles = angles + turn * min(1.0, MAX_TURN / max(np.abs(turn).max(), 1e-9))
        return None

    def point_jacobians(self, frames: Array, points: Array, joints: tuple[int, int]) -> Array:
        """Return (2, 3, J), the derivatives of two points (2, 3) that hang on these joints by the joint angles."""
        axes = (frames[:, :3, :3] @ self._axes)[..., 0].T
        arms = points[:, :, None] - frames[:, :3, 3].T
        # np.cross takes three times as long.
        moved = axes.take(NEXT, 0) * arms.take(LAST, 1) - axes.take(LAST, 0) * arms.take(NEXT, 1)
        return moved * self._carried.take(joints, 0)[:, None]

    def _nearest(self, start: Array, jacobian: Array, goal: Array) -> Array:
        """Return the angles nearest to `start`, within the limits, at which jacobian @ angles = goal.

        A joint that would pass its limit is fixed there, and the remaining joints are solved again.
        """
        base, free = start, jacobian
        for _ in range(len(start)):
            (a, b), (_, d) = (free @ free.T).tolist()
            wanted = (goal - jacobian @ base).tolist()
            scale = 1 / ((a + DAMPING) * (d + DAMPING) - b * b)
            x, y = wanted[0] * scale, wanted[1] * scale
            angles = base + ((d + DAMPING) * x - b * y) * free[0] + ((a + DAMPING) * y - b * x) * free[1]
            clipped = np.minimum(np.maximum(angles, self.low), self.high)
            at_limit = clipped != angles
            if not at_limit.any():
                break
            base = np.where(at_limit, clipped, base)
            free = np.where(at_limit, 0.0, free)
        return clipped


def _unit(vector: Array) -> tuple[Array, float]:
    """Return the vector's direction and length; the length is at least 1e-9, so that a zero vector does not divide."""
    length = max(math.sqrt(vector @ vector), 1e-9)
    return vector / length, length


def _orthonormal_pair(line: Array) -> Array:
    """Return two unit vectors (2, 3), orthogonal to the unit vector `line` and to each other.

    Source: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    """
    x, y, z = line.tolist()
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]])


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
        """Return joint angles (J,) at which the style's line goes through the target.

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
        """Return what `solve` does, and the ray at the solution.

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
        """Return the style's present ray: the fingertip (3,) in metres and a unit direction (3,)."""
        return ray_through(*self._places(FINGERTIP, line_start(style)))

    def _places(self, *links: str) -> list[Array]:
        """Return the positions of these links in the present posture, (3,) metres each."""
        frames = self._chain.frames(self.angles)
        return [self._chain.place(self._points[link], frames) for link in links]

    # ---- Motions

    def point_at(self, position: ArrayLike, relative: bool = False, style: str = "finger", frames: int = 0) -> None:
        """Point at a position.

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
        """Lower the arm immediately."""
        self.pose(self.hanging)

    def pose(self, joints: ArrayLike) -> None:
        """Set the joint angles (J,) immediately."""
        self.moving = False
        self._set_angles(np.asarray(joints, np.float64))

    def move(self, joints: ArrayLike, frames: int) -> None:
        """Start a motion to joint angles (J,) that takes `frames` physics steps; 0: immediate."""
        if frames <= 0:
            self.pose(joints)
            return
        self._from, self._to = self.angles, np.asarray(joints, np.float64)
        self._duration, self._elapsed, self.moving = frames, 0, True

    def advance(self) -> None:
        """Advance a motion by one physics step. The speed rises and falls smoothly (cubic smoothstep)."""
        self._elapsed += 1
        self.moving = self._elapsed < self._duration
        share = self._elapsed / self._duration
        share *= share * (3 - 2 * share)
        self._set_angles(self._from + share * (self._to - self._from) if self.moving else self._to)

    def _set_angles(self, joints: Array) -> None:
        self.angles = joints


def line_start(style: str) -> str:
    """Return the link where the style's line starts. Raises ValueError for an unknown style."""
    if style not in LINE_STARTS:
        raise ValueError(f"style={style}" + did_you_mean(style, LINE_STARTS))
    return LINE_STARTS[style]


def ray_through(tip: Array, behind: Array) -> tuple[Array, Array]:
    """Return the ray from the point `behind` (3,) through the tip (3,): the tip and the unit direction."""
    offset = tip - behind
    return tip, offset / math.sqrt(offset @ offset)


def _distance_to_table(origin: Array, direction: Array) -> float:
    """Return metres along the ray to the height of the table top; inf if the ray does not meet it."""
    return -origin[2] / direction[2] if origin[2] * direction[2] < 0 else math.inf


def _other_guesses(rest: Array, low: Array, high: Array) -> list[Array]:
    """Return starts of the solver for targets where `rest` does not converge, spread from `rest` to the limits.

    The generator is seeded, so that they are the same for every arm.
    """
    generator = np.random.Generator(np.random.PCG64(0))
    shares = np.linspace(0.3, 1.0, 6)[:, None]
    return list(rest + shares * (generator.uniform(low, high, (6, len(rest))) - rest))


class OfferingArm:
    """The left arm of a person who stands at a fixed place. chain: its seven joints, OFFERING_JOINTS."""

    def __init__(self, chain: PointingChain) -> None:
        self._chain = chain

    def solve(self, place: ArrayLike) -> Array:
        """Return joint angles (7,) at which the palm's middle is at place (3,), metres, and the palm faces up.

        Of several solutions it takes one near OFFERING_REST. Raises Unreachable.
        """
        goal, angles = np.asarray(place, np.float64), OFFERING_REST
        for _ in range(PALM_ITERATIONS):
            frames = self._chain.frames(angles)
            palm, end = (self._chain.place(AttachedPoint(HAND, point), frames) for point in (PALM, PALM + NORMAL))
            error = np.concatenate((goal - palm, UP - (end - palm)))
            if np.abs(error).max() < PALM_TOLERANCE:
                return angles
            moved, moved_end = self._chain.point_jacobians(frames, np.array([palm, end]), (HAND, HAND))
            jacobian = np.concatenate((moved, moved_end - moved))
            turn = _towards(error, jacobian, NULLSPACE_GAIN * (OFFERING_REST - angles))
            turn *= min(1.0, PALM_TURN / max(np.abs(turn).max(), 1e-9))
            angles = np.clip(angles + turn, self._chain.low, self._chain.high)
        x, y, z = goal.tolist()
        raise Unreachable(f"palm=({x:.3f}, {y:.3f}, {z:.3f}) m: the person cannot hold an open hand there")


def _towards(error: Array, jacobian: Array, wish: Array) -> Array:
    """Return the joint step (J,) that reduces `error` (6,) by damped least squares, and `wish` (J,) in the null space.

    jacobian: (6, J).
    """
    inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + PALM_DAMPING * np.eye(len(error)))
    return np.asarray(inverse @ error + wish - inverse @ (jacobian @ wish))

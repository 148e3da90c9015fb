"""Where an arm stands, and how it rests: found by inverse kinematics over the table.

Candidates are drawn from a generator with a fixed seed, so that the same URDF gives the same robot.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from envs.sim.kinematics import Kinematics
from envs.sim.robot_import.repairs import is_free, limits
from envs.sim.robot_import.tree import SLIDING, URDFArm, URDFTree, unit
from envs.sim.workspace import WorkspaceConfig

Array = NDArray[np.float64]
SIX = 6  # joints that give the gripper any position and rotation
FARTHEST = (0.25, -1.0)  # x of the base, metres
STEPS = (0.05, 0.1)  # metres between bases, the least and the greatest; in between, an eighth of the arm's length
NEAREST = 0.15  # of the arm's length: a base nearer to the middle of the table is in the way
HEIGHTS = (0.0, 0.1, 0.2, 0.4, -0.35, -0.7)  # z of the base, metres: the others where none on the table does
TALL, FLOOR = 0.5, (0.0, -0.35, -0.7)  # metres of the shoulder over the base from which on it may stand on the floor
YAWS = (0.0, math.pi / 2, -math.pi / 2, math.pi)  # radians by which the robot is turned
RESTS = (0.26, 0.2, 0.14, 0.09)  # heights of the gripper at rest, metres
TURNS, STARTS = 8, 12  # rotations about the vertical, and draws of joints for each
FEWER = 3  # draws for each where the arm has few joints, and so few poses
LOWEST = 0.03  # metres over the table at which the arm's joints are at rest
ITERATIONS, FOLLOWING = 45, 40  # of inverse kinematics to a rest pose, and from there to a place
ROUNDS = 3  # times that places are tried, on from their neighbours
REACHED, STRAIGHT = 0.01, 0.985  # metres, and cosine from down, within which a place is reached
TILTED, RESTING = 0.7, 0.9  # least cosines from down over the table, and at rest, for arms that tilt
MARGIN = 0.15  # radians from a limit, or metres, beyond which it does not matter
KEPT = (4, 2)  # rest poses of each base that are looked at; of an arm that tilts, whose kinematics take longer
MOST_BASES = 10  # at each height
TOO_FEW, NONE = 0.4, 0.15  # shares of places below which the robot is turned, and mounted higher or lower
CLEAR = 0.004  # metres over the table at which links are over it
LOW, HIGH = 0.11, 0.25  # metres: heights of a reached box
EDGE = -0.35  # x of the table's edge, metres: links behind it may be lower than the table


@dataclass(frozen=True, kw_only=True)
class JointChain:
    """What an arm's kinematics are made of; see `Kinematics`.

    Attributes:
        free: (J,) which joints turn without limits.
        approach: (3,) where the gripper points, in the tip's frame.
        tilts: whether the gripper may tilt where the arm cannot reach a place pointing down.
    """

    fixed: Array
    axes: Array
    slides: NDArray[np.bool_]
    low: Array
    high: Array
    free: NDArray[np.bool_]
    approach: Array
    tilts: bool

    def kinematics(self, rest: Array, base: Sequence[float], yaw: float) -> Kinematics:
        """Return the arm with its root at base, turned by yaw about the vertical."""
        fixed, root = self.fixed.copy(), np.eye(4)
        root[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        root[:3, 3] = base
        fixed[0] = root @ fixed[0]
        return Kinematics(
            fixed=fixed,
            axes=self.axes,
            low=self.low,
            high=self.high,
            rest=rest,
            slides=self.slides,
            position_first=self.tilts,
        )

    @property
    def shoulder(self) -> Array:
        """(3,) the first joint that turns, in the frame of the root, all joints at 0."""
        frame = np.eye(4)
        for step, slides in zip(self.fixed, self.slides, strict=False):
            frame = frame @ step
            if not slides:
                break
        return frame[:3, 3]

    def down(self, rotation: Array) -> Array:
        """(N,) the cosine between where grippers with rotations (N, 3, 3) point, and down."""
        return -(rotation @ self.approach)[:, 2]

    def margin(self, joints: Array) -> Array:
        """(N,) the least distance of joints (N, J) from a limit, as a share of MARGIN; at most 1."""
        room = np.minimum(joints - self.low, self.high - joints)
        room = np.where(self.free, MARGIN, room)
        return np.clip(room / np.minimum(MARGIN, (self.high - self.low) / 4), 0.0, 1.0).min(1)


class Looks(Protocol):
    """Looks at the robot's shapes with its joints at given values."""

    def touching(self, joints: Array) -> list[str]:
        """Return what of the robot touches what at joints (J,), in words."""

    def sunk(self, joints: Array, height: float, edge: float) -> bool:
        """Whether a link is below `height` and beyond x = edge at joints (J,), metres in the frame of the root."""


@dataclass(frozen=True, kw_only=True)
class Placement:
    """How an arm stands and rests.

    Attributes:
        base: (3,) of the root, metres.
        yaw: radians by which the robot is turned about the vertical.
        rest: (J,) joints.
        share: of the places over the table that it reaches from there.
        touching: what touches at rest, in words.
        score: by which placements are compared.
    """

    base: tuple[float, float, float]
    yaw: float
    rest: Array
    share: float
    touching: tuple[str, ...]
    score: float


def chain_of(tree: URDFTree, arm: URDFArm, tip: str, *, tip_offset: Array, approach: Array) -> JointChain:
    """Return the chain from the root to the gripper centre: tip_offset, metres, in the frame of the tip."""
    frames = tree.frames()
    last, steps = np.eye(4), []
    for joint in arm.joints:
        frame = frames[joint.child]
        steps.append(np.linalg.inv(last) @ frame)
        last = frame
    tool = np.linalg.inv(last) @ frames[tip]
    offset = np.eye(4)
    offset[:3, 3] = tip_offset
    low, high = np.array([limits(joint) for joint in arm.joints]).T
    return JointChain(
        fixed=np.array([*steps, tool @ offset]),
        axes=np.array([unit(joint) for joint in arm.joints]),
        slides=np.array([joint.kind == SLIDING for joint in arm.joints]),
        low=low,
        high=high,
        free=np.array([is_free(joint) for joint in arm.joints]),
        approach=approach,
        tilts=sum(joint.kind != SLIDING for joint in arm.joints) < SIX,
    )


def places(workspace: WorkspaceConfig) -> Array:
    """(P, 3) places that a gripper should reach: where objects are, at two heights, and the whole gripper box."""
    x0, x1, y0, y1 = workspace.object_area
    z0 = workspace.gripper_box[4]
    objects = _grid((x0, x1, y0, y1, z0, z0 + 0.13), (3, 3, 2))
    return np.concatenate((objects, _grid(workspace.gripper_box, (3, 3, 3))))


def place_arm(
    chain: JointChain,
    workspace: WorkspaceConfig,
    looks: Looks,
    *,
    base: Sequence[float] | None = None,
    rest: Sequence[float] | None = None,
) -> Placement | None:
    """Return how the arm stands and rests best; None where its gripper nowhere points down over the table.

    Args:
        chain: of the arm.
        workspace: of the table.
        looks: at the robot's shapes.
        base, rest: as given; None: searched.
    """
    best: Placement | None = None
    if base is not None and rest is not None:
        found = next(iter(_placements(chain, workspace, [tuple(base)], yaw=0.0, rest=rest)))
        return _freed(chain, workspace, found, looks, best=None)
    first = FLOOR if chain.shoulder[2] > TALL else HEIGHTS[:1]
    for heights, yaws, enough in (
        (first, YAWS[:1], 0.0),
        (first, YAWS[1:], TOO_FEW),
        (HEIGHTS[1:], YAWS[:1], NONE),
    ):
        if best is not None and best.share >= enough:
            continue
        bases = _bases(chain, workspace, heights) if base is None else [tuple(base)]
        for yaw in yaws:
            for found in _placements(chain, workspace, bases, yaw=yaw, rest=rest):
                best = _freed(chain, workspace, found, looks, best=best) or best
    return best


def _bases(chain: JointChain, workspace: WorkspaceConfig, heights: Sequence[float]) -> list[tuple[float, ...]]:
    """Return the places of the root from which the arm is long enough for the middle of the table."""
    lengths = np.linalg.norm(chain.fixed[1:, :3, 3], axis=1).sum() + (chain.high - chain.low)[chain.slides].sum()
    step = float(np.clip(round(lengths / 8 / STEPS[0]) * STEPS[0], *STEPS))
    bases = [(round(float(x), 2), 0.0, z) for z in heights for x in np.arange(FARTHEST[0], FARTHEST[1] - 1e-6, -step)]
    shoulder, middle = chain.shoulder, np.array((*_middle(workspace), 0.1))
    away = [float(np.linalg.norm(middle - np.array(base) - shoulder)) for base in bases]
    near = [base for base, each in zip(bases, away, strict=True) if NEAREST * lengths < each < lengths]
    return [base for z in heights for base in [each for each in near if each[2] == z][:MOST_BASES]]


def _freed(
    chain: JointChain, workspace: WorkspaceConfig, found: list[Placement], looks: Looks, *, best: Placement | None
) -> Placement | None:
    """Return the best of the placements with what touches the robot and the table; None if none beats `best`."""
    chosen: Placement | None = None
    for each in sorted(found, key=lambda one: -one.score):
        least = max((one.score for one in (best, chosen) if one is not None), default=-math.inf)
        if each.score <= least:
            break
        arm, wanted = chain.kinematics(each.rest, each.base, each.yaw), places(workspace)
        joints, reached = _followed(chain, arm, wanted)
        sunk = [looks.sunk(angles, -each.base[2], EDGE - each.base[0]) for angles in joints[reached]]
        share = float(reached.sum() - sum(sunk)) / len(wanted)
        words = tuple(looks.touching(each.rest))
        score = each.score - 10 * (each.share - share) - 2.0 * bool(words)
        if score > least:
            chosen = replace(each, touching=words, share=share, score=score)
    return chosen


def _placements(
    chain: JointChain,
    workspace: WorkspaceConfig,
    bases: Sequence[tuple[float, ...]],
    *,
    yaw: float,
    rest: Sequence[float] | None,
) -> Iterator[list[Placement]]:
    """Yield, for each base, the placements that are worth a look."""
    wanted = places(workspace)
    for base, rests in _rests(chain, workspace, bases, yaw=yaw, rest=rest):
        found = []
        for joints, quality in rests:
            arm = chain.kinematics(joints, base, yaw)
            share, margin = _share(chain, arm, wanted)
            beside = 0.1 * abs(base[0]) + 0.3 * abs(base[2]) + 0.2 * bool(yaw)
            score = 10 * share + quality + margin - beside
            place = base[0], base[1], base[2]
            found.append(Placement(base=place, yaw=yaw, rest=joints, share=share, touching=(), score=score))
        yield found


def _rests(
    chain: JointChain,
    workspace: WorkspaceConfig,
    bases: Sequence[tuple[float, ...]],
    *,
    yaw: float,
    rest: Sequence[float] | None,
) -> Iterator[tuple[tuple[float, ...], list[tuple[Array, float]]]]:
    """Yield each base with the rest poses of the arm there, and how good they are, from 0 to 2."""
    if rest is not None:
        yield from ((base, [(np.array(rest, float), 0.0)]) for base in bases)
        return
    middle, left = _middle(workspace), list(bases)
    for height in RESTS:
        if not left:
            return
        targets = np.array([(*middle, height)]) - np.array(left)
        joints, good = _pointing_down(chain, targets, yaw, -np.array(left)[:, 2])
        for base, angles, quality in zip(left, joints, good, strict=True):
            order = [i for i in np.argsort(-quality) if quality[i] > 0]
            if order:
                yield base, [(angles[i], float(quality[i])) for i in _different(angles, order)[: KEPT[chain.tilts]]]
        left = [base for base, quality in zip(left, good, strict=True) if not quality.any()]


def _different(angles: Array, order: Sequence[int]) -> list[int]:
    """Return the numbers of poses that differ from all before them, the best first."""
    kept: list[int] = []
    for i in order:
        if all(np.abs(angles[i] - angles[j]).max() > 0.3 for j in kept):
            kept.append(int(i))
    return kept


def _middle(workspace: WorkspaceConfig) -> tuple[float, float]:
    x0, x1, y0, y1 = workspace.object_area
    return round((x0 + x1) / 2, 3), round((y0 + y1) / 2, 3)


def _pointing_down(chain: JointChain, targets: Array, yaw: float, table: Array) -> tuple[Array, Array]:
    """Return joints (B, S, J) with which the gripper points down at targets (B, 3), and how good they are (B, S).

    A quality of 0 is that of a pose that does not reach the target, pointing down. table: (B,) its height in the
    frame of the root, metres.
    """
    draws = FEWER if chain.tilts else STARTS
    rng, count = np.random.default_rng(0), TURNS * draws
    low, high = np.maximum(chain.low, -math.pi), np.minimum(chain.high, math.pi)
    starts = rng.uniform(low, np.maximum(low, high), (count, len(low)))
    starts[::TURNS] = np.clip(starts[::TURNS] * 0.2, chain.low, chain.high)  # some near 0
    arm = chain.kinematics((low + high) / 2, (0.0, 0.0, 0.0), yaw)
    rotations = np.tile(_down_rotations(chain.approach), (draws, 1, 1))
    joints = np.tile(starts, (len(targets), 1))
    position = np.repeat(targets, count, axis=0)
    rotation = np.tile(rotations, (len(targets), 1, 1))
    for _ in range(ITERATIONS):
        step = arm.step(joints, position, rotation, max_move=0.2)
        joints = np.clip(joints + np.clip(step, -0.5, 0.5), chain.low, chain.high)
    joints = _wrapped(chain, joints)
    pose = arm.forward(joints)
    missed = np.linalg.norm(pose.position - position, axis=1)
    down = chain.down(pose.rotation)
    good = (missed < REACHED) & (down > (RESTING if chain.tilts else STRAIGHT))
    elbows, lowest, height = _elbows(arm, joints, np.repeat(table, count))
    good &= lowest > LOWEST
    quality = np.where(good, 1.01 + chain.margin(joints) + _roundness(arm, joints) - elbows + height + down, 0.0)
    return joints.reshape(len(targets), count, -1), quality.reshape(len(targets), count)


def _wrapped(chain: JointChain, joints: Array) -> Array:
    """Return joints (N, J) with those that turn freely between half a turn each way."""
    return np.where(chain.free, (joints + math.pi) % (2 * math.pi) - math.pi, joints)


def _elbows(arm: Kinematics, joints: Array, table: Array) -> tuple[Array, Array, Array]:
    """Return how far an arm's joints are from the vertical plane of shoulder and gripper, and how high over the table.

    All (N,) for joints (N, J): the first as a share of the arm's extent, at most 2; the least height, metres; and the
    mean height as a share of the extent, at most 1.
    """
    frames = arm.frames(joints)[:, :, :3, 3]  # (J + 1, N, 3)
    ways = frames[-1] - frames[0]
    side = np.stack((-ways[:, 1], ways[:, 0]), axis=1) / np.maximum(np.linalg.norm(ways[:, :2], axis=1), 1e-3)[:, None]
    beside = np.abs(((frames[:, :, :2] - frames[0, :, :2]) * side).sum(2)).mean(0)
    extent = np.linalg.norm(np.ptp(frames, axis=0), axis=1)
    extent = np.maximum(extent, 1e-3)
    heights = frames[1:-1, :, 2] - table
    return np.minimum(4 * beside / extent, 2.0), heights.min(0), np.clip(heights.mean(0) / extent, 0.0, 1.0)


def _roundness(arm: Kinematics, joints: Array) -> Array:
    """(N,) from 0 to 1: how evenly the gripper moves in all directions, the ratio of the least to the greatest."""
    linear = arm.jacobian(joints)[1][:, :3]
    values = np.linalg.svd(linear, compute_uv=False)
    return values[:, -1] / np.maximum(values[:, 0], 1e-9)


def _down_rotations(approach: Array) -> Array:
    """(TURNS, 3, 3) rotations with which `approach` (3,) points down, turned about the vertical."""
    helper = np.eye(3)[int(np.argmin(np.abs(approach)))]
    side = np.cross(approach, helper)
    side /= np.linalg.norm(side)
    own = np.stack((side, np.cross(approach, side), approach), axis=1)  # the gripper's frame in the tip's
    found = []
    for angle in np.arange(TURNS) * 2 * math.pi / TURNS:
        x = np.array([math.cos(angle), math.sin(angle), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        found.append(np.stack((x, np.cross(down, x), down), axis=1) @ own.T)
    return np.array(found)


def _share(chain: JointChain, arm: Kinematics, wanted: Array) -> tuple[float, float]:
    """Return the share of places (P, 3) that the arm gets to from rest, and how far from limits it is there, 0 to 1."""
    joints, reached = _followed(chain, arm, wanted, rounds=1)
    margin = chain.margin(joints[reached]).mean() if reached.any() else 0.0
    return float(reached.mean()), float(margin)


def _followed(
    chain: JointChain, arm: Kinematics, wanted: Array, rounds: int = ROUNDS
) -> tuple[Array, NDArray[np.bool_]]:
    """Return joints (P, J) to which inverse kinematics leads from rest, and whether the places (P, 3) are reached."""
    joints = np.tile(arm.rest, (len(wanted), 1))
    reached = np.zeros(len(wanted), bool)
    for _ in range(rounds):
        left = ~reached
        if reached.any():  # on from where the nearest place was reached
            away = np.linalg.norm(wanted[left, None] - wanted[None, reached], axis=2)
            joints[left] = joints[reached][away.argmin(1)]
        joints[left], reached[left] = _led(chain, arm, joints[left], wanted[left])
        if reached.all() or not reached.any():
            break
    return joints, reached


def _led(chain: JointChain, arm: Kinematics, joints: Array, wanted: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return joints (P, J) to which inverse kinematics leads from `joints`, and whether the places are reached."""
    rotation = arm.forward(arm.rest[None]).rotation[0]
    for _ in range(FOLLOWING):
        step = arm.step(joints, wanted, rotation, max_move=0.05)
        joints = np.clip(joints + step, chain.low, chain.high)
    pose = arm.forward(joints)
    least = TILTED if chain.tilts else STRAIGHT
    near = np.linalg.norm(pose.position - wanted, axis=1) < REACHED
    return joints, near & (chain.down(pose.rotation) > least)


# ---- the box that is reached


def reach_of(
    chain: JointChain, arm: Kinematics, boxes: Sequence[Sequence[float]], table: Sequence[float]
) -> list[float]:
    """Return the box that the gripper reaches, or [] where it reaches all of every workspace's box.

    Args:
        chain: of the arm.
        arm: at its base, with its rest pose.
        boxes: gripper_box of each workspace, metres: x0, x1, y0, y1, z0, z1.
        table: that of the table, in which the box is searched.
    """
    whole = np.concatenate([_grid(box, (4, 5, 4)) for box in boxes])
    if _followed(chain, arm, np.unique(whole, axis=0))[1].all():
        return []
    outer = np.array(boxes)
    box = [*outer.min(0)[[0]], *outer.max(0)[[1]], *outer.min(0)[[2]], *outer.max(0)[[3]], 0.0, table[5]]
    counts = (9, 15, 8)
    lines = [np.linspace(box[2 * i], box[2 * i + 1], count) for i, count in enumerate(counts)]
    lines[2][0] = 0.02
    grid = np.array(list(itertools.product(*lines)))
    reached = _followed(chain, arm, grid)[1].reshape(counts)
    low, high = _largest_full_box(reached, lines)
    found = [value for i in range(3) for value in (lines[i][low[i]], lines[i][high[i]])]
    found[4] = 0.0
    return [round(float(value), 2) for value in found]


def _largest_full_box(reached: NDArray[np.bool_], lines: Sequence[Array]) -> tuple[list[int], list[int]]:
    """Return the first and last number along each axis of the best box of which all is reached, from the lowest on.

    Its area counts, and its height up to `HIGH`; one that is lower than `LOW` is of little use over objects.
    """
    counts = reached.shape
    missing = np.zeros(tuple(size + 1 for size in counts), int)
    missing[1:, 1:, 1:] = np.cumsum(np.cumsum(np.cumsum(~reached, 0), 1), 2)
    best, found = -1.0, ([0, counts[1] // 2, 0], [0, counts[1] // 2, 0])
    for x0, x1 in itertools.combinations(range(counts[0]), 2):
        for y0, y1 in itertools.combinations(range(counts[1]), 2):
            column = missing[x1 + 1, y1 + 1] - missing[x0, y1 + 1] - missing[x1 + 1, y0] + missing[x0, y0]
            layers = int(np.searchsorted(column, 1)) - 1  # from the lowest on without a missing place
            if layers > 0:
                top = float(lines[2][layers - 1])
                area = (lines[0][x1] - lines[0][x0]) * (lines[1][y1] - lines[1][y0])
                value = float(area) * min(top, HIGH) * (1.0 if top > LOW else 0.05)
                if value > best:
                    best, found = value, ([x0, y0, 0], [x1, y1, layers - 1])
    return found


def _grid(box: Sequence[float], counts: tuple[int, int, int]) -> Array:
    """(P, 3) places on a grid over a box x0, x1, y0, y1, z0, z1."""
    lines = [np.linspace(box[2 * i], box[2 * i + 1], count) for i, count in enumerate(counts)]
    return np.array(list(itertools.product(*lines)))

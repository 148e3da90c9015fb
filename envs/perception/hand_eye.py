"""Calibration of a camera from poses of the robot's gripper.

A fixed camera looks at a marker that the gripper carries; a camera on the gripper looks at a board that lies still.
Both are one problem: a printed point p is seen at camera <- A <- B <- C <- p, where the robot knows B of each pose, and
A (the camera's pose) and C (where the print is) are to be found. OpenCV's hand-eye calibration gives a first guess,
which a robust fit to all corners in all pictures refines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from envs.perception.calibration import (
    Calibrated,
    CalibrationError,
    check_certain,
    check_rms,
    markers,
    uncertainty,
    widest_edge,
)
from envs.perception.camera_files import Lens, Picture
from envs.perception.edges import edge_width, quad_corners
from envs.perception.printed_board import GRIPPER_MARKER, opencv
from envs.perception.robust_fit import (
    ITERATIONS,
    RobustFit,
    angle_of,
    applied,
    fit,
    inverse,
    mean_rotation,
    rotation_vector,
    transform,
)

Array = NDArray[np.float64]
ROUGH = 5  # iterations, to compare first guesses
POSES = 12  # that a person is asked for
FEWEST = 8  # in which the print is seen and that fit
SPREAD = 0.02  # metres, the standard deviation of the gripper's positions along each axis
TURNED = 12.0  # degrees by which some poses must differ, about two axes
ODD = 4.0  # residual of a pose over the median of all, beyond which it is left out
SMALLEST_ODD = 0.7, 1 / 640  # pixels, or as a share of a picture's width: below, no pose is left out


@dataclass(frozen=True)
class PoseSeen:
    """A picture of a print in one pose of the gripper.

    gripper: (4, 4) from the gripper's frame into the workspace. pixels: (N, 2). points: (N, 3) in the print's frame.
    """

    name: str
    gripper: Array
    pixels: Array
    points: Array


def marker_points(side: float) -> Array:
    """Return the corners (4, 3) of a marker around its middle: x right, y down; metres."""
    return side / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


def find_marker(picture: Picture) -> Array | None:
    """Return the corners (4, 2) of the gripper's marker, pixels; None where it is not seen once and sharply."""
    gray: Picture = opencv().cvtColor(picture, opencv().COLOR_RGB2GRAY)
    quads = [quad for quad, number in markers(gray) if number == GRIPPER_MARKER]
    if len(quads) != 1:
        return None
    corners = quad_corners(gray, quads[0])
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    return corners if edge_width(gray, sides) <= widest_edge(gray) else None


def from_gripper(seen: Sequence[PoseSeen], asked: int, lens: Lens, offset: Array | None = None) -> Calibrated:
    """Return the pose of a fixed camera from pictures of the gripper, which carries a marker.

    Args:
        seen: the pictures in which the marker is seen.
        asked: how many pictures there were.
        lens: of the camera.
        offset: (3,) the marker's middle in the gripper's frame, metres; None: to be found, which needs turned poses.

    Raises:
        CalibrationError: with the reason.
    """
    _check_count(len(seen), asked, "the marker")
    _check_spread([each.gripper[:3, 3] for each in seen])
    if offset is None:
        _check_turned([each.gripper[:3, :3] for each in seen], "or measure where the marker is, offset=[x,y,z]")
    return _calibrated(seen, [each.gripper for each in seen], lens, offset=offset, fixed=True)


def from_wrist(seen: Sequence[PoseSeen], asked: int, lens: Lens) -> Calibrated:
    """Return the pose of a camera on the gripper, in its frame, from pictures of a board that lies still.

    Arguments and errors are as for `from_gripper`.
    """
    _check_count(len(seen), asked, "the board")
    _check_turned([each.gripper[:3, :3] for each in seen], "so that the camera looks at the board from several sides")
    return _calibrated(seen, [inverse(each.gripper) for each in seen], lens, offset=None, fixed=False)


# ---- the fit


def _calibrated(
    seen: Sequence[PoseSeen], moves: Sequence[Array], lens: Lens, *, offset: Array | None, fixed: bool
) -> Calibrated:
    """Return the fit of A and C to all poses that fit. fixed: whether the camera is, and the print moves."""
    start = _guess(seen, moves, lens, offset=offset, fixed=fixed)
    found = _fit(seen, moves, lens, start=start, offset=offset)
    rms = _each_rms(seen, found)
    odd = max(ODD * float(np.median(rms)), SMALLEST_ODD[0], SMALLEST_ODD[1] * lens.width)
    kept = [index for index, value in enumerate(rms) if value <= odd]
    left_out = tuple(seen[index].name for index in range(len(seen)) if index not in kept)
    if len(kept) < FEWEST:
        raise CalibrationError(
            f"only {len(kept)} of {len(seen)} poses fit one camera, and {FEWEST} are needed ({left_out[0]} does not): "
            "are the poses those of the pictures, was marker= measured, and does the print sit fast?"
        )
    if left_out:
        seen, moves = [seen[i] for i in kept], [moves[i] for i in kept]
        found = _fit(seen, moves, lens, start=found.transforms, offset=offset)
    most = check_rms(found.rms, lens)
    if most is not None:
        raise CalibrationError(
            f"the corners are {found.rms:.2f} pixels from where they should be, and at most {most:.2f} are accepted: "
            "are the poses those of the pictures, was the marker or board measured, and is this the camera's lens?"
        )
    covariance = _inflation(seen, found, 12 if offset is None else 9) * found.covariance
    place, direction = uncertainty(covariance[:6, :6], found.transforms[0])
    check_certain(place, direction, "spread the poses farther, turn the gripper more, or use a larger marker")
    points = sum(len(each.pixels) for each in seen)
    return Calibrated(
        to_camera=found.transforms[0],
        rms=found.rms,
        pictures=len(seen),
        points=points,
        place=place,
        direction=direction,
        left_out=left_out,
    )


def _fit(
    seen: Sequence[PoseSeen],
    moves: Sequence[Array],
    lens: Lens,
    *,
    start: Sequence[Array],
    offset: Array | None,
    iterations: int = ITERATIONS,
) -> RobustFit:
    free = [True] * 12 if offset is None else [True] * 9 + [False] * 3

    def offsets(found: Sequence[Array]) -> Array:
        whole = [found[0] @ move @ found[1] for move in moves]
        placed = np.concatenate([applied(each, one.points) for each, one in zip(whole, seen, strict=True)])
        return lens.project(placed) - pixels

    pixels = np.concatenate([each.pixels for each in seen])
    return fit(offsets, start, free, iterations)


def _each_rms(seen: Sequence[PoseSeen], found: RobustFit) -> list[float]:
    parts = np.split(found.errors, np.cumsum([len(each.pixels) for each in seen])[:-1])
    return [float(np.sqrt((part**2).mean())) for part in parts]


def _inflation(seen: Sequence[PoseSeen], found: RobustFit, parameters: int) -> float:
    """Return the factor on the covariance where the points of a picture are off together, as by a wrong joint angle.

    The fit takes each point for a measurement of its own. If all of a picture are off alike they are one.
    """
    parts = np.split(found.offsets, np.cumsum([len(each.pixels) for each in seen])[:-1])
    together = sum(len(part) * float((part.mean(0) ** 2).sum()) for part in parts)
    each = len(found.offsets) / len(parts)
    alike = float(np.clip(each * together / max(float((found.offsets**2).sum()), 1e-12), 1.0, each))
    numbers = 2 * len(found.offsets)
    return alike * (numbers - parameters) / numbers / max(1 - parameters * alike / numbers, 0.1)


def _guess(
    seen: Sequence[PoseSeen], moves: Sequence[Array], lens: Lens, *, offset: Array | None, fixed: bool
) -> tuple[Array, Array]:
    """Return the best first guess of A and C: the one with the smallest median error in pixels."""
    cameras = [_pose(each, lens) for each in seen]
    guesses = [] if offset is not None else _hand_eye(moves, cameras)
    if fixed:
        guesses += _from_positions(seen, moves, lens, offset)
    pairs = []
    for to_camera in guesses:
        prints = [inverse(to_camera @ move) @ camera for move, camera in zip(moves, cameras, strict=True)]
        place = np.median([each[:3, 3] for each in prints], axis=0) if offset is None else offset
        turns = np.array([each[:3, :3] for each in prints])
        angles = [np.median([angle_of(one.T @ other) for other in turns]) for one in turns]
        near = [turn for turn in turns if angle_of(turns[int(np.argmin(angles))].T @ turn) < 0.5]
        pair = (to_camera, transform(mean_rotation(np.array(near)), place))
        pairs.append(
            (float(np.median(_fit(seen, moves, lens, start=pair, offset=offset, iterations=ROUGH).errors)), pair)
        )
    pairs = [each for each in pairs if np.isfinite(each[0])]
    if not pairs:
        raise CalibrationError("no camera pose fits the pictures: are the poses those of the pictures?")
    return min(pairs, key=lambda each: each[0])[1]


def _pose(seen: PoseSeen, lens: Lens) -> Array:
    """Return the transform (4, 4) from a flat print into the camera's frame, by its corners in one picture."""
    cv2 = opencv()
    flat, distortion = (seen.pixels - 0.5)[:, None], np.array(lens.distortion)
    _, turns, moves, _ = cv2.solvePnPGeneric(seen.points, flat, lens.matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    return transform(np.ravel(turns[0]), np.ravel(moves[0]))


def _hand_eye(moves: Sequence[Array], cameras: Sequence[Array]) -> list[Array]:
    """Return OpenCV's hand-eye calibrations by each of its methods, as A."""
    cv2 = opencv()
    backs = [inverse(move) for move in moves]
    parts = [[each[:3, :3] for each in backs], [each[:3, 3] for each in backs]]
    parts += [[each[:3, :3] for each in cameras], [each[:3, 3] for each in cameras]]
    found = []
    for method in (cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_TSAI, cv2.CALIB_HAND_EYE_DANIILIDIS):
        try:
            turn, move = cv2.calibrateHandEye(*parts, method=method)
        except cv2.error:
            continue
        if np.isfinite(turn).all() and np.isfinite(move).all() and abs(np.linalg.det(turn) - 1) < 1e-3:
            found.append(inverse(transform(turn, np.ravel(move))))
    return found


def _from_positions(seen: Sequence[PoseSeen], moves: Sequence[Array], lens: Lens, offset: Array | None) -> list[Array]:
    """Return the camera's pose as if the marker's middle were at the offset, or in the gripper's centre."""
    cv2 = opencv()
    middle = np.zeros(3) if offset is None else offset
    points = np.array([applied(move, middle[None])[0] for move in moves])
    pixels = np.array([each.pixels.mean(0) for each in seen]) - 0.5
    found, turn, move, _ = cv2.solvePnPRansac(
        points,
        pixels[:, None],
        lens.matrix,
        np.array(lens.distortion),
        flags=cv2.SOLVEPNP_SQPNP,
        reprojectionError=0.1 * lens.width,
        iterationsCount=200,
    )
    return [transform(np.ravel(turn), np.ravel(move))] if found else []


# ---- checks


def _check_count(count: int, asked: int, what: str) -> None:
    if count < FEWEST:
        raise CalibrationError(
            f"{what} is seen in {count} of {asked} pictures, and {FEWEST} are needed: take {POSES} poses in which it "
            "faces the camera, sharp and in full"
        )


def _check_spread(positions: Sequence[Array]) -> None:
    """Raise CalibrationError for positions in one plane, or in one line."""
    centred = np.array(positions) - np.mean(positions, axis=0)
    spread = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(positions))
    if spread[2] < SPREAD:
        kind = "line" if spread[1] < SPREAD else "plane"
        off = spread[1] if kind == "line" else spread[2]
        raise CalibrationError(
            f"the gripper's positions lie all in one {kind}, within {1000 * off:.0f} mm (standard deviation; "
            f"{1000 * SPREAD:.0f} are needed): take some nearer and some farther, lower and higher"
        )


def _check_turned(rotations: Sequence[Array], advice: str) -> None:
    """Raise CalibrationError for poses that are turned about fewer than two axes."""
    turns = np.array([rotation_vector(one.T @ other) for one, other in combinations(rotations, 2)])
    most = np.degrees(np.linalg.norm(turns, axis=1).max())
    _, _, axes = np.linalg.svd(turns)
    second = np.degrees(np.abs(turns @ axes[1]).max())
    if second < TURNED:
        what = "not turned" if most < TURNED else "turned about one axis alone"
        raise CalibrationError(
            f"the gripper is {what} between the poses ({most:.0f} degrees, and {second:.0f} about a second axis; "
            f"{TURNED:.0f} are needed): tilt it to several sides, {advice}"
        )

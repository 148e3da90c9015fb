"""Calibration of a fixed camera from pictures of a printed board, and of a lens from such pictures.

The board lies at a known place on the table. Its corners, found by OpenCV, give the camera's pose: the one from which
they would be seen where they are seen. What cannot be trusted is refused with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.cameras import Camera, CameraFrame, camera_at
from core.errors import ConfigError
from envs.perception.camera_files import Lens, Picture
from envs.perception.edges import bilinear, edge_width
from envs.perception.printed_board import COLUMNS, ROWS, PrintedBoard, dictionary, opencv
from envs.perception.robust_fit import RobustFit, applied, fit, inverse, transform

Array = NDArray[np.float64]
FEWEST = 12  # corners of a board
FLATTEST = 20.0  # degrees between the line of sight and the board
LENS_PICTURES = 8
LENS_SPREAD = 12.0  # degrees between the boards of a lens's pictures: the largest angle must be at least this
LENS_UNCERTAIN = 0.01  # share of the focal length
WIDEST_EDGE = 4.0, 1 / 160  # pixels, or as a share of a picture's width: what is wider is blurred
WORST_RMS = 1.0, 1 / 640  # pixels, or as a share of a picture's width
UNCERTAIN = 0.005, 0.5  # metres and degrees, 95 %
MOVED = 1 / 1600  # of a picture's width, by which corners may be off where a board is still
NINETY_FIVE = 2.8  # standard deviations of the longest axis, within which a point of three dimensions is
NEAR_PLANE_FIT = 3.0  # pixels
WINDOW, DIAGONAL = (
    0.12,
    0.1,
)  # of a square's side: half of a corner's window; where the squares at a corner are compared
CONTRAST = 10  # gray levels
SMALL = 1000  # pixels of width, up to which markers are looked for in a picture of twice the size


class CalibrationError(ConfigError):
    """A calibration that cannot be trusted. The text is one sentence with the reason."""


@dataclass(frozen=True)
class BoardSeen:
    """The corners of a board in a picture: pixels (N, 2), and (N, 2) in the board's frame, metres."""

    name: str
    pixels: Array
    corners: Array


@dataclass(frozen=True, kw_only=True)
class Calibrated:
    """A camera's pose and how well it is known.

    to_camera: (4, 4) from the frame in which the camera is mounted. rms: pixels. pictures: that were used. points: that
    were seen. place, direction: the uncertainty, 95 %, metres and degrees. left_out: pictures that do not fit.
    """

    to_camera: Array
    rms: float
    pictures: int
    points: int
    place: float
    direction: float
    left_out: tuple[str, ...] = ()

    def camera(self, lens: Lens, mount: str = "workspace") -> Camera:
        """Return the ideal camera in this pose."""
        axes, place = self.to_camera[:3, :3], inverse(self.to_camera)[:3, 3]
        like = Camera(
            target=[0.0, 0.0, 0.0],
            distance=1.0,
            yaw=0.0,
            pitch=0.0,
            fov=lens.fov,
            width=lens.width,
            height=lens.height,
            mount=mount,
        )
        # A fixed camera's target is where it looks at the table's plane, that of one on a gripper is near it.
        distance = 0.2 if mount == "gripper" else float(-place[2] / axes[2, 2]) if axes[2, 2] < -0.1 else 1.0
        return camera_at(CameraFrame(place, axes), like, min(max(distance, 0.1), 20.0))

    def summary(self, source: str) -> dict[str, Any]:
        """Return what a camera file says of its calibration."""
        return {
            "source": source,
            "pictures": self.pictures,
            "points": self.points,
            "residual": round(self.rms, 3),
            "place_95": round(self.place, 5),
            "direction_95": round(self.direction, 3),
        }


# ---- boards in pictures


def find_board(picture: Picture, board: PrintedBoard, name: str) -> BoardSeen:
    """Find a board's corners in a picture. Raises CalibrationError. name: of the picture, for messages."""
    cv2 = opencv()
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    pixels, numbers = _detect(gray, board)
    total = (COLUMNS - 1) * (ROWS - 1)
    if len(pixels) < FEWEST:
        edges = ""
        if len(pixels) >= 2:
            edges = _blur_reason(gray, pixels, board.corners[numbers], board.square)
        raise CalibrationError(
            f"{name}: {len(pixels)} of the board's {total} corners are seen, and {FEWEST} are needed"
            + (edges or ": bring it nearer, light it evenly, and cover none of it")
        )
    seen = BoardSeen(name, pixels, board.corners[numbers])
    reason = _blur_reason(gray, pixels, seen.corners, board.square)
    if reason:
        raise CalibrationError(f"{name}{reason}")
    return seen


def _detect(gray: Picture, board: PrintedBoard) -> tuple[Array, NDArray[np.int64]]:
    """Return pixels (N, 2) and numbers (N,) of the board's corners in a gray picture.

    Markers that are read say where all corners must be, also those between markers that are too small or too dark to be
    read; each is then found in a small window, so that the markers' own edges stay out of it.
    """
    cv2, nothing = opencv(), (np.zeros((0, 2)), np.zeros(0, np.int64))
    places, seen, count = _marker_corners(gray, board)
    if count < 2:
        return nothing
    plane, _ = cv2.findHomography(places, seen, cv2.RANSAC, NEAR_PLANE_FIT)
    if plane is None:
        return nothing
    guess = np.reshape(cv2.perspectiveTransform(board.corners[:, None], plane), (-1, 2))
    shortest = min(np.linalg.norm(guess[1] - guess[0]), np.linalg.norm(guess[COLUMNS - 1] - guess[0]))
    reach = max(2, round(WINDOW * float(shortest)))
    inside = ((guess > reach + 2) & (guess < np.array(gray.shape[::-1]) - reach - 2)).all(1)
    numbers = np.flatnonzero(inside)
    if not len(numbers):
        return nothing
    start = (guess[numbers] - 0.5).astype(np.float32).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(gray, start, (reach, reach), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2).astype(float) + 0.5
    kept = np.linalg.norm(found - guess[numbers], axis=1) < max(1.5, 0.08 * shortest)
    kept &= [_is_saddle(gray, place, axes) for place, axes in zip(found, _axes(guess, numbers), strict=True)]
    return found[kept], numbers[kept]


def _marker_corners(gray: Picture, board: PrintedBoard) -> tuple[Array, Array, int]:
    """Return corners (N, 2) of the board's markers, metres and pixels, and how many markers are read."""
    known = board.charuco.getObjPoints()
    pairs = [(quad, number) for quad, number in markers(gray) if number < len(known)]
    if not pairs:
        return np.zeros((0, 2)), np.zeros((0, 2)), 0
    places = np.concatenate([np.asarray(known[number], float)[:, :2] for _, number in pairs])
    return places, np.concatenate([quad for quad, _ in pairs]), len(pairs)


def markers(gray: Picture) -> list[tuple[Array, int]]:
    """Return the corners (4, 2), pixels, and the number of each marker in a gray picture."""
    cv2 = opencv()
    scale = 2 if gray.shape[1] <= SMALL else 1
    large = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC) if scale > 1 else gray
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    quads, numbers, _ = cv2.aruco.ArucoDetector(dictionary(), parameters).detectMarkers(large)
    named = zip(quads, np.ravel(numbers) if numbers is not None else (), strict=True)
    return [((np.reshape(quad, (4, 2)).astype(np.float64) + 0.5) / scale, int(number)) for quad, number in named]


def _axes(guess: Array, numbers: NDArray[np.intp]) -> list[Array]:
    """Return for each corner the pixels (2, 2) that lead from it a square to the right and a square down."""
    grid = guess.reshape(ROWS - 1, COLUMNS - 1, 2)
    right, down = (np.reshape(np.gradient(grid, axis=axis), (-1, 2)) for axis in (1, 0))
    return [np.stack((right[number], down[number])) for number in numbers]


def _is_saddle(gray: Picture, place: Array, axes: Array) -> bool:
    """Whether two squares that meet at a pixel diagonally are darker than the other two."""
    corners = np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]]) * DIAGONAL
    values = bilinear(gray, place - 0.5 + corners @ axes)
    return abs(values[:2].mean() - values[2:].mean()) > 2 * max(np.ptp(values[:2]), np.ptp(values[2:]), CONTRAST)


def _blur_reason(gray: Picture, pixels: Array, corners: Array, square: float) -> str:
    """Return why a picture is blurred, as the end of a sentence that names it; "" for a sharp one."""
    widths = [edge_width(gray, _edges(pixels, corners, square, axis)) for axis in (0, 1)]
    most = widest_edge(gray)
    if max(widths) <= most:
        return ""
    kind = "moved while it was taken" if max(widths) > 1.7 * min(widths) else "is out of focus"
    return f" {kind}: its edges are {max(widths):.1f} pixels wide, and at most {most:.1f} are accepted; take it again"


def widest_edge(gray: Picture) -> float:
    """Return over how many pixels an edge in a sharp picture may go from black to white."""
    return max(WIDEST_EDGE[0], WIDEST_EDGE[1] * gray.shape[1])


def _edges(pixels: Array, corners: Array, square: float, axis: int) -> list[tuple[Array, Array]]:
    """Return the pairs of pixels that are the ends of a square's sides along an axis of the board."""
    places = {tuple(np.rint(corner / square).astype(int)): pixel for corner, pixel in zip(corners, pixels, strict=True)}
    step = (1, 0) if axis == 0 else (0, 1)
    found = ((pixel, places.get((x + step[0], y + step[1]))) for (x, y), pixel in places.items())
    return [(pixel, other) for pixel, other in found if other is not None]


# ---- poses


def from_table(seen: Sequence[BoardSeen], points: Sequence[Array], lens: Lens) -> Calibrated:
    """Return the pose of a fixed camera from pictures of a board that lies on the table.

    Args:
        seen: the board in one or more pictures.
        points: (N, 3) for each picture, where the board's corners are in the workspace, metres: `PrintedBoard.points`.
        lens: of the camera.

    Raises:
        CalibrationError: with the reason.
    """
    single = [_pose(one, each.pixels, lens) for one, each in zip(points, seen, strict=True)]
    for each, one, found in zip(seen, points, single, strict=True):
        _check_residual(found.rms, lens, each.name, "was square= measured, is the board flat, and is this its lens?")
        _check_slant(found.transforms[0], one.mean(0), each.name)
    pixels = np.concatenate([each.pixels for each in seen])
    starts = [found.transforms[0] for found in single]
    joint = [_refined(np.concatenate(points), pixels, lens, start) for start in starts]
    found = min(joint, key=lambda each: each.rms)
    _check_unmoved(seen, single, found, lens)
    _check_side(found.transforms[0])
    place, direction = uncertainty(found.covariance, found.transforms[0])
    check_certain(place, direction, "let the board fill more of the picture, or give pictures of it at several places")
    return Calibrated(
        to_camera=found.transforms[0],
        rms=found.rms,
        pictures=len(seen),
        points=len(pixels),
        place=place,
        direction=direction,
    )


def check_certain(place: float, direction: float, advice: str) -> None:
    """Raise CalibrationError where a camera's place, metres, or direction, degrees, is too uncertain."""
    if place > UNCERTAIN[0] or direction > UNCERTAIN[1]:
        raise CalibrationError(
            f"the camera's place is known to {1000 * place:.1f} mm and its direction to {direction:.2f} degrees only "
            f"(95 %; at most {1000 * UNCERTAIN[0]:.0f} mm and {UNCERTAIN[1]} degrees): {advice}"
        )


def _pose(points: Array, pixels: Array, lens: Lens) -> RobustFit:
    """Return the better one of the two poses from which a plane's points can be seen so."""
    cv2 = opencv()
    flat = (pixels - 0.5)[:, None]
    _, turns, moves, _ = cv2.solvePnPGeneric(
        points, flat, lens.matrix, np.array(lens.distortion), flags=cv2.SOLVEPNP_IPPE
    )
    starts = [transform(turn.ravel(), move.ravel()) for turn, move in zip(turns, moves, strict=True)]
    return min((_refined(points, pixels, lens, start) for start in starts), key=lambda found: found.rms)


def _refined(points: Array, pixels: Array, lens: Lens, start: Array) -> RobustFit:
    return fit(lambda poses: lens.project(applied(poses[0], points)) - pixels, [start])


def uncertainty(covariance: Array, to_camera: Array) -> tuple[float, float]:
    """Return the 95 % uncertainty of a camera's place, metres, and direction, degrees.

    covariance: (6, 6) of turn and move of the transform (4, 4) into the camera's frame.
    """
    move = to_camera[:3, 3]
    skew = np.array([[0.0, -move[2], move[1]], [move[2], 0.0, -move[0]], [-move[1], move[0], 0.0]])
    # The camera is at -R' t. A turn of w and a move of d put it, in the camera's own axes, at -(t x w) - d from there.
    effect = np.hstack((skew, np.eye(3)))
    place = effect @ covariance @ effect.T
    longest = [float(np.sqrt(max(np.linalg.eigvalsh(each)[-1], 0.0))) for each in (place, covariance[:3, :3])]
    return NINETY_FIVE * longest[0], float(np.degrees(NINETY_FIVE * longest[1]))


def check_rms(rms: float, lens: Lens) -> float | None:
    """Return the largest residual that is accepted, pixels, where this one is larger."""
    most = max(WORST_RMS[0], WORST_RMS[1] * lens.width)
    return most if rms > most else None


def _check_residual(rms: float, lens: Lens, name: str, hint: str) -> None:
    most = check_rms(rms, lens)
    if most is not None:
        raise CalibrationError(
            f"{name}: the corners are {rms:.2f} pixels from where they should be, and at most {most:.2f} are "
            f"accepted: {hint}"
        )


def _check_slant(to_camera: Array, at: Array, name: str) -> None:
    ahead = at - inverse(to_camera)[:3, 3]
    slant = float(np.degrees(np.arcsin(min(1.0, abs(ahead[2]) / np.linalg.norm(ahead)))))
    if slant < FLATTEST:
        raise CalibrationError(
            f"{name}: the board is seen nearly edge-on, at {slant:.0f} degrees to its plane, and {FLATTEST:.0f} are "
            "needed: look at it more from above"
        )


def _check_side(to_camera: Array) -> None:
    height = float(inverse(to_camera)[2, 3])
    if height <= 0:
        raise CalibrationError(f"the camera would be {-height:.2f} m below the table: is the picture mirrored?")


def _check_unmoved(seen: Sequence[BoardSeen], single: Sequence[RobustFit], found: RobustFit, lens: Lens) -> None:
    """Raise CalibrationError where one camera cannot have taken all pictures of boards at these places."""
    errors = np.split(found.errors, np.cumsum([len(each.pixels) for each in seen])[:-1])
    rms = [float(np.sqrt((each**2).mean())) for each in errors]
    worst = int(np.argmax([joint / max(alone.rms, 0.1) for joint, alone in zip(rms, single, strict=True)]))
    if rms[worst] > max(3 * single[worst].rms, MOVED * lens.width):
        raise CalibrationError(
            f"{seen[worst].name} does not fit the other pictures: its corners are {rms[worst]:.2f} pixels from where "
            "they should be; the board or the camera moved, or the board is not where at= and turn= say"
        )


# ---- lenses


@dataclass(frozen=True, kw_only=True)
class CalibratedLens:
    """A lens, with rms in pixels, and the uncertainty of its focal length, 95 %, as a share."""

    lens: Lens
    rms: float
    pictures: int
    points: int
    focal: float

    def summary(self) -> dict[str, Any]:
        """Return what a lens file says of its calibration."""
        return {
            "source": "boards",
            "pictures": self.pictures,
            "points": self.points,
            "residual": round(self.rms, 3),
            "focal_95": round(self.focal, 5),
        }


def from_boards(seen: Sequence[BoardSeen], width: int, height: int) -> CalibratedLens:
    """Return the lens of a camera from pictures of a board held at various angles. Raises CalibrationError."""
    if len(seen) < LENS_PICTURES:
        raise CalibrationError(
            f"{len(seen)} pictures show the board, and focal length and distortion need {LENS_PICTURES}: take more, "
            "with the board at various angles and all over the picture"
        )
    cv2 = opencv()
    points = [np.column_stack((each.corners, np.zeros(len(each.corners)))).astype(np.float32) for each in seen]
    pixels = [(each.pixels - 0.5).astype(np.float32)[:, None] for each in seen]
    start = np.array([[width, 0, width / 2 - 0.5], [0, width, height / 2 - 0.5], [0, 0, 1.0]])
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_K3
    rms, matrix, distortion, turns, _, spread, _, _ = cv2.calibrateCameraExtended(
        points, pixels, (width, height), start, None, flags=flags
    )
    lens = Lens(
        focal=float(matrix[0, 0]),
        middle=[float(matrix[0, 2] + 0.5), float(matrix[1, 2] + 0.5)],
        width=width,
        height=height,
        distortion=[float(each) for each in np.ravel(distortion)[:5]],
    )
    _check_residual(rms, lens, "the pictures together", "is the board flat and stiff, and the focus fixed?")
    _check_spread([transform(turn.ravel(), np.zeros(3))[:3, :3] for turn in turns])
    # With the aspect ratio fixed OpenCV gives the deviation for fy alone, in some versions for fx.
    uncertain = 2 * float(max(np.ravel(spread)[:2])) / lens.focal
    if uncertain > LENS_UNCERTAIN:
        raise CalibrationError(
            f"the focal length is known to {uncertain:.1%} only (95 %; at most {LENS_UNCERTAIN:.0%}): let the board "
            "fill more of the pictures, and tilt it more"
        )
    count = sum(map(len, points))
    return CalibratedLens(lens=lens, rms=float(rms), pictures=len(seen), points=count, focal=uncertain)


def _check_spread(rotations: Sequence[Array]) -> None:
    normals = np.array([each[:, 2] for each in rotations])
    widest = float(np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1, 1))))
    if widest < LENS_SPREAD:
        raise CalibrationError(
            f"all pictures show the board at about the same angle (within {widest:.0f} degrees, and {LENS_SPREAD:.0f} "
            "are needed): tilt it to all sides"
        )

"""Where a camera is: `deixis calibrate` finds it from a printed board, or from the robot's own gripper.

    deixis calibrate board                       write a PDF to print: the board, and a marker for the gripper
    deixis calibrate lens <picture> ...          focal length and distortion, from pictures of the board held by hand
    deixis calibrate table <picture> ...         a fixed camera, from pictures of the board on the table
    deixis calibrate gripper <poses.yaml>        a fixed camera, from pictures of the gripper, which carries the marker
    deixis calibrate wrist <poses.yaml>          a camera on the gripper, from its pictures of a board that lies still

    out=<file>          default: board.pdf, lens.yaml, front.yaml (wrist.yaml for wrist); force=true replaces one
    paper=a4            board: a4, letter or a3
    square=0.036        side of a square as measured on the paper, metres
    marker=0.04         gripper: side of the marker as measured, metres
    lens=lens.yaml      a file of `deixis calibrate lens`; or, for a lens without distortion:
    fov=<degrees>       the vertical field of view
    at=[0.44,0.0]       table: where the board's middle is, metres; one for all pictures, or a list of one for each
    turn=0              table: degrees that the board is turned counterclockwise; likewise
    offset=[x,y,z]      gripper: the marker's middle in the gripper's frame, metres; not needed where poses are tilted

What is found is for `deixis look --camera front.yaml`; as ++workspace.cameras.front={...} other programs take it. The
exit code is 2 where a calibration is refused. docs/calibration.md describes how a person does it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.command_line import check_file
from core.errors import ConfigError, did_you_mean
from core.program import help_text, program
from core.schema import Checked, any_path, one_of, read, within

Array = NDArray[np.float64]
REFUSED = 2  # exit code
MOST_PICTURES = 200


@dataclass(frozen=True, kw_only=True)
class CalibrationWords(Checked):
    """Keys of the command line; the module's docstring describes them."""

    out: str | None = any_path(default=None)
    force: bool = False
    paper: str = one_of("a4", "letter", "a3", default="a4")
    square: float = within(0.005, 0.5, default=0.036)
    marker: float = within(0.005, 0.5, default=0.04)
    lens: str | None = any_path(default=None)
    fov: float | None = within(1, 120, default=None)
    offset: list[float] | None = within(-1, 1, count=3, default=None)


@dataclass(frozen=True, kw_only=True)
class PoseRow(Checked):
    """A row of a poses file. joints: radians, or position, metres, and rotation, a quaternion x, y, z, w."""

    picture: str = any_path()
    joints: list[float] | None = within(-100, 100, count=(1, 20), default=None)
    position: list[float] | None = within(-20, 20, count=3, default=None)
    rotation: list[float] | None = within(-1, 1, count=4, default=None)


# Which keys each action takes, beside `out` and `force`.
LENS_KEYS = ("lens", "fov")
KEYS: dict[str, tuple[str, ...]] = {
    "board": ("paper", "square"),
    "lens": ("square",),
    "table": ("square", *LENS_KEYS, "at", "turn"),
    "gripper": ("marker", *LENS_KEYS, "offset"),
    "wrist": ("square", *LENS_KEYS),
}
OUT = {"board": "board.pdf", "lens": "lens.yaml", "table": "front.yaml", "gripper": "front.yaml", "wrist": "wrist.yaml"}


def cli() -> None:
    """Run the program with the words of this process."""
    with program(failed=REFUSED):
        words = sys.argv[1:]
        if any(word in ("-h", "--help") for word in words):
            print(help_text(__file__))
        else:
            main(words)


def main(words: Sequence[str]) -> None:
    """Run the program. Raises ConfigError; then nothing is written."""
    action, *rest = [*words, ""]
    if action not in KEYS:
        raise ConfigError(
            f"{action or 'an action'} is missing or not known: deixis calibrate board, lens, table, gripper or wrist"
            + (did_you_mean(action, KEYS) if action else "")
        )
    files, given = _split(rest[:-1], action)
    placing: dict[str, Any] = {key: given.pop(key) for key in ("at", "turn") if key in given}
    wished = read(CalibrationWords, given, "")
    out = _out(wished, action)
    actions: dict[str, Callable[[], str | bytes]] = {
        "board": lambda: _board(files, wished),
        "lens": lambda: _lens(files, wished),
        "table": lambda: _table(files, wished, placing, out.stem),
        "gripper": lambda: _poses(files, wished, "gripper", out.stem),
        "wrist": lambda: _poses(files, wished, "wrist", out.stem),
    }
    content = actions[action]()
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    print(f"wrote {out}")


def _split(words: Sequence[str], action: str) -> tuple[list[Path], dict[str, Any]]:
    """Return files and keys. Raises ConfigError."""
    from core.safe_files import FileError, parse_yaml

    known, files, given = ("out", "force", *KEYS[action]), [], {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or Path(word).exists():
            files.append(Path(word))
            continue
        if key not in known:
            raise ConfigError(f"{word}: deixis calibrate {action} has no {key}" + did_you_mean(key, known))
        if key in given or not value:
            raise ConfigError(f"{word}: give {key} once, with a value")
        try:
            given[key] = value if key in ("out", "lens") else parse_yaml(value.encode("utf-8", "replace"))
        except FileError as error:
            raise ConfigError(f"{word}: the value {error}") from None
    return files, given


def _out(wished: CalibrationWords, action: str) -> Path:
    suffixes = (".pdf",) if action == "board" else (".yaml", ".yml")
    out = check_file("out", wished.out or OUT[action], suffixes)
    if out.exists() and not wished.force:
        raise ConfigError(f"out={out} is there already: give force=true to replace it, or another name")
    return out


# ---- actions


def _board(files: Sequence[Path], wished: CalibrationWords) -> bytes:
    from envs.perception.printed_board import PrintedBoard, pdf

    if files:
        raise ConfigError(f"{files[0]}: deixis calibrate board takes no pictures; deixis calibrate table does")
    return pdf(PrintedBoard(square=wished.square), wished.paper)


def _lens(files: Sequence[Path], wished: CalibrationWords) -> str:
    from envs.perception.calibration import CalibrationError, find_board, from_boards
    from envs.perception.camera_files import camera_text
    from envs.perception.printed_board import PrintedBoard

    board, seen = PrintedBoard(square=wished.square), []
    pictures = _pictures(files, "lens")
    for path, picture in pictures:
        try:
            seen.append(find_board(picture, board, str(path)))
        except CalibrationError as error:
            print(f"- left out: {error}", flush=True)
    height, width = pictures[0][1].shape[:2]
    found = from_boards(seen, width, height)
    lens = found.lens
    print(
        f"focal length {lens.focal:.1f} pixels (95 %: {found.focal:.2%}), vertical field of view {lens.fov:.2f} "
        f"degrees, residual {found.rms:.2f} pixels, {found.pictures} pictures with {found.points} corners"
    )
    return camera_text(_title("lens"), None, lens, found.summary())


def _table(files: Sequence[Path], wished: CalibrationWords, placing: dict[str, Any], name: str) -> str:
    from envs.perception.calibration import find_board, from_table
    from envs.perception.printed_board import PrintedBoard

    pictures = _pictures(files, "table")
    places, turns = _places(placing, len(pictures))
    board = PrintedBoard(square=wished.square)
    lens = _lens_of(wished, pictures[0][1].shape[1], pictures[0][1].shape[0])
    seen = [find_board(picture, board, str(path)) for path, picture in pictures]
    points = [board.points(one.corners, at, turn) for one, at, turn in zip(seen, places, turns, strict=True)]
    return _told(from_table(seen, points, lens), lens, "table", name)


def _poses(files: Sequence[Path], wished: CalibrationWords, action: str, name: str) -> str:
    from envs.perception.calibration import CalibrationError, find_board
    from envs.perception.hand_eye import PoseSeen, find_marker, from_gripper, from_wrist, marker_points
    from envs.perception.printed_board import PrintedBoard

    if len(files) != 1:
        raise ConfigError(
            f"deixis calibrate {action} takes one file of poses, like deixis calibrate {action} poses.yaml"
        )
    rows = read_poses(files[0], positions=wished.offset is not None)
    pictures = _pictures([path for path, _ in rows], action)
    lens = _lens_of(wished, pictures[0][1].shape[1], pictures[0][1].shape[0])
    board, seen = PrintedBoard(square=wished.square), []
    for (path, picture), (_, gripper) in zip(pictures, rows, strict=True):
        if action == "gripper":
            pixels, points = find_marker(picture), marker_points(wished.marker)
        else:
            try:
                found = find_board(picture, board, str(path))
                pixels, points = found.pixels, np.column_stack((found.corners, np.zeros(len(found.corners))))
            except CalibrationError as error:
                print(f"- left out: {error}", flush=True)
                continue
        if pixels is None:
            print(f"- left out: {path} does not show the marker sharply and in full", flush=True)
            continue
        seen.append(PoseSeen(str(path), gripper, pixels, points))
    if action == "wrist":
        return _told(from_wrist(seen, len(rows), lens), lens, action, name)
    offset = None if wished.offset is None else np.array(wished.offset)
    return _told(from_gripper(seen, len(rows), lens, offset), lens, action, name)


def _told(found: Any, lens: Any, action: str, name: str) -> str:
    """Print what was found, and return the camera file."""
    from core.cameras import CameraFrame
    from envs.perception.camera_files import camera_text, override_of

    for path in found.left_out:
        print(f"- left out: {path} does not fit the other poses", flush=True)
    camera = found.camera(lens, "gripper" if action == "wrist" else "workspace")
    gripper = (np.zeros(3), np.eye(3)) if action == "wrist" else None
    x, y, z = CameraFrame.of(camera, gripper).place
    print(
        f"the camera is at x {x:.4f}, y {y:.4f}, z {z:.4f} m{' of the gripper' if action == 'wrist' else ''}, "
        f"yaw {camera.yaw:.2f}, pitch {camera.pitch:.2f}, roll {camera.roll:.2f} degrees\n"
        f"residual {found.rms:.2f} pixels, {found.pictures} pictures with {found.points} points; 95 %: its place "
        f"within {1000 * found.place:.1f} mm, its direction within {found.direction:.2f} degrees"
    )
    print(f"for other programs: '{override_of(name, camera)}'")
    return camera_text(_title("camera"), camera, lens, found.summary(action))


def _title(kind: str) -> str:
    return f"A {kind} that deixis calibrate found on {date.today().isoformat()}: docs/calibration.md."


# ---- what the actions read


def _pictures(files: Sequence[Path], action: str) -> list[tuple[Path, NDArray[np.uint8]]]:
    """Return pictures of one size in which something can be seen. Raises ConfigError."""
    from envs.perception.camera_files import read_picture
    from envs.perception.detections import why_unusable

    if not files:
        raise ConfigError(f"deixis calibrate {action} needs pictures, like deixis calibrate {action} 1.png 2.png")
    if len(files) > MOST_PICTURES:
        raise ConfigError(
            f"deixis calibrate {action} takes at most {MOST_PICTURES} pictures, and {len(files)} are given"
        )
    found = [(path, read_picture(path)) for path in files]
    first = found[0][1].shape
    for path, picture in found:
        if picture.shape != first:
            raise ConfigError(
                f"{path} has {picture.shape[1]} x {picture.shape[0]} pixels, and {files[0]} {first[1]} x {first[0]}: "
                "all pictures must be of one camera in one setting"
            )
        reason = why_unusable(picture)
        if reason:
            raise ConfigError(f"{path} {reason}")
    return found


def _lens_of(wished: CalibrationWords, width: int, height: int) -> Any:
    from envs.perception.camera_files import Lens, read_lens

    if (wished.lens is None) == (wished.fov is None):
        raise ConfigError(
            "give the camera's lens: lens=lens.yaml from deixis calibrate lens, or fov=<degrees>, not both"
        )
    if wished.fov is not None:
        return Lens.ideal(wished.fov, width, height)
    lens = read_lens(Path(str(wished.lens)))
    if (lens.width, lens.height) != (width, height):
        raise ConfigError(
            f"lens={wished.lens} is of pictures of {lens.width} x {lens.height} pixels, and these have "
            f"{width} x {height}: find the lens from pictures of this size"
        )
    return lens


def _places(placing: dict[str, Any], count: int) -> tuple[list[Array], list[float]]:
    """Return where the board is in each picture, (3,) metres, and how it is turned, degrees. Raises ConfigError."""
    at, turn = placing.get("at"), placing.get("turn", 0.0)
    if at is None:
        raise ConfigError("where is the board? Give at=[x,y], its middle in metres from where the robot is mounted")
    ats = at if isinstance(at, list) and at and isinstance(at[0], list) else [at] * count
    turns = turn if isinstance(turn, list) else [turn] * count
    for key, values in (("at", ats), ("turn", turns)):
        if len(values) != count:
            raise ConfigError(
                f"{key}={placing[key]} has {len(values)} entries, and there are {count} pictures: one for each"
            )
    for one in ats:
        if (
            not isinstance(one, list)
            or len(one) not in (2, 3)
            or not all(map(_is_number, one))
            or max(map(abs, one)) > 20
        ):
            raise ConfigError(f"at={one} must be [x,y] or [x,y,z] in metres, like at=[0.44,0.0]")
    for one in turns:
        if not _is_number(one) or abs(one) > 360:
            raise ConfigError(f"turn={one} must be degrees from -360 to 360")
    return [np.array([*one, 0.0][:3], float) for one in ats], [float(one) for one in turns]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def read_poses(path: Path, positions: bool = False) -> list[tuple[Path, Array]]:
    """Read a file of poses: pictures, and the gripper's frame (4, 4) in the workspace. Raises ConfigError.

    positions: whether a position without a rotation is enough.
    """
    from core.safe_files import FileError, check_plain, read_yaml

    try:
        content = read_yaml(path)
        check_plain(content)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    if not isinstance(content, dict) or not isinstance(content.get("poses"), list) or not content["poses"]:
        raise ConfigError(f"{path} must have poses: a list of groups with picture and joints, or position and rotation")
    for key in content:
        if key not in ("robot", "poses"):
            raise ConfigError(f"{path}: {key} is not a known key" + did_you_mean(str(key), ("robot", "poses")))
    rows = [read(PoseRow, row, f"{path}: poses.{index}") for index, row in enumerate(content["poses"])]
    kinematics = _kinematics(path, content.get("robot")) if any(row.joints for row in rows) else None
    frames = [_frame(row, kinematics, f"{path}: poses.{index}", positions) for index, row in enumerate(rows)]
    for index, row in enumerate(rows):
        if Path(row.picture).is_absolute() or ".." in Path(row.picture).parts:
            raise ConfigError(f"{path}: poses.{index}.picture={row.picture} must be in the folder of this file")
    return [(path.parent / row.picture, frame) for row, frame in zip(rows, frames, strict=True)]


def _kinematics(path: Path, robot: Any) -> Any:
    from core.composition import groups
    from core.overrides import compose
    from envs.sim.robot import read_kinematics
    from envs.sim.robot_config import RobotConfig

    if not isinstance(robot, str) or robot not in groups()["robot"]:
        raise ConfigError(
            f"{path}: robot={robot} is not known, and joints need a robot" + did_you_mean(str(robot), groups()["robot"])
        )
    return read_kinematics(read(RobotConfig, compose([f"robot={robot}"])["robot"], "robot"))


def _frame(row: PoseRow, kinematics: Any, key: str, positions: bool) -> Array:
    """Return the gripper's frame (4, 4). Raises ConfigError."""
    from envs.perception.robust_fit import transform

    if (row.joints is None) == (row.position is None):
        raise ConfigError(f"{key} must have joints, or position and rotation, and not both")
    if row.joints is not None:
        if len(row.joints) != len(kinematics.low):
            raise ConfigError(f"{key}.joints={row.joints} must be {len(kinematics.low)} angles, one for each joint")
        pose = kinematics.forward(np.array([row.joints]))
        return transform(pose.rotation[0], pose.position[0])
    if row.rotation is None:
        if not positions:
            raise ConfigError(
                f"{key} has no rotation: give it (a quaternion x, y, z, w), or offset=[x,y,z] of the marker"
            )
        return transform(np.eye(3), np.array(row.position))
    return transform(_rotation(row.rotation, key), np.array(row.position))


def _rotation(quaternion: Sequence[float], key: str) -> Array:
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > 0.01:
        raise ConfigError(f"{key}.rotation={list(quaternion)} must be of length 1, and has {length:.3f}")
    x, y, z, w = np.array(quaternion) / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )

"""Errors of `deixis calibrate` on rendered boards and grippers with known truth.

    python -m benchmarks.calibration boards --out docs/calibration.json
    python -m benchmarks.calibration gripper --out docs/calibration.json
    python -m benchmarks.calibration bullet --out docs/calibration.json

`boards`: pictures of the board at random turns, drawn by its exact projection with blur, uneven light and noise: one
picture, four pictures with the board at four places, and five, the last on a box of 12 cm. `gripper`: the marker in
PyBullet's pictures of the kuka in twelve random poses, covered where the arm is before it; a camera on the gripper too.
`bullet`: the board as a texture in PyBullet's own pictures, whose geometry is not ours.
The errors are those of the camera's place, millimetres, and of its whole orientation, degrees.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as bullet
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image

from benchmarks.store import lines_of, write_section
from core.cameras import Camera, CameraFrame
from core.overrides import compose
from core.schema import read
from envs import read_env
from envs.perception.calibration import Calibrated, CalibrationError, find_board, from_table
from envs.perception.camera_files import Lens
from envs.perception.hand_eye import PoseSeen, find_marker, from_gripper, from_wrist, marker_points
from envs.perception.printed_board import GRIPPER_MARKER, GRIPPER_SIDE, PrintedBoard
from envs.perception.robust_fit import angle_of, rotation, transform
from envs.sim.kinematics import Kinematics
from envs.sim.rendering import photograph
from envs.sim.robot import Robot, read_kinematics
from tools.drawn_boards import Print, board_to_camera, draw, gray, lens_of, resized, worn

Array = NDArray[np.float64]
SIZES = ((640, 480), (1280, 960))
Row = tuple[str, dict[str, Any]]
BOARD = PrintedBoard()
SHEET, MARKER = Print.of_board(BOARD), Print.of_marker(GRIPPER_MARKER, GRIPPER_SIDE)
PLACES = [[x, y, 0.0] for x in (0.36, 0.52) for y in (-0.2, 0.2)]
ON_BOX = [0.44, 0.0, 0.12]
SETS: dict[str, Callable[[Generator], list[list[float]]]] = {
    "one picture": lambda rng: [[float(rng.uniform(0.38, 0.5)), float(rng.uniform(-0.12, 0.12)), 0.0]],
    "four places": lambda rng: PLACES,
    "four places and a box": lambda rng: [*PLACES, ON_BOX],
}
POSES = 12
ROTATED = 0.4  # radians by which a gripper is tilted about each axis, at most


def cameras() -> dict[str, Camera]:
    """Return the cameras of the table, moved a little from where the config has them by `jittered`."""
    found = compose([])["workspace"]["cameras"]
    return {name: read(Camera, found[name], name) for name in ("front", "side", "top")}


def jittered(camera: Camera, rng: Generator) -> Camera:
    """Return a camera that is moved by up to 5 cm and turned by up to 5 degrees, as a person would place it."""
    return replace(
        camera,
        target=(np.array(camera.target) + rng.uniform(-0.05, 0.05, 3)).tolist(),
        yaw=camera.yaw + float(rng.uniform(-5, 5)),
        pitch=max(camera.pitch + float(rng.uniform(-5, 5)), -90.0),
        roll=float(rng.uniform(-5, 5)),
    )


def summary(runs: Sequence[Callable[[], tuple[float, float]]]) -> dict[str, Any]:
    """Return the errors of runs, and how many were refused."""
    found, reasons = [], []
    for run in runs:
        try:
            found.append(run())
        except CalibrationError as error:
            reasons.append(str(error))
    result: dict[str, Any] = {"runs": len(runs), "refused": len(reasons)}
    if reasons:  # without their numbers, the most frequent one
        result["refused because"] = Counter(re.sub(r"[\d.]+", "#", each) for each in reasons).most_common(1)[0][0]
    if found:
        for name, values in zip(("mm", "degrees"), np.array(found).T, strict=True):
            statistics = np.median(values), np.quantile(values, 0.95), values.max()
            result[name] = ", ".join(
                f"{word} {value:.3f}" for word, value in zip(("median", "95 %", "most"), statistics, strict=True)
            )
    return result


def errors(found: Calibrated, lens: Lens, frame: CameraFrame) -> tuple[float, float]:
    """Return the errors of a calibration, millimetres and degrees, through the camera that a file would have."""
    camera = found.camera(lens)
    got = CameraFrame.of(camera)
    return 1000 * float(np.linalg.norm(got.place - frame.place)), float(np.degrees(angle_of(got.axes @ frame.axes.T)))


# ---- boards


def boards(args: argparse.Namespace) -> Iterator[Row]:
    """Yield the errors by size, camera and set of pictures."""
    rng = np.random.default_rng(args.seed)
    for width, height in SIZES[: 1 + args.large]:
        for name, camera in cameras().items():
            chosen = [resized(jittered(camera, rng), width, height) for _ in range(args.runs)]
            for kind, places in SETS.items():
                runs = [partial(from_drawn, camera, places(rng), rng) for camera in chosen]
                yield f"{width} x {height} {name}, {kind}", summary(runs)


def from_drawn(camera: Camera, places: list[list[float]], rng: Generator) -> tuple[float, float]:
    """Return the errors of one calibration from drawn boards at these places."""
    frame, lens, turn = CameraFrame.of(camera), lens_of(camera), float(rng.uniform(-180, 180))

    def picture(at: list[float]) -> NDArray[np.uint8]:
        return worn(draw(gray(camera), SHEET, board_to_camera(frame, np.array(at), turn, BOARD), lens), rng)

    seen = [find_board(picture(at), BOARD, str(at)) for at in places]
    points = [BOARD.points(each.corners, np.array(at), turn) for each, at in zip(seen, places, strict=True)]
    return errors(from_table(seen, points, lens), lens, frame)


def in_bullet(args: argparse.Namespace) -> Iterator[Row]:
    """Yield the errors from PyBullet's own pictures of a board with a texture."""
    rng, client = np.random.default_rng(args.seed), bullet.connect(bullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory() as folder:
            body = textured(Path(folder), client)
            front = cameras()["front"]
            chosen = [resized(jittered(front, rng), 640, 480) for _ in range(args.runs)]
            runs = [partial(photographed, camera, body, client, rng) for camera in chosen]
            yield "640 x 480 front, four places", summary(runs)
    finally:
        bullet.disconnect(client)


def textured(folder: Path, client: int) -> int:
    """Return a body that is the board, flat, its middle in the origin, and its page's upper edge towards +x."""
    border = 24
    image = np.pad(SHEET.cells, border, constant_values=True)
    Image.fromarray((255 * np.kron(image, np.ones((4, 4)))).astype(np.uint8)).convert("RGB").save(folder / "board.png")
    high, wide = SHEET.side * np.array(image.shape) / 2
    # Upper left, upper right, lower right and lower left corners of the page; a texture's v goes up.
    corners = [(high, wide), (high, -wide), (-high, -wide), (-high, wide)]
    lines = [f"v {x:.6f} {y:.6f} 0" for x, y in corners] + ["vt 0 1", "vt 1 1", "vt 1 0", "vt 0 0", "vn 0 0 1"]
    (folder / "board.obj").write_text("\n".join([*lines, "f 1/1/1 3/3/1 2/2/1", "f 1/1/1 4/4/1 3/3/1"]) + "\n")
    shape = bullet.createVisualShape(bullet.GEOM_MESH, fileName=str(folder / "board.obj"), physicsClientId=client)
    body: int = bullet.createMultiBody(0, -1, shape, physicsClientId=client)
    texture = bullet.loadTexture(str(folder / "board.png"), physicsClientId=client)
    bullet.changeVisualShape(body, -1, textureUniqueId=texture, physicsClientId=client)
    return body


def photographed(camera: Camera, body: int, client: int, rng: Generator, fine: int = 4) -> tuple[float, float]:
    """Return the errors of one calibration from pictures of PyBullet, each the mean of fine x fine pixels."""
    frame, lens, turn = CameraFrame.of(camera), lens_of(camera), float(rng.uniform(-180, 180))
    seen, points = [], []
    for at in PLACES:
        quaternion = bullet.getQuaternionFromEuler([0, 0, np.radians(turn)])
        bullet.resetBasePositionAndOrientation(body, at, quaternion, physicsClientId=client)
        large = resized(camera, fine * camera.width, fine * camera.height)
        colors = photograph(client, large, frame).colors.astype(float)
        small = colors.reshape(camera.height, fine, camera.width, fine, 3).mean((1, 3)).astype(np.uint8)
        seen.append(find_board(worn(small, rng), BOARD, str(at)))
        points.append(BOARD.points(seen[-1].corners, np.array(at), turn))
    return errors(from_table(seen, points, lens), lens, frame)


# ---- the gripper


class KukaPoses:
    """The kuka in PyBullet, without anything else. kinematics: of it."""

    def __init__(self) -> None:
        config = read_env(compose(["robot=kuka"])).robot
        self.client = bullet.connect(bullet.DIRECT)
        self._robot = Robot(config, self.client, visuals=True)
        self.kinematics: Kinematics = read_kinematics(config)

    def poses(self, rng: Generator) -> list[Array]:
        """Return joints (J,) of random poses with the gripper over the table, tilted to all sides."""
        rest = self.kinematics.rest[None]
        down = self.kinematics.forward(rest).rotation[0]
        found: list[Array] = []
        while len(found) < POSES:
            goal = rng.uniform([0.36, -0.22, 0.12], [0.56, 0.22, 0.38])[None]
            turn = rotation(rng.uniform(-ROTATED, ROTATED, 3)) @ down
            joints = self.kinematics.solve(rest, goal, turn, 60)
            if np.linalg.norm(self.kinematics.forward(joints).position - goal) < 0.01:
                found.append(joints[0])
        return found

    def frame(self, joints: Array) -> Array:
        """Return the gripper's frame (4, 4)."""
        pose = self.kinematics.forward(joints[None])
        return transform(pose.rotation[0], pose.position[0])

    def picture(
        self, camera: Camera, frame: CameraFrame, joints: Array
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return PyBullet's picture of the arm, and its depths."""
        self._robot.place(joints.tolist(), 0.0)
        photo = photograph(self.client, camera, frame)
        return photo.colors, photo.depths


def gripper(args: argparse.Namespace) -> Iterator[Row]:
    """Yield the errors from twelve poses: of a fixed camera, and of one on the gripper."""
    rng, arm = np.random.default_rng(args.seed), KukaPoses()
    for width, height in SIZES[: 1 + args.large]:
        chosen = [resized(jittered(cameras()["front"], rng), width, height) for _ in range(args.runs)]
        size = f"{width} x {height}"
        for name, slack in (("exact joints", 0.0), ("joints off by 0.03 degrees", 0.03)):
            for kind, measured in (("marker's place unknown", False), ("marker's place measured", True)):
                runs = [partial(from_marker, c, arm, measured, slack, rng) for c in chosen]
                yield f"{size} front, {name}, {kind}", summary(runs)
        wrist = replace(read(Camera, compose([])["workspace"]["cameras"]["wrist"], "wrist"), width=width, height=height)
        runs = [partial(from_wrist_board, wrist, arm, rng)] * args.runs
        yield f"{size} wrist, exact joints", summary(runs)


def from_marker(camera: Camera, arm: KukaPoses, measured: bool, slack: float, rng: Generator) -> tuple[float, float]:
    """Return the errors of one calibration. slack: standard deviation of what joints tell, degrees."""
    frame, lens = CameraFrame.of(camera), lens_of(camera)
    to_camera = transform(frame.axes, -frame.axes @ frame.place)
    rest = arm.frame(arm.kinematics.rest)
    facing = rest[:3, :3].T @ rotation(rng.uniform(-0.2, 0.2, 3)) @ frame.axes.T
    out = facing[:, 2] * -0.06 + [0.0, 0.0, 0.07]  # metres towards the camera and below: held before the arm
    on_gripper = transform(facing, out + rng.uniform(-0.02, 0.02, 3))
    corner = transform(np.eye(3), np.array([-GRIPPER_SIDE / 2, -GRIPPER_SIDE / 2, 0.0]))
    seen = []
    for index, joints in enumerate(arm.poses(rng)):
        picture, depths = arm.picture(camera, frame, joints)
        picture = draw(picture, MARKER, to_camera @ arm.frame(joints) @ on_gripper @ corner, lens, depths)
        pixels = find_marker(worn(picture, rng))
        told = joints + np.radians(slack) * rng.normal(size=joints.shape)
        if pixels is not None:
            seen.append(PoseSeen(str(index), arm.frame(told), pixels, marker_points(GRIPPER_SIDE)))
    found = from_gripper(seen, POSES, lens, on_gripper[:3, 3] if measured else None)
    return errors(found, lens, frame)


def from_wrist_board(camera: Camera, arm: KukaPoses, rng: Generator) -> tuple[float, float]:
    """Return the errors of one calibration of a camera on the gripper, in the gripper's frame."""
    lens, seen, place = lens_of(camera), [], np.array([0.46, 0.02, 0.01])
    for index, joints in enumerate(arm.poses(rng)):
        whole = arm.frame(joints)
        frame = CameraFrame.of(camera, (whole[:3, 3], whole[:3, :3]))
        picture, depths = arm.picture(camera, frame, joints)
        picture = worn(draw(picture, SHEET, board_to_camera(frame, place, 25.0, BOARD), lens, depths), rng)
        try:
            board = find_board(picture, BOARD, str(index))
        except CalibrationError:
            continue
        seen.append(PoseSeen(str(index), whole, board.pixels, np.pad(board.corners, ((0, 0), (0, 1)))))
    here = (np.zeros(3), np.eye(3))
    found = CameraFrame.of(from_wrist(seen, POSES, lens).camera(lens, "gripper"), here)
    true = CameraFrame.of(camera, here)
    return 1000 * float(np.linalg.norm(found.place - true.place)), float(np.degrees(angle_of(found.axes @ true.axes.T)))


def main() -> None:
    """Measure one thing and print its table. There is no pass or fail."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("boards", "gripper", "bullet"))
    parser.add_argument("--runs", type=int, default=20, help="calibrations of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--large", action="store_true", help="pictures of 1280 x 960 too")
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="file that receives the result")
    args = parser.parse_args()
    result: dict[str, Any] = {}
    for name, row in {"boards": boards, "gripper": gripper, "bullet": in_bullet}[args.what](args):
        result[name] = row
        for key, value in lines_of({name: row}):
            print(f"{key:75} {value}", flush=True)
    if args.out:
        write_section(args.out, "benchmarks.calibration", args.what, result)


if __name__ == "__main__":
    main()

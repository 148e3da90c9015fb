"""What the tests of calibration share: a camera with a known pose, and pictures of boards and of a gripper's marker."""

import numpy as np

from core.cameras import Camera, CameraFrame
from envs.perception.hand_eye import PoseSeen, find_marker, marker_points
from envs.perception.printed_board import GRIPPER_MARKER, PrintedBoard
from envs.perception.robust_fit import angle_of, rotation, transform
from tools.drawn_boards import Print, board_to_camera, draw, gray, lens_of, worn

FRONT = Camera(
    target=[0.44, 0.0, 0.1], distance=1.25, yaw=140.0, pitch=-48.0, fov=36.0, width=640, height=480, roll=1.5
)
FRAME, LENS, BOARD = CameraFrame.of(FRONT), lens_of(FRONT), PrintedBoard()
TO_CAMERA = transform(FRAME.axes, -FRAME.axes @ FRAME.place)
SHEET, MARKER, SIDE = Print.of_board(BOARD), Print.of_marker(GRIPPER_MARKER, 0.04), 0.04
PLACES = [[0.36, -0.2], [0.36, 0.2], [0.52, -0.2], [0.52, 0.2]]
# The marker looks at the camera, five centimetres above the gripper's centre.
ON_GRIPPER = transform(rotation(np.array([0.1, -0.15, 0.05])) @ FRAME.axes.T, np.array([0.01, 0.02, 0.05]))


def on_table(at, turn=0.0, seed=0, camera=FRONT, lens=None, **wear):
    """A picture of the board on the table."""
    to_camera = board_to_camera(CameraFrame.of(camera), np.array([*at, 0.0][:3]), turn, BOARD)
    picture = draw(gray(camera), SHEET, to_camera, lens or lens_of(camera), supersampling=3)
    return worn(picture, np.random.default_rng(seed), **wear)


def in_hand(seed, lens, tilt=0.6):
    """A picture of the board held before the camera."""
    rng = np.random.default_rng(seed)
    place = [rng.uniform(-0.12, 0.12), rng.uniform(-0.08, 0.08), rng.uniform(0.45, 0.65)]
    to_camera = transform(rotation(rng.uniform(-tilt, tilt, 3)), np.array(place))
    middle = transform(np.eye(3), np.array([*(-BOARD.size / 2), 0.0]))
    return worn(draw(gray(FRONT), SHEET, to_camera @ middle, lens, supersampling=3), rng)


def poses(rng, count=12, tilt=0.5, low=(0.32, -0.2, 0.06), high=(0.56, 0.2, 0.3)):
    """Frames (4, 4) of a gripper."""
    return [transform(rotation(rng.uniform(-tilt, tilt, 3)), rng.uniform(low, high)) for _ in range(count)]


def at_gripper(gripper, rng):
    """A picture of the marker on the gripper."""
    corner = transform(np.eye(3), np.array([-SIDE / 2, -SIDE / 2, 0.0]))
    return worn(draw(gray(FRONT), MARKER, TO_CAMERA @ gripper @ ON_GRIPPER @ corner, LENS, supersampling=3), rng)


def seen_at(grippers, rng):
    """The marker in pictures of these poses."""
    pictures = [at_gripper(gripper, rng) for gripper in grippers]
    return [
        PoseSeen(f"{index}.png", gripper, pixels, marker_points(SIDE))
        for index, (gripper, pixels) in enumerate(zip(grippers, map(find_marker, pictures), strict=True))
        if pixels is not None
    ]


def errors(camera, frame=FRAME, gripper=None):
    """How far a camera is from the true frame: millimetres and degrees."""
    found = CameraFrame.of(camera, gripper)
    return 1000 * np.linalg.norm(found.place - frame.place), np.degrees(angle_of(found.axes @ frame.axes.T))

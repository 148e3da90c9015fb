"""Calibration of cameras from twelve poses of a gripper, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("cv2", reason="OpenCV is not installed")

from core.cameras import Camera, CameraFrame
from envs.perception.calibration import CalibrationError, find_board
from envs.perception.hand_eye import PoseSeen, from_gripper, from_wrist
from envs.perception.robust_fit import inverse, rotation, transform
from tests.helpers.drawn_cases import BOARD, FRONT, LENS, ON_GRIPPER, SHEET, errors, poses, seen_at
from tools.drawn_boards import board_to_camera, draw, gray, worn


@pytest.fixture(scope="module")
def tilted():
    """The marker in twelve poses of a gripper that is moved and tilted."""
    rng = np.random.default_rng(3)
    return seen_at(poses(rng), rng)


def straight(seed, **box):
    rng = np.random.default_rng(seed)
    return seen_at(poses(rng, tilt=0.0, **box), rng)


def test_twelve_poses_place_a_camera_to_four_millimetres_without_knowing_where_the_marker_is(tilted):
    found = from_gripper(tilted, 12, LENS)
    millimetres, degrees = errors(found.camera(LENS))
    assert millimetres < 4
    assert degrees < 0.4
    assert millimetres / 1000 < found.place
    assert found.left_out == ()


def test_a_gripper_that_is_not_turned_will_do_where_the_marker_was_measured():
    found = from_gripper(straight(4), 12, LENS, ON_GRIPPER[:3, 3])
    millimetres, degrees = errors(found.camera(LENS))
    assert millimetres < 4
    assert degrees < 0.4


def test_a_pose_that_does_not_fit_is_left_out_and_named(tilted):
    wrong = transform(np.eye(3), np.array([0.03, 0.0, 0.0])) @ tilted[5].gripper
    seen = [*tilted[:5], replace(tilted[5], gripper=wrong), *tilted[6:]]
    found = from_gripper(seen, 12, LENS)
    assert found.left_out == ("5.png",)
    assert errors(found.camera(LENS))[0] < 4


def test_a_camera_on_the_gripper_is_placed_from_a_board_that_lies_anywhere():
    wrist = Camera(
        target=[0.06, 0, 0.1], distance=0.2, yaw=90, pitch=60, fov=50, width=640, height=480, mount="gripper"
    )
    lens = replace(LENS, focal=wrist.focal)
    rng, down, seen = np.random.default_rng(5), np.diag([-1.0, 1.0, -1.0]), []
    for index in range(12):
        place = np.array([rng.uniform(0.36, 0.48), rng.uniform(-0.06, 0.06), rng.uniform(0.3, 0.42)])
        gripper = transform(rotation(rng.uniform(-0.3, 0.3, 3)) @ down, place)
        frame = CameraFrame.of(wrist, (place, gripper[:3, :3]))
        to_camera = board_to_camera(frame, np.array([0.4, 0.05, 0.02]), 33.0, BOARD)
        try:
            board = find_board(worn(draw(gray(FRONT), SHEET, to_camera, lens, supersampling=3), rng), BOARD, str(index))
        except CalibrationError:
            continue
        seen.append(PoseSeen(str(index), gripper, board.pixels, np.pad(board.corners, ((0, 0), (0, 1)))))
    found = from_wrist(seen, 12, lens)
    here = (np.zeros(3), np.eye(3))
    millimetres, degrees = errors(found.camera(lens, "gripper"), CameraFrame.of(wrist, here), here)
    assert millimetres < 4
    assert degrees < 0.4


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ({"low": (0.4, -0.2, 0.06), "high": (0.401, 0.2, 0.3)}, "lie all in one plane"),
        ({"low": (0.4, -0.2, 0.2), "high": (0.401, 0.2, 0.201)}, "lie all in one line"),
        ({}, "the gripper is not turned between the poses"),
    ],
)
def test_poses_in_a_plane_in_a_line_or_without_a_turn_are_refused(box, message):
    with pytest.raises(CalibrationError, match=message):
        from_gripper(straight(6, **box), 12, LENS)


def test_turns_about_one_axis_alone_are_refused(tilted):
    turned = [
        replace(each, gripper=transform(rotation(np.array([0.0, 0.0, 0.1 * index])), each.gripper[:3, 3]))
        for index, each in enumerate(tilted)
    ]
    with pytest.raises(CalibrationError, match="turned about one axis alone"):
        from_gripper(turned, 12, LENS)


def test_few_pictures_with_the_marker_are_refused(tilted):
    with pytest.raises(CalibrationError, match="the marker is seen in 5 of 12 pictures, and 8 are needed"):
        from_gripper(tilted[:5], 12, LENS)


def test_poses_that_are_not_those_of_the_pictures_are_refused(tilted):
    others = [replace(each, gripper=other.gripper) for each, other in zip(tilted, tilted[3:] + tilted[:3], strict=True)]
    with pytest.raises(CalibrationError, match=r"are the poses those of the pictures"):
        from_gripper(others, 12, LENS)


def test_inverse_and_angles_of_transforms_agree():
    one = transform(np.array([0.3, -0.2, 0.9]), np.array([1.0, 2.0, 3.0]))
    assert np.allclose(inverse(one) @ one, np.eye(4))

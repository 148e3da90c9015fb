"""Calibration of fixed cameras and lenses from drawn boards with known truth, and what is refused."""

import re

import numpy as np
import pytest

pytest.importorskip("cv2", reason="OpenCV is not installed")

from core.cameras import project
from core.errors import ConfigError
from envs.perception.calibration import CalibrationError, find_board, from_boards, from_table
from envs.perception.camera_files import Lens
from envs.perception.printed_board import PAPERS, POINT, PrintedBoard, pdf
from tests.helpers.drawn_cases import BOARD, FRAME, FRONT, LENS, PLACES, errors, in_hand, on_table
from tools.drawn_boards import Print, resized

TURN = 20.0


def place(at):
    return np.array([*at, 0.0][:3])


def calibrated(pictures, ats, lens=LENS, turn=TURN, board=BOARD):
    seen = [find_board(picture, board, f"{index}.png") for index, picture in enumerate(pictures)]
    points = [board.points(each.corners, place(at), turn) for each, at in zip(seen, ats, strict=True)]
    return from_table(seen, points, lens)


def test_four_pictures_of_a_board_place_a_camera_to_two_millimetres_and_a_fifth_of_a_degree():
    found = calibrated([on_table(at, TURN, seed=i) for i, at in enumerate(PLACES)], PLACES)
    millimetres, degrees = errors(found.camera(LENS))
    assert millimetres < 2
    assert degrees < 0.2
    assert found.place < 0.002
    assert found.pictures == 4


def test_the_board_lies_where_it_is_said_to_lie_and_pixels_are_those_of_the_camera_model():
    at, turn = [0.4, 0.1, 0.08], 130.0
    seen = find_board(on_table(at, turn, noise=0.0, blur=0.4), BOARD, "it")
    true, _ = project(FRONT, FRAME, BOARD.points(seen.corners, place(at), turn))
    off = seen.pixels - true
    assert np.abs(off.mean(0)).max() < 0.05  # a pixel's middle taken for its corner is half a pixel off
    assert np.linalg.norm(off, axis=1).max() < 0.3


def test_the_uncertainty_that_is_told_covers_the_error():
    large = resized(FRONT, 960, 720)
    lens = Lens.ideal(36.0, 960, 720)
    for seed in range(3):
        found = calibrated([on_table((0.44, 0.0), TURN, seed, large)], [(0.44, 0.0)], lens)
        millimetres, degrees = errors(found.camera(lens))
        assert millimetres / 1000 < found.place
        assert degrees < found.direction


def test_a_lens_is_found_and_its_pictures_are_undistorted():
    true = Lens(focal=600.0, middle=[312.0, 246.0], width=640, height=480, distortion=[-0.2, 0.05, 0.001, -0.001, 0.0])
    found = from_boards([find_board(in_hand(seed, true), BOARD, str(seed)) for seed in range(12)], 640, 480)
    assert found.lens.focal == pytest.approx(600, rel=0.005)
    assert found.lens.middle == pytest.approx([312, 246], abs=2.5)
    grid = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 5), np.linspace(-0.3, 0.3, 5), [1.0]), -1).reshape(-1, 3)
    assert np.abs(found.lens.project(grid) - true.project(grid)).max() < 2.0
    picture = on_table((0.44, 0.0), TURN, lens=true)
    straight = find_board(true.undistorted(picture), BOARD, "straight")
    ideal = Lens.ideal(true.fov, 640, 480)
    points = (BOARD.points(straight.corners, place((0.44, 0.0)), TURN) - FRAME.place) @ FRAME.axes.T
    assert np.linalg.norm(straight.pixels - ideal.project(points), axis=1).mean() < 0.2


def refusal(pictures, ats, **keys):
    with pytest.raises(CalibrationError) as refused:
        calibrated(pictures, ats, **keys)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_few_corners_are_refused():
    picture = on_table((0.44, 0.0), TURN)
    picture[:, :330] = 150
    assert re.search(
        r"^0.png: \d+ of the board's 24 corners are seen, and 12 are needed", refusal([picture], [(0.44, 0)])
    )
    assert "0 of the board's 24 corners" in refusal([np.full_like(picture, 150)], [(0.44, 0)])


def test_a_board_nearly_edge_on_is_refused():
    low = type(FRONT)(target=[0.44, 0, 0], distance=0.5, yaw=90, pitch=-16, fov=36, width=1280, height=960)
    lens = Lens.ideal(36.0, 1280, 960)
    assert "edge-on" in refusal([on_table((0.44, 0.0), TURN, camera=low)], [(0.44, 0)], lens=lens)


def test_a_moved_board_is_refused():
    pictures = [on_table((0.44, 0.0), TURN), on_table((0.45, 0.0), TURN, seed=1)]
    assert "moved" in refusal(pictures, [(0.44, 0)] * 2)


def test_a_board_of_another_size_is_refused():
    pictures = [on_table(at, TURN, seed=i) for i, at in enumerate(PLACES)]
    assert "does not fit" in refusal(pictures, PLACES, board=PrintedBoard(square=0.034))


def test_blur_is_refused_and_motion_is_told_from_a_bad_focus():
    near = type(FRONT)(target=[0.44, 0, 0], distance=0.6, yaw=100, pitch=-60, fov=36, width=640, height=480)
    moved = refusal([on_table((0.44, 0.0), 80.0, camera=near, motion=9)], [(0.44, 0)], turn=80.0)
    assert re.search(r"moved while it was taken: its edges are [\d.]+ pixels wide", moved)
    assert "out of focus" in refusal([on_table((0.44, 0.0), 80.0, camera=near, blur=2.5)], [(0.44, 0)], turn=80.0)


def test_a_small_board_seen_from_straight_above_leaves_the_place_uncertain_and_is_refused():
    top = type(FRONT)(target=[0.44, 0, 0.1], distance=1.88, yaw=-90, pitch=-90, fov=25.9, width=640, height=480)
    lens = Lens.ideal(25.9, 640, 480)
    assert "is known to" in refusal([on_table((0.44, 0.0), TURN, camera=top)], [(0.44, 0)], lens=lens)


def test_a_lens_needs_eight_pictures_at_various_angles():
    seen = [find_board(in_hand(seed, LENS, tilt=0.02), BOARD, str(seed)) for seed in range(8)]
    with pytest.raises(CalibrationError, match=r"same angle|is known to"):
        from_boards(seen, 640, 480)
    with pytest.raises(CalibrationError, match="3 pictures show the board"):
        from_boards(seen[:3], 640, 480)


# ---- what is printed


def test_the_pdf_is_the_board_in_true_millimetres():
    pages = pdf(PrintedBoard(square=0.03), "a4").decode("ascii").split("stream\n")[1::2]
    filled = np.array([[float(x) for x in line.split()[:4]] for line in pages[0].splitlines() if line.endswith("re f")])
    left, low, wide, high = POINT * filled.T
    sheet = Print.of_board(PrintedBoard(square=0.03))
    x0, y0 = (np.array(PAPERS["a4"]) - 1000 * sheet.size) / 2
    rows, columns = np.indices(sheet.cells.shape)
    x, y = x0 + 1000 * sheet.side * (columns + 0.5), PAPERS["a4"][1] - y0 - 1000 * sheet.side * (rows + 0.5)
    black = (
        (x[..., None] > left) & (x[..., None] < left + wide) & (y[..., None] > low) & (y[..., None] < low + high)
    ).any(-1)
    assert (black == ~sheet.cells).all()


@pytest.mark.parametrize("paper", PAPERS)
def test_the_board_fits_each_paper_and_a_larger_one_is_refused(paper):
    assert pdf(BOARD, paper).startswith(b"%PDF-1.4")
    with pytest.raises(ConfigError, match=rf"square=0.08 is too large for paper={paper}: at most 0\.0"):
        pdf(PrintedBoard(square=0.08), paper)

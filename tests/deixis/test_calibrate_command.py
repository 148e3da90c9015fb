"""`deixis calibrate`: from pictures to a camera file that other programs take, and bad input in one sentence."""

import numpy as np
import pytest
import yaml

pytest.importorskip("cv2", reason="OpenCV is not installed")

from PIL import Image

from core.composition import compose
from core.overrides import check
from core.schema import read
from deixis import calibrate
from envs.perception.camera_files import read_camera
from envs.sim.robot import read_kinematics
from envs.sim.robot_config import RobotConfig
from human import Camera
from tests.helpers.drawn_cases import FRONT, LENS, ON_GRIPPER, PLACES, at_gripper, errors, on_table
from tests.helpers.refusals import refusal
from tools.drawn_boards import gray

FOV = "fov=36"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def save(name, picture):
    Image.fromarray(picture).save(name)
    return name


def test_pictures_of_the_board_become_a_camera_file_and_an_override_that_composes(folder, capsys):
    names = [save(f"{index}.png", on_table(at, 10.0, seed=index)) for index, at in enumerate(PLACES)]
    calibrate.main(["table", *names, f"at={PLACES}".replace(" ", ""), "turn=10", FOV, "out=front.yaml"])
    file = read_camera(folder / "front.yaml")
    assert errors(file.camera)[0] < 2
    assert file.calibration["pictures"] == 4
    assert file.lens.is_ideal
    said = capsys.readouterr().out
    assert "residual" in said
    override = next(line for line in said.splitlines() if "workspace.cameras.front" in line).split("'")[1]
    check([override])
    composed = read(Camera, compose([override])["workspace"]["cameras"]["front"], "front")
    assert composed == file.camera


def test_poses_of_a_robot_become_a_camera_file(folder):
    kinematics = read_kinematics(read(RobotConfig, compose(["robot=kuka"])["robot"], "robot"))
    rest, rng, rows = kinematics.rest[None], np.random.default_rng(0), []
    down = kinematics.forward(rest).rotation[0]
    from envs.perception.robust_fit import rotation, transform

    for index in range(12):
        goal = rng.uniform([0.36, -0.2, 0.1], [0.54, 0.2, 0.3])[None]
        joints = kinematics.solve(rest, goal, rotation(rng.uniform(-0.4, 0.4, 3)) @ down, 60)
        pose = kinematics.forward(joints)
        upright = transform(
            pose.rotation[0] @ down.T, pose.position[0]
        )  # the marker looks up where the gripper looks down
        save(f"{index}.png", at_gripper(upright, rng))
        rows.append({"picture": f"{index}.png", "joints": joints[0].tolist()})
    (folder / "poses.yaml").write_text(yaml.safe_dump({"robot": "kuka", "poses": rows}))
    calibrate.main(["gripper", "poses.yaml", FOV])
    millimetres, degrees = errors(read_camera(folder / "front.yaml").camera)
    assert millimetres < 4
    assert degrees < 0.4


def test_positions_alone_will_do_where_the_marker_was_measured(folder, monkeypatch, capsys):
    rng, rows = np.random.default_rng(1), []
    for index in range(12):
        frame = np.eye(4)
        frame[:3, 3] = rng.uniform([0.36, -0.2, 0.1], [0.54, 0.2, 0.3])
        save(f"{index}.png", at_gripper(frame, rng))
        rows.append({"picture": f"{index}.png", "position": frame[:3, 3].tolist()})
    (folder / "poses.yaml").write_text(yaml.safe_dump({"poses": rows}))
    offset = f"offset={ON_GRIPPER[:3, 3].round(4).tolist()}".replace(" ", "")
    calibrate.main(["gripper", "poses.yaml", FOV, offset, "out=it.yaml"])
    assert errors(read_camera(folder / "it.yaml").camera)[0] < 4
    assert "has no rotation" in refusal(calibrate.cli, monkeypatch, capsys, "gripper", "poses.yaml", FOV)


def test_the_board_is_written_as_a_pdf(folder, capsys):
    calibrate.main(["board"])
    assert (folder / "board.pdf").read_bytes().startswith(b"%PDF")
    assert capsys.readouterr().out == "wrote board.pdf\n"


def test_bad_input_is_refused_in_one_sentence(folder, monkeypatch, capsys):
    save("board.png", on_table((0.44, 0.0)))
    save("small.png", np.zeros((100, 100, 3), np.uint8))
    save("black.png", np.zeros((480, 640, 3), np.uint8))
    save("empty.png", gray(FRONT))
    (folder / "notes.png").write_text("no picture")
    (folder / "lens.yaml").write_text("lens: {focal: 700, middle: [160, 120], width: 320, height: 240}\n")
    (folder / "poses.yaml").write_text("robot: kuka\nposes: [{picture: board.png, joints: [0, 1]}]\n")
    (folder / "front.yaml").write_text("")
    (folder / "away.yaml").write_text("poses: [{picture: ../board.png, position: [0, 0, 0], rotation: [0, 0, 0, 1]}]\n")
    at, out = "at=[0.44,0.0]", "out=it.yaml"
    for words, said in [
        ((), "an action is missing or not known"),
        (("tabel",), "did you mean 'table'?"),
        (("table", at, FOV, out), "needs pictures"),
        (("table", "board.png", at, FOV), "out=front.yaml is there already"),
        (("table", "board.png", at, out), "give the camera's lens"),
        (("table", "board.png", at, FOV, "lens=lens.yaml", out), "give the camera's lens"),
        (("table", "board.png", at, "lens=lens.yaml", out), "pictures of 320 x 240 pixels, and these have 640 x 480"),
        (("table", "board.png", FOV, out), "where is the board?"),
        (("table", "board.png", FOV, "at=[0.4]", out), "at=[0.4] must be [x,y]"),
        (("table", "board.png", FOV, "at=[[0.4,0],[0.5,0]]", out), "has 2 entries, and there are 1 pictures"),
        (("table", "board.png", FOV, at, "turn=north", out), "turn=north must be degrees"),
        (("table", "board.png", FOV, at, "trun=3", out), "did you mean 'turn'?"),
        (("table", "board.png", "small.png", FOV, at, out), "small.png has 100 x 100 pixels"),
        (("table", "black.png", FOV, at, out), "black.png is black"),
        (("table", "empty.png", FOV, at, out), "empty.png shows a single colour"),
        (("table", "notes.png", FOV, at, out), "notes.png is no picture that can be read"),
        (("table", "nothing.png", FOV, at, out), "nothing.png cannot be read: No such file"),
        (("gripper", "poses.yaml", FOV, out), "joints=[0.0, 1.0] must be 7 angles"),
        (("gripper", "front.yaml", FOV, out), "must have poses"),
        (("gripper", "away.yaml", FOV, out), "picture=../board.png must be in the folder of this file"),
        (("lens", "board.png", out), "1 pictures show the board"),
        (("board", "out=board.txt"), "must end in .pdf"),
    ]:
        assert said in refusal(calibrate.cli, monkeypatch, capsys, *words)
    assert not (folder / "it.yaml").exists()


def test_a_lens_file_is_no_camera_file(folder):
    (folder / "lens.yaml").write_text("lens: {focal: 700, middle: [160, 120], width: 320, height: 240}\n")
    with pytest.raises(ValueError, match="does not say where its camera is: find that with deixis calibrate"):
        read_camera(folder / "lens.yaml")
    assert LENS.is_ideal

"""Copies of URDFs follow the content of what they are made from, and leave nothing in the temporary directory."""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet as bullet
import pytest

from core.file_cache import cache_folder
from envs.sim.robot import load, read_kinematics
from envs.sim.robot_config import urdf_path
from tests.helpers.env_cases import config_of

ROOT = Path(__file__).resolve().parents[3]
TINY = ["total_frames=128", "collector.workers=2", "collector.worlds=4", "algo.minibatch=64", "eval.episodes=2"]
TINY += ["eval.worlds=2", "eval.interval_episodes=2", "eval.video_episodes=0", "logger=[]", "task.max_steps=8"]
# PyTorch's own folder, one for each user, which every program with an optimizer has
OF_TORCH = "torchinductor_"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "deixis"


def at_zero(config):
    """(3,) where PyBullet has the gripper's link at zero angles, metres."""
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(config, client, visuals=False, magnet=bool(config.magnet))
        links = [bullet.getJointInfo(body, i, client)[12].decode() for i in range(bullet.getNumJoints(body, client))]
        return np.array(bullet.getLinkState(body, links.index(config.tip), physicsClientId=client)[4])
    finally:
        bullet.disconnect(client)


def magnet_at_zero(config):
    """(4,) the quaternion of the magnet's link at zero angles."""
    client = bullet.connect(bullet.DIRECT)
    try:
        body = load(config, client, visuals=False, magnet=True)
        return np.array(bullet.getLinkState(body, bullet.getNumJoints(body, client) - 1, physicsClientId=client)[5])
    finally:
        bullet.disconnect(client)


def own(folder, change=lambda text: text):
    """A kuka whose URDF is a file of the user's own."""
    config = config_of("robot=kuka", "task=nl_pick_and_place").robot
    path = urdf_path(config)
    shutil.copytree(path.parent / "meshes", folder / "meshes")
    (folder / "model.urdf").write_text(change(path.read_text()))
    return replace(config, package="file", urdf=str(folder / "model.urdf"))


def longer(text):
    """The URDF with a longer link."""
    assert 'xyz="0 0 0.1575"' in text
    return text.replace('xyz="0 0 0.1575"', 'xyz="0 0 0.2575"')


def test_two_robots_whose_files_have_the_same_name_are_each_built_from_their_own(tmp_path):
    one, other = (own(tmp_path / name, change) for name, change in (("a", lambda text: text), ("b", longer)))
    first, second, again = at_zero(one), at_zero(other), at_zero(one)
    assert second[2] - first[2] == pytest.approx(0.1, abs=1e-6)
    assert (first == again).all()


def test_a_urdf_that_was_edited_is_read_again(tmp_path):
    config = own(tmp_path / "a")
    before = at_zero(config), read_kinematics(config).forward(np.zeros((1, 7))).position[0]
    path, stat = Path(config.urdf), os.stat(config.urdf)
    path.write_text(longer(path.read_text()))
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # as many bytes, and the same date
    after = at_zero(config), read_kinematics(config).forward(np.zeros((1, 7))).position[0]
    for one, other in zip(before, after, strict=True):
        assert other[2] - one[2] == pytest.approx(0.1, abs=1e-6)


def test_robots_that_differ_in_the_direction_of_the_magnet_have_magnets_of_their_own():
    config = config_of("robot=kuka", "task=nl_pick_and_place").robot
    turned = replace(config, approach=[1.0, 0.0, 0.0])
    first, second, again = (magnet_at_zero(each) for each in (config, turned, config))
    assert np.abs(first - second).max() > 0.1
    assert (first == again).all()


@pytest.mark.parametrize("robot", ["kuka", "panda", "xarm7"])
def test_a_robot_loads_although_the_copies_were_deleted(robot):
    config = config_of(f"robot={robot}", "task=nl_pick_and_place").robot
    first = at_zero(config)
    shutil.rmtree(cache_folder(), ignore_errors=True)
    assert (at_zero(config) == first).all()


def test_a_robot_loads_where_the_home_cannot_be_written_to(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    config = config_of("robot=xarm7", "task=nl_pick_and_place").robot
    assert np.isfinite(at_zero(config)).all()


@pytest.mark.slow
def test_a_training_leaves_nothing_in_the_temporary_directory(tmp_path, home):
    command = [sys.executable, "train.py", "robot=xarm7", "task=nl_reach_gesture", *TINY]
    command += [f"hydra.run.dir={tmp_path / 'run'}"]
    with tempfile.TemporaryDirectory(prefix="d") as temporary:  # a short path, as those of sockets must be
        environment = {**os.environ, "TMPDIR": temporary}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        left = [name for name in os.listdir(temporary) if not name.startswith(OF_TORCH)]
    assert done.returncode == 0, done.stderr
    assert left == []
    assert any(path.name.startswith("person-") for path in home.iterdir())

"""Robots whose URDF is a file of the user's own: a copy of a shipped robot, changed in one place."""

from dataclasses import replace
from pathlib import Path

from envs.sim.robot_config import urdf_path
from tests.helpers.env_cases import config_of


def own_robot(folder, robot="kuka", change=lambda text: text, **fields):
    """The config of a robot with a URDF of its own in `folder`. change: of the URDF's text; it may return bytes."""
    config = config_of(f"robot={robot}", "task=nl_pick_and_place").robot
    path = urdf_path(config)
    folder.mkdir(parents=True, exist_ok=True)
    for beside in path.parent.iterdir():
        if beside.is_dir():
            (folder / beside.name).symlink_to(beside)
    content = change(path.read_text())
    whole = content if isinstance(content, bytes) else content.encode()
    (folder / path.name).write_bytes(whole)
    return replace(config, package="file", urdf=str(folder / path.name), **fields)


def overrides(config):
    """The words of a command line that name the robot's URDF."""
    return [f"robot={config.name}", "robot.package=file", f"robot.urdf={Path(config.urdf)}"]


def swapped(text, one, other):
    """The text with one string in place of another, which it holds."""
    assert one in text, one
    return text.replace(one, other)

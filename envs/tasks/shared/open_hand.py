"""The open hand of a person as an object of a scene: where it can be, and what lies on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.furniture import SIZE
from envs.sim.workspace import WorkspaceConfig
from envs.tasks.shared.task_config import TaskConfig
from envs.tasks.shared.types import Array, Column
from human import HumanConfig, Unreachable, read_arm
from human.arms import OFFERING_JOINTS, OfferingArm
from language import COLORS, HAND, NOUNS, Placed, Scene

HAND_NUMBER = list(NOUNS).index(HAND)
HAND_COLOR = list(COLORS).index("pink")  # of the hand's row: the named colour that is nearest to skin
HAND_COLUMN = Column("is the hand", 0.0, 1.0)
LEVEL = 0.015  # metres over or under its place on the palm at which an object lies on it
OVER = 0.15  # metres over the palm that a gripper needs to bring an object
HALF = np.array(SIZE[:2]) / 2  # metres from the middle of the palm to its edges


def lies_on_palm(offset: Array) -> NDArray[np.bool_]:
    """(...) whether objects lie on a palm. offset: (..., 3) metres from where they lie on its middle."""
    return np.all(np.abs(offset[..., :2]) <= HALF, axis=-1) & (np.abs(offset[..., 2]) <= LEVEL)


def with_hand(placed: Placed, place: Array) -> Placed:
    """Return the scene with a hand as its last object, which nothing moves. place: (3,) of its palm, metres."""
    scene = placed.scene
    joined = Scene.from_arrays(
        nouns=np.append(scene.nouns, HAND_NUMBER),
        colors=np.append(scene.colors, HAND_COLOR),
        positions=np.concatenate((scene.positions, place[None])),
        size=np.append(scene.sizes, scene.sizes[0]),
        targets=np.append(scene.targets, False),
        viewpoint=scene.viewpoint,
    )
    return Placed(joined, np.append(placed.yaw, 0.0), np.append(placed.fixed, True))


def palm_region(config: TaskConfig, workspace: WorkspaceConfig, better: str) -> Array:
    """(2, 3) lowest and highest corner of where the workspace's person holds an open hand, metres.

    Args:
        config: of the task.
        workspace: with a person or without.
        better: a workspace that has one, for the message.

    Raises:
        ConfigError: nobody holds out a hand, or gripper or arm do not reach it everywhere.
    """
    human = workspace.human
    if human is None or not human.palm:
        raise ConfigError(
            f"task.name={config.name} needs a person who holds out an open hand, and "
            f"workspace.name={workspace.name} has none: choose workspace={better}"
        )
    region = np.reshape(human.palm, (3, 2)).T
    low, high = np.reshape(workspace.gripper_box, (3, 2)).T
    if (region[0] < low).any() or (region[1] + [0.0, 0.0, OVER] > high).any():
        raise ConfigError(
            f"workspace.human.palm={human.palm} must lie in workspace.gripper_box={list(workspace.gripper_box)}, "
            f"{OVER} below its top: choose another robot, or another palm"
        )
    _check_arm(human, region)
    return region


def _check_arm(human: HumanConfig, region: Array) -> None:
    """Raise ConfigError unless this person can hold an open hand at all corners of region (2, 3), metres."""
    arm = read_arm(human).model.other
    if arm is None:
        raise ConfigError(
            f"workspace.human.urdf={human.urdf} has no left arm with the joints {', '.join(OFFERING_JOINTS)}"
        )
    try:
        for corner in np.stack(np.meshgrid(*region.T), axis=-1).reshape(-1, 3):
            OfferingArm(arm).solve(corner)
    except Unreachable as error:
        raise ConfigError(f"workspace.human.palm={human.palm}: {error}") from None

"""The interface of an arm: joint positions in, joint targets out, a gripper. It knows no simulator and no hardware.

An adapter is a subclass of `Arm` with its entry in `ARMS` and a frozen dataclass of settings. Every target that it gets
has passed `deployment.safety.Safety`.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError, did_you_mean
from core.safe_files import FileError, parse_yaml
from core.schema import Checked, read
from envs.config import EnvConfig

Array = NDArray[np.float64]
NEVER = "never run on hardware"


class ArmError(RuntimeError):
    """An arm that cannot be reached, or that answers no more. The text is the whole message."""


@dataclass(frozen=True)
class ArmState:
    """What an arm measures.

    time: when it was measured, seconds of the arm's clock. angles: (J,) radians, in the order of the robot's joints.
    opening: of the gripper, from 0 (shut; a magnet that is on) to 1. holds: whether the gripper senses that it holds
    something; None: it has no such sensor.
    """

    time: float
    angles: Array
    opening: float
    holds: bool | None = None


class Clock:
    """The time of this machine, seconds."""

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))


class Arm(ABC):
    """An arm of J joints with a gripper.

    Calls return at once; none waits for the arm to get anywhere. After `disconnect` nothing else is called.

    Attributes:
        settings: the dataclass of its settings, `arm.<key>=<value>` on the command line; all fields have defaults.
        on_hardware: where, when and by whom it was run on an arm of metal; NEVER until somebody has.
        clock: of `ArmState.time`.

    Args:
        config: its settings.
        setup: of the environment whose policy drives the arm; `setup.robot` names the joints.

    Raises:
        ConfigError: the robot is not one that the adapter can drive.
    """

    settings: ClassVar[type[Checked]]
    on_hardware: ClassVar[str] = NEVER

    def __init__(self, config: Any, setup: EnvConfig) -> None:
        self.config, self.setup, self.clock = config, setup, Clock()

    @abstractmethod
    def connect(self) -> None:
        """Connect, and let the motors hold the arm where it is. Raises ArmError."""

    @abstractmethod
    def observe(self) -> ArmState | None:
        """Return the newest measurement, None if there is none since the last call. Raises ArmError."""

    @abstractmethod
    def command(self, angles: Array, opening: float) -> None:
        """Send the motors to angles (J,), radians, and the gripper to `opening` in [0, 1]. Raises ArmError."""

    @abstractmethod
    def hold(self) -> None:
        """Stop where the arm is, with the gripper as it is. Raises ArmError.

        Called again in each control period while the arm is to hold: it stays where the first call found it.
        """

    @abstractmethod
    def disconnect(self) -> None:
        """End the connection; the arm must not fall. Idempotent."""


ARMS = {  # the value of arm=... -> module and class of its adapter
    "sim": "deployment.twin:TwinArm",
    "lerobot": "deployment.lerobot_arm:LeRobotArm",
    "franky": "deployment.franky_arm:FrankyArm",
}


def make_arm(name: str, settings: Mapping[str, Any], setup: EnvConfig) -> Arm:
    """Make an arm that is not connected yet.

    Args:
        name: a key of ARMS.
        settings: values of its settings by name; the others have their defaults.
        setup: of the environment.

    Raises:
        ConfigError: there is no such arm, a setting is wrong, or the arm does not fit the robot.
    """
    if name not in ARMS:
        raise ConfigError(f"arm={name} is not an arm{did_you_mean(name, ARMS)}")
    module, _, adapter = ARMS[name].partition(":")
    arm: type[Arm] = getattr(import_module(module), adapter)
    return arm(read(arm.settings, {key: _plain(key, value) for key, value in settings.items()}, "arm"), setup)


def _plain(key: str, value: Any) -> Any:
    """Return a value of a command line, of which lists are still text. Raises ConfigError."""
    if not (isinstance(value, str) and value.startswith("[")):
        return value
    try:
        return parse_yaml(value.encode())
    except FileError as error:
        raise ConfigError(f"arm.{key}={value} {error}") from None

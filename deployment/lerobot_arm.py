"""`arm=lerobot`: an arm that LeRobot drives, the SO-101 first. Never run on hardware.

It was only run over servos that a test imitates byte by byte, with LeRobot's own follower and bus between. LeRobot
begins at Python 3.12.
"""

from __future__ import annotations

import dataclasses
import math
import pkgutil
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import ConfigError, did_you_mean
from core.schema import Checked, any_path, one_of, text, within
from deployment.arm import Arm, ArmError, ArmState, Array
from envs.config import EnvConfig
from envs.tasks import TASKS

UNITS = {"degrees": 180 / math.pi, "radians": 1.0}  # of a radian
TRIES = 5  # times that it asks where the motors are before it gives up to hold them there
FULL = 100.0  # LeRobot's number for jaws at the end of their range


@dataclass(frozen=True, kw_only=True)
class LeRobotConfig(Checked):
    """Settings of an arm of LeRobot.

    type, port, id: as of LeRobot's programs: --robot.type, --robot.port, --robot.id; the id names the calibration.
    calibration: the directory of the calibrations; None: LeRobot's own. motors: LeRobot's names of the joints, in the
    robot's order; []: they have the robot's names. unit: of LeRobot's angles. sign, zero: of each joint; LeRobot's
    angle is sign * angle + zero, in its unit; []: 1 and 0, as for an SO-101 whose whole range was swept when it was
    calibrated: both put the zero into its middle. gripper: LeRobot's name of the jaws' motor; "": there is none. shut,
    open: LeRobot's numbers, 0 to 100, for a gripper that is shut and open.
    """

    type: str = text(r"\w{1,100}", "a name of LeRobot", default="so101_follower")
    port: str = text(r"[^\x00-\x1f]{0,200}", "a serial port", default="/dev/ttyACM0")
    id: str = text(r"[\w.-]{1,100}", "a name", default="deixis")
    calibration: str | None = any_path(default=None)
    motors: list[str] = text(r"\w{1,100}", "a name of a motor", default=())
    unit: str = one_of(*UNITS, default="degrees")
    sign: list[float] = within(-1, 1, default=())
    zero: list[float] = within(-360, 360, default=())
    gripper: str = text(r"\w{0,100}", "a name of a motor", default="gripper")
    shut: float = within(0, FULL, default=0.0)
    open: float = within(0, FULL, default=58.0)


class MotorUnits:
    """Turns angles of the URDF into LeRobot's numbers, and back.

    Args:
        config: signs and zeros.
        joints: of the robot.

    Raises:
        ConfigError: a list has not one entry for each joint, a sign is neither 1 nor -1, or shut and open are the same.
    """

    def __init__(self, config: LeRobotConfig, joints: list[str]) -> None:
        self.motors = list(config.motors) or list(joints)
        self.gripper = config.gripper
        sign, zero = list(config.sign) or [1.0] * len(joints), list(config.zero) or [0.0] * len(joints)
        for key, values in (("motors", self.motors), ("sign", sign), ("zero", zero)):
            if len(values) != len(joints):
                raise ConfigError(f"arm.{key}={values} must have {len(joints)} entries, one for each of {joints}")
        if any(abs(each) != 1 for each in sign):
            raise ConfigError(f"arm.sign={sign} must be 1 or -1 for each joint")
        if config.shut == config.open:
            raise ConfigError(f"arm.shut={config.shut:g} and arm.open={config.open:g} must differ")
        self._scale, self._zero = np.array(sign) * UNITS[config.unit], np.array(zero)
        self._shut, self._open = config.shut, config.open

    @property
    def keys(self) -> list[str]:
        """LeRobot's keys: of the joints, then of the gripper."""
        return [f"{motor}.pos" for motor in (*self.motors, *([self.gripper] if self.gripper else []))]

    def to_motors(self, angles: Array, opening: float) -> dict[str, float]:
        """Return LeRobot's numbers by key. angles: (J,) radians. opening: in [0, 1]."""
        jaws = self._shut + float(np.clip(opening, 0, 1)) * (self._open - self._shut)
        values = [*(np.asarray(angles) * self._scale + self._zero).tolist(), jaws]
        return dict(zip(self.keys, values, strict=False))

    def from_motors(self, numbers: dict[str, Any]) -> tuple[Array, float]:
        """Return angles (J,), radians, and the opening in [0, 1]. numbers: LeRobot's, by key."""
        values = np.array([float(numbers[key]) for key in self.keys])
        angles = (values[: len(self.motors)] - self._zero) / self._scale
        if not self.gripper:
            return angles, 1.0
        return angles, float(np.clip((values[-1] - self._shut) / (self._open - self._shut), 0, 1))


class LeRobotArm(Arm):
    """An arm behind a `Robot` of LeRobot. Its motors go on holding after `disconnect`, until they lose their power."""

    settings = LeRobotConfig

    def __init__(self, config: LeRobotConfig, setup: EnvConfig) -> None:
        super().__init__(config, setup)
        self._units = MotorUnits(config, setup.robot.joints)
        grips = TASKS[setup.task.name].traits.grips
        if grips and config.gripper and setup.gripper.of(setup.robot) == "magnet":
            raise ConfigError(f"gripper=magnet: arm=lerobot has jaws, as its policy must have for {setup.task.name}")
        self._robot = _make_robot(config)
        if missing := set(self._units.keys) - set(self._robot.action_features):
            known = ", ".join(sorted(self._robot.action_features))
            raise ConfigError(f"arm.type={config.type} has no {', '.join(sorted(missing))}; it has {known}")
        self._still = False  # whether it was told to stay where it is

    def connect(self) -> None:
        """Connect. The motors' targets are set to where they are before they get torque: a former one may be far."""
        config, bus = self.config, getattr(self._robot, "bus", None)
        try:
            if bus is not None:
                bus.connect()
                bus.sync_write("Goal_Position", bus.sync_read("Present_Position", normalize=False), normalize=False)
                bus.disconnect(disable_torque=False)
            self._robot.connect(calibrate=False)
            calibrated = self._robot.is_calibrated
        except (OSError, RuntimeError, ValueError) as error:
            raise ArmError(f"arm.port={config.port}: {_line(error)}") from None
        if not calibrated:
            self.disconnect()
            options = f"--robot.type={config.type} --robot.port={config.port} --robot.id={config.id}"
            raise ArmError(f"arm.id={config.id} is not calibrated, or with other motors: lerobot-calibrate {options}")
        self.hold()

    def observe(self) -> ArmState | None:
        """Read the motors. A message that was lost gives None."""
        numbers = self._read()
        return None if numbers is None else ArmState(self.clock.now(), *self._units.from_motors(numbers))

    def command(self, angles: Array, opening: float) -> None:
        self._still = False
        self._send(self._units.to_motors(angles, opening))

    def hold(self) -> None:
        if self._still:
            return
        numbers = next(filter(None, (self._read() for _ in range(TRIES))), None)
        if numbers is None:
            raise ArmError(f"arm.port={self.config.port} does not answer")
        self._send({key: float(numbers[key]) for key in self._units.keys})
        self._still = True

    def _read(self) -> dict[str, Any] | None:
        """Return LeRobot's numbers by key, None if a message was lost. Raises ArmError."""
        try:
            return self._robot.get_observation()
        except ConnectionError:
            return None
        except (OSError, RuntimeError, ValueError) as error:
            raise ArmError(f"arm.port={self.config.port} answers no more: {_line(error)}") from None

    def _send(self, numbers: dict[str, float]) -> None:
        try:
            self._robot.send_action(numbers)
        except (OSError, RuntimeError, ValueError) as error:
            raise ArmError(f"arm.port={self.config.port} takes no commands: {_line(error)}") from None

    def disconnect(self) -> None:
        try:
            if self._robot.is_connected:
                self._robot.disconnect()
        except (OSError, RuntimeError):
            pass  # the cable was pulled: there is nothing to end


def _make_robot(config: LeRobotConfig) -> Any:
    """Return LeRobot's robot, which is not connected. Raises ConfigError."""
    try:
        import lerobot.robots as robots
        from lerobot.robots.utils import make_robot_from_config
        from lerobot.utils.import_utils import register_third_party_plugins
    except ImportError as error:
        raise ConfigError(_missing(error)) from None
    for module in pkgutil.iter_modules(robots.__path__):
        if module.ispkg:
            import_module(f"lerobot.robots.{module.name}")
    register_third_party_plugins()
    known = robots.RobotConfig.get_known_choices()
    if config.type not in known:
        raise ConfigError(f"arm.type={config.type} is not a robot of LeRobot{did_you_mean(config.type, known)}")
    place = Path(config.calibration) if config.calibration else None
    wanted: dict[str, Any] = {"id": config.id, "calibration_dir": place, "port": config.port}
    wanted |= {"use_degrees": True, "disable_torque_on_disconnect": False}
    fields = {field.name for field in dataclasses.fields(known[config.type])}
    try:
        return make_robot_from_config(known[config.type](**{key: wanted[key] for key in wanted if key in fields}))
    except (ImportError, TypeError, ValueError) as error:
        raise ConfigError(f"arm.type={config.type}: {_line(error)}") from None


def _missing(error: ImportError) -> str:
    """Return the sentence about LeRobot, or a part of it, that is not installed."""
    name = (error.name or str(error)).partition(".")[0]
    if sys.version_info < (3, 12):
        return f"arm=lerobot needs {name}, which begins at Python 3.12; this is {sys.version.split()[0]}"
    return f'arm=lerobot needs {name}, which is not installed: pip install -e ".[lerobot]"'


def _line(error: Exception) -> str:
    """Return the text of an error in one line."""
    return " ".join(str(error).split()) or type(error).__name__

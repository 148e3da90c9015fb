"""`arm=franky`: a Franka (FR3) that franky drives. Never run on hardware.

It was only run against franky-sim, which speaks the protocol of the arm over MuJoCo, and enforces none of its limits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.errors import ConfigError
from core.schema import Checked, text, within
from deployment.arm import Arm, ArmError, ArmState, Array
from envs.config import EnvConfig

JOINTS = re.compile(r"(panda|fr3)\w*_joint[1-7]")
# rad, of Franka's data sheet for the FR3, which is narrower than the Panda's in some joints
LOWEST = np.array([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159])
HIGHEST = np.array([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159])
CHANGED = 0.02  # of the gripper's opening: smaller changes are not sent
HALF = 0.5  # opening below which the gripper grasps, with its force, rather than moves


@dataclass(frozen=True, kw_only=True)
class FrankyConfig(Checked):
    """Settings of a Franka.

    host: its address. dynamics: share of the arm's greatest speed, acceleration and jerk. force: of a grasp, newtons.
    finger_speed: metres in a second.
    """

    host: str = text(r"[\w.:-]{1,253}", "a host name or address", default="172.16.0.2")
    dynamics: float = within(0.01, 1, default=0.3)
    force: float = within(1, 70, default=20.0)
    finger_speed: float = within(0.01, 0.2, default=0.1)


class FrankyArm(Arm):
    """A Franka. Its own controller interpolates between the targets, and holds the arm after `disconnect`."""

    settings = FrankyConfig

    def __init__(self, config: FrankyConfig, setup: EnvConfig) -> None:
        super().__init__(config, setup)
        joints = setup.robot.joints
        if len(joints) != len(LOWEST) or not all(map(JOINTS.fullmatch, joints)):
            raise ConfigError(f"robot={setup.robot.name}: arm=franky needs a policy for a Franka: robot=panda")
        try:
            import franky
        except ImportError:
            raise ConfigError(
                "arm=franky needs franky, which is not installed: pip install franky-control==2.0.0"
            ) from None
        self._franky: Any = franky
        self._robot: Any = None
        self._gripper: Any = None
        self._opening = np.nan  # last commanded
        self._motion: Any = None  # of the gripper: it takes no command before the last one has ended
        self._still = True
        self._measured = -1  # milliseconds of the arm's clock at the last measurement
        self._lost = ""  # why it answers no more: franky then returns what it knew last

    def connect(self) -> None:
        franky, config = self._franky, self.config
        try:
            self._robot = franky.Robot(config.host, realtime_config=franky.RealtimeConfig.Ignore)
            self._robot.recover_from_errors()
            self._robot.relative_dynamics_factor = config.dynamics
            self._gripper = franky.Gripper(config.host)
        except franky.Exception as error:
            self._robot = None
            raise ArmError(f"arm.host={config.host}: {_line(error)}") from None

    def observe(self) -> ArmState | None:
        if self._lost:
            raise ArmError(self._lost)
        try:
            if self._robot.has_errors:
                raise ArmError(f"the arm stopped by itself: {self._robot.state.current_errors}")
            state, gripper = self._robot.state, self._gripper.state
        except self._franky.Exception as error:
            self._lost = f"arm.host={self.config.host} answers no more: {_line(error)}"
            raise ArmError(self._lost) from None
        before, self._measured = self._measured, state.time.to_msec()
        if self._measured == before:
            return None
        opening = float(np.clip(gripper.width / gripper.max_width, 0, 1)) if gripper.max_width else 1.0
        return ArmState(self.clock.now(), np.array(state.q), opening, bool(gripper.is_grasped))

    def command(self, angles: Array, opening: float) -> None:
        target = self._franky.JointState(np.clip(angles, LOWEST, HIGHEST).tolist())
        self._move(self._franky.JointMotion(target, return_when_finished=False))
        self._still = False
        if not abs(opening - self._opening) < CHANGED:
            self._grip(opening)

    def _grip(self, opening: float) -> None:
        """Send the gripper to an opening in [0, 1], once it has ended its last motion.

        Below HALF it grasps what is between its fingers.
        """
        config, widest = self.config, self._gripper.max_width
        try:
            if self._motion is not None:
                if not self._motion.wait(0.0):
                    return
                self._motion.get()
            if opening < HALF:
                self._motion = self._gripper.grasp_async(0.0, config.finger_speed, config.force, widest, widest)
            else:
                self._motion = self._gripper.move_async(opening * widest, config.finger_speed)
            self._opening = opening
        except self._franky.Exception as error:
            self._motion = None
            raise ArmError(f"the gripper takes no commands: {_line(error)}") from None

    def hold(self) -> None:
        if not self._still:
            self._move(self._franky.JointStopMotion())
            self._still = True

    def _move(self, motion: Any) -> None:
        try:
            self._robot.move(motion, asynchronous=True)
        except self._franky.Exception as error:
            raise ArmError(f"arm.host={self.config.host} takes no commands: {_line(error)}") from None

    def disconnect(self) -> None:
        if self._robot is None:
            return
        try:
            self._robot.join_motion(1.0)
            self._robot.stop()
        except self._franky.Exception:
            pass  # the connection is lost: there is nothing to end
        finally:
            self._robot = self._gripper = None


def _line(error: Exception) -> str:
    """Return the text of an error in one line."""
    return " ".join(str(error).split()) or type(error).__name__

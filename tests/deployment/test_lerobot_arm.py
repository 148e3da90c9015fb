"""`arm=lerobot`: its units everywhere; with LeRobot, its follower over servos that are imitated byte by byte."""

from __future__ import annotations

import sys
import time
from contextlib import closing

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from deployment.arm import NEVER, Arm, ArmError, make_arm
from deployment.connecting import ArmChoice, connect
from deployment.lerobot_arm import LeRobotConfig, MotorUnits
from envs import read_env
from envs.experts import expert
from envs.sim.robot import read_kinematics

JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
ANGLES = np.array([0.3, -0.2, 0.25, 1.2, -0.4])  # radians
TICK = 2 * np.pi / 4095  # radians


def setup_of(*words):
    return read_env(compose(["robot=so_arm", *words]))


def test_angles_are_degrees_and_the_gripper_a_share_of_its_range():
    numbers = MotorUnits(LeRobotConfig(), JOINTS).to_motors(np.array([np.pi / 2, 0.0, 0.0, 0.0, -np.pi]), 1.0)
    assert numbers["shoulder_pan.pos"] == pytest.approx(90.0)
    assert numbers["wrist_roll.pos"] == pytest.approx(-180.0)
    assert numbers["gripper.pos"] == pytest.approx(58.0)


@pytest.mark.parametrize(
    "settings", [{}, {"sign": [1, -1, 1, -1, 1], "zero": [0, 90, 0, -10, 5]}, {"unit": "radians", "shut": 100.0}]
)
def test_what_is_sent_is_read_back(settings):
    units = MotorUnits(LeRobotConfig(**settings), JOINTS)
    angles, opening = units.from_motors(units.to_motors(ANGLES, 0.25))
    np.testing.assert_allclose(angles, ANGLES)
    assert opening == pytest.approx(0.25)


def test_lists_of_the_command_line_are_read(monkeypatch):
    monkeypatch.setattr("deployment.lerobot_arm.LeRobotArm.__init__", Arm.__init__)
    read = make_arm("lerobot", {"sign": "[1, -1, 1, 1, 1]", "motors": "[a, b]", "zero": []}, setup_of()).config
    assert (read.sign, read.motors, read.zero) == ([1, -1, 1, 1, 1], ["a", "b"], [])
    with pytest.raises(ConfigError, match=r"arm.sign=\[1, -1 is not YAML"):
        make_arm("lerobot", {"sign": "[1, -1"}, setup_of())


def test_an_arm_without_jaws_has_no_key_for_them():
    units = MotorUnits(LeRobotConfig(gripper="", motors=list("abcde")), JOINTS)
    assert units.to_motors(np.zeros(5), 0.0) == {f"{name}.pos": 0.0 for name in "abcde"}
    assert units.from_motors(dict.fromkeys(units.keys, 180.0))[1] == 1.0


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"sign": [1, 1]}, r"arm.sign=\[1, 1\] must have 5 entries"),
        ({"sign": [1, 1, 1, 1, 0.5]}, "must be 1 or -1"),
        ({"motors": ["a"]}, r"arm.motors=\['a'\] must have 5 entries"),
        ({"shut": 40.0, "open": 40.0}, "must differ"),
    ],
)
def test_settings_that_do_not_fit_are_told(settings, told):
    with pytest.raises(ConfigError, match=told):
        MotorUnits(LeRobotConfig(**settings), JOINTS)


def test_without_lerobot_one_sentence_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "lerobot.robots", None)
    monkeypatch.setitem(sys.modules, "lerobot", None)
    wanted = "begins at Python 3.12" if sys.version_info < (3, 12) else r'pip install -e "\.\[lerobot\]"'
    with pytest.raises(ConfigError, match=f"arm=lerobot needs lerobot, which .*{wanted}"):
        make_arm("lerobot", {}, setup_of())


def test_a_magnet_is_no_jaws():
    with pytest.raises(ConfigError, match="gripper=magnet: arm=lerobot has jaws"):
        make_arm("lerobot", {}, setup_of("task=nl_pick_and_place"))


# ---- LeRobot's follower itself


@pytest.fixture
def bus(tmp_path):
    pytest.importorskip("lerobot.robots.so_follower", reason="LeRobot begins at Python 3.12")
    pytest.importorskip("scservo_sdk", reason="Feetech's library comes with lerobot[feetech]")
    from tests.helpers.feetech_servos import ServoBus

    with closing(ServoBus()) as made:
        made.calibrate(tmp_path, "deixis")
        yield made


@pytest.fixture
def arm(bus, tmp_path):
    made = make_arm("lerobot", {"port": bus.port, "calibration": str(tmp_path)}, setup_of())
    be_patient(made)
    yield made
    made.disconnect()


def be_patient(arm):
    """Wait longer for each answer than Feetech's library does, since the machine may be busy with other tests."""
    handler = arm._robot.bus.port_handler
    usual = handler.setPacketTimeout

    def patient(length):
        usual(length)
        handler.packet_timeout += 500  # milliseconds

    handler.setPacketTimeout = patient


def drive(arm):
    """Observe and command for a while."""
    for _ in range(20):
        arm.observe()
        arm.command(ANGLES, 1.0)


def wait(arm, seconds=1.0):
    time.sleep(seconds)
    return arm.observe()


def test_the_follower_goes_where_it_is_sent(arm, bus):
    assert type(arm).on_hardware == NEVER
    arm.connect()
    np.testing.assert_allclose(arm.observe().angles, 0.0, atol=2 * TICK)
    arm.command(ANGLES, 1.0)
    state = wait(arm)
    np.testing.assert_allclose(state.angles, ANGLES, atol=2 * TICK)
    assert state.opening == pytest.approx(1.0, abs=0.01)
    assert bus.position("shoulder_pan") == pytest.approx(2047 + ANGLES[0] / TICK, abs=2)
    assert 0 <= arm.clock.now() - state.time < 0.5


def test_a_goal_from_before_moves_nothing_when_the_motors_get_torque(arm, bus):
    bus.servos[1].put(42, (1000).to_bytes(2, "little"))
    arm.connect()
    time.sleep(0.2)
    assert bus.position("shoulder_pan") == pytest.approx(2047, abs=2)


def test_hold_stops_the_arm_where_it_is(arm, bus):
    arm.connect()
    arm.command(ANGLES + 1.0, 1.0)
    time.sleep(0.1)
    arm.hold()
    first = wait(arm, 0.1).angles
    arm.hold()
    np.testing.assert_allclose(wait(arm, 0.3).angles, first, atol=2 * TICK)
    assert abs(first - ANGLES - 1.0).max() > 0.3


def test_the_motors_hold_after_the_end(arm, bus):
    arm.connect()
    arm.disconnect()
    arm.disconnect()
    assert all(servo.registers[40] for servo in bus.servos.values())


def test_a_lost_answer_is_no_measurement_and_a_pulled_cable_ends_it(arm, bus):
    arm.connect()
    bus.deaf.add(3)
    assert arm.observe() is None
    bus.deaf.clear()
    assert arm.observe() is not None
    bus.close()
    with pytest.raises(ArmError, match=r"answers no more|takes no commands"):
        drive(arm)


def test_an_arm_that_is_not_there_or_not_calibrated_is_told(bus, tmp_path):
    with pytest.raises(ArmError, match=r"arm.port=/dev/nothing: .*Could not connect on port"):
        make_arm("lerobot", {"port": "/dev/nothing"}, setup_of()).connect()
    other = make_arm("lerobot", {"port": bus.port, "id": "other", "calibration": str(tmp_path)}, setup_of())
    be_patient(other)
    with pytest.raises(ArmError, match=r"arm.id=other is not calibrated.*lerobot-calibrate --robot.type=so101"):
        other.connect()


def test_a_robot_of_another_kind_is_told(bus):
    with pytest.raises(ConfigError, match=r"arm.type=so101_folower is not a robot of LeRobot; .*so101_follower"):
        make_arm("lerobot", {"type": "so101_folower"}, setup_of())
    with pytest.raises(ConfigError, match=r"arm.type=so101_follower has no lbr_iiwa_joint_1.pos"):
        make_arm("lerobot", {"port": bus.port}, read_env(compose([])))


def test_what_drives_the_simulated_arm_reaches_an_object_through_the_follower(bus, tmp_path):
    setup = setup_of("task=nl_reach", "task.num_objects=1").without_curriculum()
    scene = tmp_path / "scene.yaml"
    scene.write_text("- {noun: cube, color: red, position: [0.4, 0.08, 0.025]}\n")
    bus.turn_to(np.degrees(setup.robot.rest))
    settings = {"port": bus.port, "calibration": str(tmp_path)}
    choice = ArmChoice("lerobot", settings, rules={"watchdog": "1.0", "following": "0.5"}, scene=str(scene))
    with closing(connect(choice, setup)) as env:
        be_patient(env.arm.arm)
        reached = env.rollout(60, expert(env))["next", "success"]
    assert reached.any()
    at = read_kinematics(setup.robot).forward(np.radians(bus.degrees())[None]).position[0]
    assert np.linalg.norm(at - [0.4, 0.08, 0.025]) < 0.06

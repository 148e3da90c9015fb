"""`arm=franky` against franky-sim, which speaks the protocol of a Franka over MuJoCo: pip install franky-sim==1.0.4."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from deployment.arm import NEVER, ArmError, make_arm
from envs import read_env

START = np.array([0.0, 0.0, 0.0, -1.57, 0.0, 1.57, 0.785])  # where the simulator begins, radians


def setup_of(robot):
    return read_env(compose([f"robot={robot}", "task=nl_pick_and_place"]))


def test_another_robot_is_refused():
    with pytest.raises(ConfigError, match="robot=kuka: arm=franky needs a policy for a Franka: robot=panda"):
        make_arm("franky", {}, setup_of("kuka"))


def test_without_franky_one_sentence_says_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "franky", None)
    with pytest.raises(ConfigError, match="arm=franky needs franky, which is not installed: pip install"):
        make_arm("franky", {}, setup_of("panda"))


# ---- against the simulator


@pytest.fixture
def simulator():
    pytest.importorskip("franky", reason="pip install franky-control==2.0.0")
    server = pytest.importorskip("franky_sim", reason="pip install franky-sim==1.0.4")
    mujoco = pytest.importorskip("franky_sim.mujoco_simulator")
    with ExitStack() as stack:
        simulation = stack.enter_context(mujoco.MujocoSimulator(enable_visualization=False))
        model = simulation.add_robot()
        stack.enter_context(server.SimulationServer(simulation)).run_async()
        yield model.hostname, stack


@pytest.fixture
def arm(simulator):
    made = make_arm("franky", {"host": simulator[0], "dynamics": 1.0}, setup_of("panda"))
    made.connect()
    yield made
    made.disconnect()


def watch(arm):
    """Observe for up to five seconds."""
    for _ in range(100):
        arm.observe()
        time.sleep(0.05)


def follow(arm, targets):
    """Send targets 20 times a second, and return the last measurement."""
    for target in targets:
        arm.command(target, 1.0)
        time.sleep(0.05)
    return arm.observe()


def test_the_arm_follows_targets(arm):
    assert type(arm).on_hardware == NEVER
    state = arm.observe()
    np.testing.assert_allclose(state.angles, START, atol=0.01)
    targets = START + np.linspace(0, 0.3, 30)[:, None]
    state = follow(arm, [*targets, *[targets[-1]] * 20])
    np.testing.assert_allclose(state.angles, targets[-1], atol=0.01)
    assert state.opening == pytest.approx(1.0, abs=0.02)


def test_hold_stops_the_arm_and_it_moves_on_afterwards(arm):
    follow(arm, [START + 0.5] * 8)
    arm.hold()
    time.sleep(1.5)  # the simulated arm is compliant, and swings out
    stopped = arm.observe().angles
    arm.hold()
    time.sleep(0.3)
    np.testing.assert_allclose(arm.observe().angles, stopped, atol=0.01)
    assert 0.02 < abs(stopped - START).max() < 0.4
    np.testing.assert_allclose(follow(arm, [START] * 40).angles, START, atol=0.01)


def test_no_target_leaves_the_limits_of_the_arm(arm):
    state = follow(arm, [START + np.array([0, 0, 0, 0, 0, -1.4, 0])] * 40)
    assert state.angles[5] == pytest.approx(0.5445, abs=0.01)


def test_the_gripper_closes_and_opens(arm):
    arm.command(START, 0.0)
    time.sleep(1.5)
    assert arm.observe().opening < 0.05
    arm.command(START, 1.0)
    time.sleep(1.5)
    assert arm.observe().opening > 0.95


def test_a_gripper_that_is_sent_back_and_forth_ends_where_it_was_sent_last(arm):
    for i in range(60):
        arm.command(START, float(i % 4 == 3 or i >= 40))
        time.sleep(0.05)
    time.sleep(0.5)
    assert arm.observe().opening > 0.95


def test_a_lost_arm_is_told(arm, simulator):
    arm.observe()
    simulator[1].close()
    with pytest.raises(ArmError, match=r"answers no more|takes no commands"):
        watch(arm)
    with pytest.raises(ArmError, match="answers no more"):
        arm.observe()


def test_an_arm_that_is_not_there_is_told(simulator):
    with pytest.raises(ArmError, match=r"arm.host=127.0.0.9: .+"):
        make_arm("franky", {"host": "127.0.0.9"}, setup_of("panda")).connect()

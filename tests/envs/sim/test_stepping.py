"""Many physics steps in one call give the bits of as many calls."""

import pytest

from envs.sim.world import Stepper, _divides
from tests.helpers.env_cases import Poker, differences, make, rollout


def poked(robot, each):
    """A rollout in which the gripper is pressed on objects. each: every physics step in a call of its own."""
    env = make(robot, "step", "nl_pick_and_place", worlds=2, seed=3)
    for world in env._worlds:
        world._stepper._each = each
    history = rollout(env, 60, Poker(env))
    env.close()
    return history


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["panda", "jaco"])
def test_many_steps_at_once_have_the_same_bits(robot):
    assert differences(poked(robot, each=False), poked(robot, each=True)) == []


def test_damped_joints_take_every_step_by_itself():
    """Bullet would keep their damping of the first step for all of a call."""
    for robot, damped in (("kuka", True), ("panda", False)):
        env = make(robot, "step", "nl_reach")
        assert env._worlds[0]._stepper._each == damped
        env.close()


def test_forces_are_limited_for_a_single_step_after_a_call(monkeypatch):
    """Bullet multiplies the limits of motors and constraints by the time step in force as they are set."""
    stepper, parameters = Stepper(0, 0.01), {}
    monkeypatch.setattr(stepper, "step", lambda: None)
    monkeypatch.setattr(stepper, "_set", parameters.update)
    stepper.run(12)
    assert parameters == {"fixedTimeStep": 0.01, "numSubSteps": 0}


def test_a_sum_that_bullet_divides_otherwise_is_not_used():
    assert _divides(1 / 240, 12)
    assert not _divides(1 / 240, 31)  # a 31st of the sum is not 1 / 240 in binary

"""The rules that every target passes, one by one."""

from __future__ import annotations

import threading
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from core.overrides import compose
from deployment.arm import ArmState
from deployment.safety import Limits, Safety, SafetyConfig
from envs import read_env
from envs.sim.robot import read_kinematics

PERIOD = 0.05  # seconds


class Driven:
    """A safety whose arm is always exactly where it was sent, one period later."""

    def __init__(self, **rules):
        config = SafetyConfig(**({"slow_start": 0.0} | rules))
        setup = read_env(compose([]))
        self.kinematics = read_kinematics(setup.robot)
        self.limits = Limits(setup, self.kinematics, config, magnet=True)
        self.safety, self.now, self.angles = Safety(config, self.limits), 0.0, self.kinematics.rest
        self.see()

    def see(self, angles=None, time=None):
        """Measure. Returns why that is not believed."""
        angles = self.angles if angles is None else angles
        if isinstance(angles, SimpleNamespace):
            return self.safety.observe(self.now, angles)
        return self.safety.observe(self.now, ArmState(self.now if time is None else time, angles, 1.0))

    def step(self, wanted, opening=1.0, seen=True):
        """One period towards wanted angles. Returns the decision."""
        decision = self.safety.decide(self.now, wanted, opening)
        if decision.angles is not None and not self.safety.config.dry_run:
            self.angles = decision.angles
        self.now += PERIOD
        if seen:
            self.see()
        return decision

    def above(self, height, x=0.45):
        """(J,) angles with the gripper at this height over the table, metres."""
        kin = self.kinematics
        rotation = kin.forward(kin.rest[None]).rotation[0]
        return kin.solve(kin.rest[None], np.array([[x, 0.0, height]]), rotation, 300)[0]

    def close(self):
        self.limits.close()


@pytest.fixture
def driven(request):
    with closing(Driven(**getattr(request, "param", {}))) as made:
        yield made


def rules(**values):
    return pytest.mark.parametrize("driven", [values], indirect=True)


def test_a_near_target_is_sent_as_it_is(driven):
    wanted = driven.angles + 0.01
    decision = driven.step(wanted)
    np.testing.assert_array_equal(decision.angles, wanted)
    assert decision.reasons == ()


@pytest.mark.parametrize("wanted", [np.full(7, np.nan), np.full(7, np.inf), np.zeros(6), "up", None, [[0.0] * 7]])
def test_what_is_no_target_keeps_the_arm_where_it_is(driven, wanted):
    before = driven.step(driven.angles).angles
    decision = driven.step(wanted)
    np.testing.assert_array_equal(decision.angles, before)
    assert decision.reasons == ("the policy wants something that is not an angle for each joint",)


@pytest.mark.parametrize("opening", [np.nan, 1.5, -0.1, None, [0.0, 1.0]])
def test_what_is_no_opening_leaves_the_gripper_as_it_is(driven, opening):
    driven.step(driven.angles, 0.25)
    decision = driven.step(driven.angles, opening)
    assert decision.opening == 0.25
    assert decision.reasons == ("the policy wants an opening of the gripper that is not from 0 to 1",)


def test_a_joint_stays_within_its_limits_and_its_speed(driven):
    wanted = driven.kinematics.rest.copy()
    wanted[6] = 100.0
    step = driven.limits.speed[6] * PERIOD
    for _ in range(100):
        before = driven.angles
        decision = driven.step(wanted)
        assert np.abs(decision.angles - before).max() <= step + 1e-9
    assert driven.angles[6] == driven.limits.high[6]
    assert decision.reasons == ("lbr_iiwa_joint_7 is kept within its limits",)


@rules(slow_start=1.0)
def test_an_arm_starts_slowly(driven):
    wanted, moved = driven.angles.copy(), []
    wanted[6] += 3.0
    for _ in range(30):
        before = driven.angles[6]
        driven.step(wanted)
        moved.append(driven.angles[6] - before)
    full = driven.limits.speed[6] * PERIOD
    np.testing.assert_allclose([moved[2], moved[10], moved[25]], [0.19 * full, 0.55 * full, full], rtol=1e-6)


def test_the_gripper_does_not_leave_its_workspace(driven):
    places = [driven.above(0.3, x) for x in np.arange(0.45, 0.75, 0.01)]
    decisions = [driven.step(place) for place in places]
    assert "the gripper would leave its workspace along x" in decisions[-1].reasons[-1]
    reached = driven.kinematics.forward(driven.angles[None]).position[0, 0]
    assert 0.61 < reached <= 0.63


@rules(margin=0.5)
def test_no_link_gets_near_to_the_table(driven):
    for height in np.arange(0.3, -0.1, -0.01):
        decision = driven.step(driven.above(height))
    assert "mm too near to the table" in decision.reasons[-1]
    assert 0.005 <= driven.kinematics.forward(driven.angles[None]).position[0, 2] < 0.02


def test_an_arm_that_is_not_seen_holds_until_it_is_seen_again(driven):
    for _ in range(4):
        assert driven.step(driven.angles, seen=False).angles is not None
    driven.now += 0.01
    decision = driven.step(driven.angles)
    assert (decision.angles, decision.reasons) == (None, ("the arm was not seen for 210 ms",))
    assert driven.step(driven.angles).angles is not None


@pytest.mark.parametrize(
    ("measured", "reason"),
    [
        (np.full(7, np.nan), "not a finite number"),
        (np.zeros(6), "measured 6 angles; it has 7 joints"),
        (np.full(7, 9.0), "beyond its limit"),
        ("nothing", "no measurement"),
        (SimpleNamespace(time=0.1, angles=np.zeros(7), opening=1.0), "no measurement"),
    ],
)
def test_an_impossible_measurement_is_not_believed(driven, measured, reason):
    driven.now += PERIOD
    assert reason in driven.see(measured)
    np.testing.assert_array_equal(driven.safety.measured.angles, driven.angles)


def test_an_arm_whose_measurements_are_not_believed_holds_and_says_why(driven):
    driven.step(driven.angles)
    for _ in range(5):
        driven.now += PERIOD
        driven.see(np.full(7, np.nan))
    [reason] = driven.step(driven.angles).reasons
    assert reason == "the arm was not seen for 250 ms: the arm measured something that is not a finite number"
    driven.now += 1.0
    assert driven.step(driven.angles).reasons == ("the arm was not seen for 1000 ms",)


def test_a_jump_and_a_time_that_goes_back_are_not_believed(driven):
    driven.now += PERIOD
    assert "was measured to jump" in driven.see(driven.angles + 0.5)
    assert "older than the last one" in driven.see(time=-1.0)
    assert "from the future" in driven.see(time=9.0)
    assert driven.see() is None


def test_an_arm_that_is_not_where_it_was_commanded_stops_until_it_is_released(driven):
    blocked, wanted = driven.angles.copy(), driven.angles.copy()
    decisions = []
    for _ in range(40):
        wanted[6] += 0.04
        decisions.append(driven.step(wanted, seen=False))
        driven.see(blocked)
    assert decisions[-1].angles is None
    assert "lbr_iiwa_joint_7 is 0." in decisions[-1].reasons[0]
    assert "from where it was commanded" in decisions[-1].reasons[0]
    driven.safety.release()
    np.testing.assert_allclose(driven.step(wanted).angles, blocked, atol=0.32)


def test_a_stop_lasts_until_it_is_released(driven):
    driven.safety.stop("somebody pressed stop")
    for _ in range(3):
        assert driven.step(driven.angles).reasons == ("somebody pressed stop",)
    driven.safety.release()
    assert driven.step(driven.angles).angles is not None


def test_a_stop_that_another_thread_requests_takes_effect_at_the_next_decision(driven):
    done = threading.Event()

    def press():
        while not done.is_set():
            driven.safety.request_stop("somebody pressed stop")

    presser = threading.Thread(target=press)
    presser.start()
    held = 0
    for _ in range(500):
        held += driven.step(driven.angles).angles is None
        driven.safety.release()
    done.set()
    presser.join()
    assert held > 0
    driven.safety.request_stop("the last one")
    driven.safety.release()  # of what came before
    assert driven.step(driven.angles).reasons == ("the last one",)
    assert driven.step(driven.angles).angles is None


@rules(deadman=1.0)
def test_without_the_dead_man_key_the_arm_holds(driven):
    assert driven.step(driven.angles).reasons == ("the dead-man key is not pressed",)
    driven.safety.press(driven.now)
    moved = [driven.step(driven.angles).angles is not None for _ in range(25)]
    assert moved[:19] == [True] * 19
    assert moved[21:] == [False] * 4


@rules(dry_run=True)
def test_a_dry_run_decides_and_says_that_nothing_was_sent(driven):
    before = driven.angles
    for _ in range(5):
        decision = driven.step(driven.angles + 0.01)
        np.testing.assert_allclose(decision.angles, before + 0.01)
        assert decision.reasons == ("dry run: nothing was sent",)


def test_an_arm_outside_of_its_workspace_does_not_start(driven):
    driven.safety.measured = None
    driven.angles = np.zeros(7)  # stretched upwards
    driven.see()
    [reason] = driven.step(driven.kinematics.rest).reasons
    assert reason.startswith("the arm cannot start from where it is: the gripper would leave its workspace")
    assert reason.endswith("move it there by hand")

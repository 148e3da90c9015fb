"""Targets, measurements, the log and the watchdog of one arm, with a time that the tests let pass."""

from __future__ import annotations

import json
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from core.overrides import compose
from deployment.arm import ArmError
from deployment.command_log import CommandLog
from deployment.prediction import Prediction
from deployment.safe_arm import SafeArm
from deployment.safety import Limits, Safety, SafetyConfig
from envs import read_env
from envs.sim.robot import read_kinematics
from tests.helpers.obedient_arm import ObedientArm
from tools.hostile_arms import HostileConfig, Truth, run

PERIOD = 0.05  # seconds


@pytest.fixture(scope="module")
def setup():
    return read_env(compose([]))


@pytest.fixture
def driven(setup, tmp_path):
    config = SafetyConfig(slow_start=0.0)
    kinematics = read_kinematics(setup.robot)
    limits = Limits(setup, kinematics, config, magnet=True)
    arm = ObedientArm(setup, kinematics.rest)
    safe = SafeArm(arm, Safety(config, limits), CommandLog(tmp_path / "commands.jsonl"))
    with closing(safe):
        safe.connect()
        yield safe


@pytest.fixture
def make_safe(setup):
    """A function that makes an arm which is not connected, with these rules."""
    kinematics = read_kinematics(setup.robot)
    with ExitStack() as made:

        def make(**rules):
            config = SafetyConfig(**rules)
            safe = SafeArm(
                ObedientArm(setup, kinematics.rest),
                Safety(config, Limits(setup, kinematics, config, magnet=True)),
            )
            made.callback(safe.close)
            return safe

        yield make


def test_an_arm_that_is_no_longer_seen_holds_within_250_ms(driven):
    driven.step(driven.angles, 1.0, PERIOD)
    arm, start = driven.arm, driven.clock.now()
    arm.dark = True
    while not arm.holds:
        driven.step(driven.angles, 1.0, 1.0)  # a policy that takes a second to think
        assert driven.clock.now() < start + 1.1
    [held] = [line for line in _log(driven) if line["sent"] is None][:1]
    assert held["time"] - start <= 0.25
    assert held["reasons"][0].startswith("the arm was not seen for 2")


def test_an_arm_that_fails_is_stopped(driven):
    driven.arm.fails = True
    driven.step(driven.angles, 1.0, PERIOD)
    assert driven.safety.stopped == "the cable is loose"
    assert driven.arm.holds > 0


@pytest.mark.parametrize("method", ["observe", "command", "hold"])
def test_an_error_that_an_adapter_did_not_foresee_stops_the_arm_with_one_sentence(driven, method):
    driven.step(driven.angles, 1.0, PERIOD)

    def fail(*arguments):
        raise KeyError("no such\nmotor")

    setattr(driven.arm, method, fail)
    if method == "hold":
        driven.pause()
    driven.step(driven.angles, 1.0, PERIOD)
    assert driven.safety.stopped == r"the arm failed: KeyError: 'no such\nmotor'"
    assert method == "hold" or driven.arm.holds > 0


def test_a_hold_that_failed_is_tried_again_at_the_next_look(driven):
    driven.step(driven.angles, 1.0, PERIOD)
    hold, failed = driven.arm.hold, []

    def hold_at_the_third_call():
        failed.append(True)
        if len(failed) < 3:
            raise ArmError("the cable is loose")
        hold()

    driven.arm.hold = hold_at_the_third_call
    driven.stop("somebody pressed stop")
    driven.watch()
    assert driven.arm.holds == 0
    driven.watch()
    assert driven.arm.holds == 1
    driven.watch()
    assert driven.arm.holds == 1
    assert len([line for line in _log(driven) if line["sent"] is None]) == 1


def test_an_arm_that_fails_while_it_is_connected_is_one_error_with_its_own_text(make_safe):
    def loose():
        raise ArmError("the cable is loose")

    def unforeseen():
        raise AttributeError("'NoneType' object has no attribute 'read'")

    for method in ("connect", "observe"):
        for fails, text in ((loose, "the cable is loose"), (unforeseen, "the arm failed: AttributeError: 'NoneType'")):
            safe = make_safe()
            setattr(safe.arm, method, fails)
            with pytest.raises(ArmError, match=text):
                safe.connect()


def test_the_end_of_an_arm_that_fails_hides_no_other_error(make_safe):
    safe = make_safe()
    safe.connect()

    def fail():
        raise AttributeError("no bus")

    safe.arm.hold = safe.arm.disconnect = fail
    safe.close()


def test_a_dry_run_sends_nothing(make_safe):
    safe = make_safe(dry_run=True)
    safe.connect()
    safe.step(safe.angles, 1.0, PERIOD)
    safe.stop("somebody pressed stop")
    safe.step(safe.angles, 1.0, PERIOD)
    safe.pause()
    safe.close()
    assert safe.arm.holds == safe.arm.commands == 0


def test_a_stop_from_another_thread_holds_at_the_next_look(driven):
    driven.step(driven.angles, 1.0, PERIOD)
    driven.safety.request_stop("somebody pressed stop")
    driven.watch()
    assert driven.arm.holds == 1
    assert _log(driven)[-1]["reasons"] == ["somebody pressed stop"]


def test_a_paused_arm_holds_and_is_watched(driven):
    driven.step(driven.angles, 1.0, PERIOD)
    driven.pause()
    assert driven.arm.holds == 1
    assert _log(driven)[-1]["reasons"] == ["paused: the arm holds"]
    driven.pause()
    assert driven.arm.holds == 1
    driven.safety.request_stop("somebody pressed stop")
    driven.pause()
    assert driven.safety.stopped == "somebody pressed stop"
    commands = driven.arm.commands
    driven.step(driven.angles, 1.0, PERIOD)
    assert driven.arm.commands == commands
    driven.safety.release()
    assert driven.step(driven.angles, 1.0, PERIOD).angles is not None
    assert not driven.paused


def test_an_arm_that_was_never_connected_gets_no_command(setup):
    rules = SafetyConfig()
    limits = Limits(setup, read_kinematics(setup.robot), rules, magnet=True)
    arm = ObedientArm(setup, read_kinematics(setup.robot).rest)
    SafeArm(arm, Safety(rules, limits)).close()
    assert arm.holds == arm.commands == 0


def test_an_arm_that_could_not_be_connected_is_not_told_to_hold(make_safe):
    safe = make_safe()

    def missing():
        raise ArmError("no such port")

    safe.arm.connect = missing
    with pytest.raises(ArmError, match="no such port"):
        safe.connect()
    safe.close()
    assert safe.arm.holds == 0


def test_a_stop_between_two_commands_holds_at_once(driven):
    driven.step(driven.angles, 1.0, PERIOD)
    driven.stop("somebody pressed stop")
    assert driven.arm.holds == 1
    assert _log(driven)[-1]["reasons"] == ["somebody pressed stop"]


def test_every_command_is_logged_as_it_happens(driven):
    wanted = driven.angles + 0.01
    driven.step(wanted, 0.5, PERIOD)
    driven.step([np.nan] * 7, 0.5, PERIOD)
    first, second = _log(driven)
    np.testing.assert_allclose([first["wanted"], first["sent"]], [wanted, wanted], atol=1e-6)
    assert (first["opening"], first["reasons"]) == (0.5, [])
    assert "nan" in second["wanted"]
    assert second["sent"] == first["sent"]


def test_a_person_is_asked_between_commands(driven):
    asked = []
    driven._person = asked.append
    driven.step(driven.angles, 1.0, PERIOD)
    assert len(asked) == 4


def _log(driven):
    return [json.loads(line) for line in Path(driven.log._file.name).read_text(encoding="utf-8").splitlines()]


def test_no_hostile_step_breaks_a_rule():
    result = run(HostileConfig(steps=1000))
    assert result["targets"] > 300
    assert result["holds"] > 200
    assert result["broken"] == {}


def test_the_comparison_of_hostile_steps_finds_what_breaks_a_rule(setup):
    truth = Truth(setup, SafetyConfig())
    with closing(truth.clearance):
        kin = truth.kinematics
        down = kin.forward(kin.rest[None]).rotation[0]
        low = kin.solve(kin.rest[None], np.array([[0.45, 0.0, 0.001]]), down, 300)[0]
        far = kin.solve(kin.rest[None], np.array([[0.7, 0.0, 0.2]]), down, 300)[0]
        assert truth.broken(kin.rest, kin.rest) == []
        assert truth.broken(kin.high + 0.01, None)[0] == "joints"
        assert truth.broken(low, None) == ["table"]
        assert truth.broken(far, None) == ["workspace"]
        assert truth.broken(kin.rest, kin.rest + 0.5) == ["speed"]
        assert truth.broken(kin.rest * np.nan, None) == ["form"]


def test_the_delay_of_an_arm_is_found_while_it_moves():
    late, rng = 0.08, np.random.default_rng(0)
    path = np.cumsum(rng.normal(0, 0.05, (80, 3)), axis=0)
    prediction = Prediction(path[0], 0.0)
    for i in range(1, 80):
        now = i * PERIOD
        prediction.sent(now, path[i])
        then = max(0, int((now + PERIOD - late) / PERIOD + 1e-6))
        prediction.measured(now + PERIOD, path[then] + 0.02)  # it sags, too
    assert prediction.delay == pytest.approx(late, abs=0.03)
    expected = path[79] + 0.02
    np.testing.assert_allclose(path[then] + 0.02 + prediction.ahead(now + PERIOD, now + PERIOD), expected, atol=1e-6)

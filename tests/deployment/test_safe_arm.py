"""Targets, measurements, the log and the watchdog of one arm, with a time that the tests let pass."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from core.overrides import compose
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


def test_an_arm_that_was_never_connected_gets_no_command(setup):
    rules = SafetyConfig()
    limits = Limits(setup, read_kinematics(setup.robot), rules, magnet=True)
    arm = ObedientArm(setup, read_kinematics(setup.robot).rest)
    SafeArm(arm, Safety(rules, limits)).close()
    assert arm.holds == arm.commands == 0


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

"""Keys of a person at a terminal: stop, and the dead-man key."""

from __future__ import annotations

import os
import sys
from contextlib import closing

import pytest

pytest.importorskip("pty", reason="only POSIX has pseudo-terminals")

import pty

from core.overrides import compose
from deployment.safe_arm import SafeArm
from deployment.safety import Limits, Safety, SafetyConfig
from deployment.terminal import Terminal
from envs import read_env
from envs.sim.robot import read_kinematics
from tests.helpers.obedient_arm import ObedientArm

PERIOD = 0.05  # seconds


@pytest.fixture
def keyboard(monkeypatch):
    """A function that presses keys at the terminal of this process."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield lambda keys: os.write(ours, keys)
    os.close(ours)


@pytest.fixture
def make_arm():
    """A function that makes an arm which asks this terminal, and has a dead-man key."""
    setup, rules = read_env(compose([])), SafetyConfig(slow_start=0.0, deadman=0.5)
    kinematics = read_kinematics(setup.robot)
    with closing(Limits(setup, kinematics, rules, magnet=True)) as limits:

        def make(terminal):
            safe = SafeArm(ObedientArm(setup, kinematics.rest), Safety(rules, limits), person=terminal)
            safe.connect()
            return safe

        yield make


def test_an_arm_moves_while_a_key_is_held_down_and_stops_at_space(keyboard, make_arm):
    with Terminal(lambda: False) as terminal:
        arm = make_arm(terminal)
        assert arm.step(arm.angles, 1.0, PERIOD).reasons == ("the dead-man key is not pressed",)
        keyboard(b"x")
        assert arm.step(arm.angles, 1.0, PERIOD).angles is not None
        arm.step(arm.angles, 1.0, 1.0)
        assert arm.holding
        keyboard(b"x")
        assert arm.step(arm.angles, 1.0, PERIOD).angles is not None
        keyboard(b"x x")
        assert arm.step(arm.angles, 1.0, PERIOD).reasons == ("a person stopped it",)
        assert terminal.ended


def test_keys_from_before_are_not_a_hand_at_the_dead_man_key(keyboard, make_arm):
    with Terminal(lambda: False) as terminal:
        keyboard(b"x" * 3000)
        arm = make_arm(terminal)
        assert arm.step(arm.angles, 1.0, PERIOD).reasons == ("the dead-man key is not pressed",)
        arm.clock.sleep(1.0)  # a policy that thinks for long
        keyboard(b"x")
        assert arm.step(arm.angles, 1.0, PERIOD).reasons == ("the dead-man key is not pressed",)
        keyboard(b"x")
        assert arm.step(arm.angles, 1.0, PERIOD).angles is not None
        arm.clock.sleep(1.0)
        keyboard(b" ")
        assert arm.step(arm.angles, 1.0, PERIOD).reasons == ("a person stopped it",)


def test_ctrl_c_stops_the_arm_where_there_is_no_terminal(make_arm, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    pressed = []
    with Terminal(lambda: bool(pressed)) as terminal:
        arm = make_arm(terminal)
        assert not terminal.is_there
        pressed.append("Ctrl-C")
        arm.step(arm.angles, 1.0, PERIOD)
        assert arm.safety.stopped == "a person stopped it"

"""Signals that ask a program to stop."""

from __future__ import annotations

import signal

import pytest

from trainers.run.signals import StopSignal


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_recorded_and_the_handlers_are_restored(number):
    before = signal.getsignal(number)
    with StopSignal() as stop:
        assert not stop()
        signal.raise_signal(number)
        assert stop()
        assert stop.signal == number
    assert signal.getsignal(number) is before

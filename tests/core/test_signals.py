"""Signals that ask a program to stop."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from core.system import StopSignal


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1])
def test_a_signal_is_recorded_and_the_handlers_are_restored(number):
    before = signal.getsignal(number)
    with StopSignal() as stop:
        assert not stop()
        signal.raise_signal(number)
        assert stop()
        assert stop.signal == number
    assert signal.getsignal(number) is before


ENDLESS = """
import time
from core.system import StopSignal
with StopSignal() as stop:
    print("ready", flush=True)
    while True:
        time.sleep(0.01)
        if stop():
            print("stop", flush=True)
            time.sleep(60)
"""


def test_a_second_sigint_ends_the_program_at_once():
    command = [sys.executable, "-c", ENDLESS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "stop\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == -signal.SIGINT

"""Processes of trials that end at once: how often they are started again, and what people are told."""

import asyncio
import multiprocessing
from pathlib import Path
from types import SimpleNamespace

from demo.study.trial_host import DIES, MOST_STARTS, TrialHost

STUDY = SimpleNamespace(at_once=2)
TRIAL = SimpleNamespace(code="abc", number=1, clock=0.0)


class DyingContext:
    """Processes that end before they say a word."""

    def __init__(self):
        self.started = 0
        self.Pipe = multiprocessing.Pipe

    def Process(self, target, args, daemon):
        return SimpleNamespace(start=self._start, pid=None, exitcode=-9)

    def _start(self):
        self.started += 1


def test_a_robot_that_dies_at_once_is_started_some_times_and_then_both_sides_are_told(capsys):
    context, told = DyingContext(), []

    async def serve():
        host = TrialHost(STUDY, Path("study.sqlite"), context, lambda code, why: told.append(code) or host.start(TRIAL))
        host.start(TRIAL)
        await until(lambda: failure(host))
        assert failure(host) == DIES
        await asyncio.sleep(0.1)  # nobody starts it again
        assert context.started == MOST_STARTS
        host.end("abc")  # as "Stop" on the experimenter's page
        host.start(TRIAL)
        await until(lambda: failure(host))
        assert context.started == 2 * MOST_STARTS

    asyncio.run(serve())
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "participant abc" in lines[0]
    assert "exit code -9" in lines[0]


def failure(host):
    running = host.running.get("abc")
    return running.failed if running else ""


async def until(holds):
    for _ in range(200):
        if holds():
            return
        await asyncio.sleep(0.02)
    raise AssertionError("it never came")

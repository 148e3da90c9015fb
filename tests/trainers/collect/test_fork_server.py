"""The server that workers are forked from: which processes end together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from tests.helpers.processes import ROOT, left_over, living, parent_of
from tools.forked import call
from trainers.collect import fork_server

SCRIPT = """
from functools import partial
from core.platform_tuning import lean_imports
with lean_imports():
    from trainers.collect.rollouts import Rollouts
from tests.helpers.fake_env import FakeEnv
from tests.helpers.training_configs import training
from trainers.models.policy import build_policy
if __name__ == "__main__":
    env = FakeEnv(4, 0)
    policy = build_policy(training().policy, env.observation_spec, env.action_unit)
    small = training(overrides=["collector.workers=2"])
    rollouts = Rollouts(partial(FakeEnv, nap=0.01), policy, small.collector, horizon=4, seed=0)
    rollouts.next()
    print(*(process.pid for process in rollouts.processes), flush=True)
    while True:
        rollouts.next()
"""


@pytest.mark.slow
def test_a_stopped_worker_and_a_busy_one_end_with_a_main_process_that_is_killed(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    main = subprocess.Popen(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    try:
        stopped, busy = map(int, main.stdout.readline().split())
        assert parent_of(stopped) == parent_of(busy) != main.pid
        os.kill(stopped, signal.SIGSTOP)
        main.kill()
        main.wait()
        assert left_over(main.pid, 5) == []
    finally:
        for process in living(main.pid):
            os.kill(process, signal.SIGKILL)
        main.communicate()


def test_a_fork_of_the_process_that_has_a_server_starts_workers_without_it():
    assert fork_server.start().get_start_method() == "forkserver"
    forked = call(lambda: print(fork_server.start().get_start_method()))
    assert (forked.code, forked.out) == (0, "spawn\n")


def test_the_server_finds_modules_where_this_process_does(tmp_path, monkeypatch):
    before = os.environ.get("PYTHONPATH")
    monkeypatch.syspath_prepend(tmp_path)
    with fork_server._import_path():
        assert os.environ["PYTHONPATH"].split(os.pathsep)[0] == str(tmp_path)
    assert os.environ.get("PYTHONPATH") == before

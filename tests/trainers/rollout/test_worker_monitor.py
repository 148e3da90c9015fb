"""Notices workers that die while the main process waits for them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time

import pytest

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.models.policy import build_policy
from trainers.rollout.collection import CollectionError, Rollouts
from trainers.rollout.worker_monitor import WorkerMonitor


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_a_worker_killed_before_it_takes_new_weights_ends_the_collection(monkeypatch, count):
    monkeypatch.setattr("trainers.rollout.worker_monitor.GRACE_SECONDS", 1.0)
    env = make_env(4, 0)
    policy = build_policy(plan().policy, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, plan(overrides=("collector.workers=2",)).collector, 4, 0)
    try:
        rollouts.next()
        for process in rollouts.processes[:count]:
            os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(CollectionError, match="failed"):
            drain(rollouts, policy)
    finally:
        rollouts.close()


def drain(rollouts, policy=None):
    if policy is not None:
        rollouts.sync(policy)  # TorchRL would wait forever for the acknowledgement of a dead worker
    for _ in range(3):  # batches that a worker sent before its end may still arrive
        rollouts.next()


def test_a_closed_monitor_restores_the_signal_handler():
    before = signal.getsignal(signal.SIGUSR1)
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(0,))
    process.start()
    monitor = WorkerMonitor([process])
    assert signal.getsignal(signal.SIGUSR1) != before
    monitor.close()
    process.join()
    assert signal.getsignal(signal.SIGUSR1) == before

"""Collection of batches in worker processes, and seeds."""

from __future__ import annotations

import os
import signal

import pytest
import torch

from tests.helpers.fake_env import make_env
from tests.helpers.plans import plan
from trainers.models.policy import build_policy
from trainers.rollout.collection import CollectionError, Rollouts, derive_seed


def test_seeds_of_training_and_evaluation_are_disjoint():
    trained = {derive_seed(s, i) for s in range(50) for i in range(50)}
    evaluated = {derive_seed(s, i, evaluation=True) for s in range(50) for i in range(50)}
    assert len(trained) == len(evaluated) == 2500
    assert max(trained) < min(evaluated) < 2**31


@pytest.mark.slow
def test_workers_receive_new_weights_and_a_killed_one_ends_the_collection():
    env = make_env(4, 0)
    policy = build_policy(plan().policy, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, plan(overrides=("collector.workers=2",)).collector, 4, 0)
    try:
        batch = rollouts.next().clone()
        assert batch.shape == (8, 4)
        assert not torch.equal(batch["robot"][:4], batch["robot"][4:])
        with torch.no_grad():
            policy.actor.log_std.fill_(-4.0)
            policy.actor.net[-1].bias.fill_(0.5)
        rollouts.sync(policy)
        rollouts.next()
        assert rollouts.next()["action"].mean() == pytest.approx(0.5, abs=0.05)
        pids = [process.pid for process in rollouts.processes]
        os.kill(pids[1], signal.SIGKILL)
        with pytest.raises(CollectionError, match="exit code -9"):
            drain(rollouts)
    finally:
        rollouts.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def drain(rollouts, policy=None):
    if policy is not None:
        rollouts.sync(policy)  # TorchRL would wait forever for the acknowledgement of a dead worker
    for _ in range(3):  # batches that a worker sent before its end may still arrive
        rollouts.next()

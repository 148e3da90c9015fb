"""Collection of batches in worker processes, which may be lost at any time."""

from __future__ import annotations

import copy
import multiprocessing
import os
import signal
import time
from contextlib import closing

import pytest
import torch

from core.errors import Interrupted
from tests.helpers.fake_env import make_crashing, make_env, same
from tests.helpers.processes import parent_of, wait_for_end
from tests.helpers.training_configs import policy_of, training
from trainers.collect.rollouts import CollectionError, Rollouts
from trainers.collect.worker import Worker, WorkerSpec

HORIZON = 4


def two_workers(make, policy, *overrides):
    return Rollouts(
        make, policy, training(overrides=("collector.workers=2", *overrides)).collector, horizon=HORIZON, seed=0
    )


def expected(policy, batches):
    """The batches of two workers, collected by this process alone."""
    workers = [Worker(make_env, policy.act, WorkerSpec(i, 4, HORIZON, 0)) for i in range(2)]
    return [torch.cat([worker.collect(k)[0] for worker in workers]) for k in range(batches)]


def test_a_batch_does_not_depend_on_other_use_of_the_global_generator():
    policy = policy_of(make_env(4, 0))
    spec = WorkerSpec(0, 4, HORIZON, 0)
    one, other = Worker(make_env, policy.act, spec), Worker(make_env, policy.act, spec)
    torch.manual_seed(1)
    before = torch.get_rng_state()
    first = one.collect(0)[0]
    assert torch.equal(torch.get_rng_state(), before)
    torch.rand(7)
    assert same(first, other.collect(0)[0])
    assert not torch.equal(other.collect(1)[0]["move"], one.collect(2)[0]["move"])


@pytest.mark.slow
def test_a_worker_that_is_lost_is_replaced_and_changes_no_bit(capfd):
    policy = policy_of(make_env(4, 0))
    wanted = expected(policy, 6)
    rollouts = two_workers(make_env, policy, "collector.timeout=4.0", "collector.overlap=false")
    try:
        assert same(wanted[0], rollouts.next())
        rollouts.sync(policy)
        os.kill(rollouts.processes[1].pid, signal.SIGKILL)
        assert same(wanted[1], rollouts.next())
        assert same(wanted[2], rollouts.next())
        os.kill(rollouts.processes[0].pid, signal.SIGSTOP)  # as if swapped out: only a deadline tells
        start = time.monotonic()
        assert same(wanted[3], rollouts.next())
        assert time.monotonic() - start < 60
        assert rollouts.restarts == 2
        assert same(wanted[4], rollouts.next())
        with torch.no_grad():
            policy.actor.log_std.fill_(-4.0)
            policy.actor.net[-1].bias.fill_(0.5)
        rollouts.sync(policy)
        assert rollouts.next()["action"].mean() == pytest.approx(0.5, abs=0.05)
    finally:
        rollouts.close()
    told = capfd.readouterr().err
    assert "collector worker 1 was killed by signal 9 (SIGKILL); it is replaced" in told
    assert "collector worker 0 did not answer for 4.0 s; it is replaced" in told
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_workers_that_are_lost_with_their_fork_server_are_replaced_and_change_no_bit():
    policy = policy_of(make_env(4, 0))
    wanted = expected(policy, 3)
    rollouts = two_workers(make_env, policy)
    try:
        assert same(wanted[0], rollouts.next())
        workers = [process.pid for process in rollouts.processes]
        os.kill(parent_of(workers[0]), signal.SIGKILL)
        wait_for_end(*workers)  # on a busy machine they live for a moment
        assert same(wanted[1], rollouts.next())
        assert same(wanted[2], rollouts.next())
        assert rollouts.restarts == 2
    finally:
        rollouts.close()


@pytest.mark.slow
def test_the_exception_of_a_worker_is_in_the_message():
    rollouts = two_workers(make_crashing, policy_of(make_env(4, 0)), "collector.restarts=0")
    try:
        rollouts.next()
        with pytest.raises(CollectionError, match=r"collector worker [01] raised ArithmeticError: the arm is on fire"):
            rollouts.next()
        with pytest.raises(Interrupted):
            rollouts.next(stop=lambda: True)
    finally:
        rollouts.close()


def test_an_exception_in_this_process_is_in_the_message_too():
    rollouts = Rollouts(make_crashing, policy_of(make_env(4, 0)), training().collector, horizon=HORIZON, seed=0)
    rollouts.next()
    with pytest.raises(CollectionError, match="collecting a batch raised ArithmeticError: the arm is on fire"):
        rollouts.next()
    rollouts.close()


def moved(policy, iteration):
    """The policy as it is in this iteration: its mean move changes with it."""
    with torch.no_grad():
        policy.actor.net[-1].bias.fill_(0.1 * iteration)
    return policy


def lagged(policy, batches):
    """The batches of two workers, each collected with the weights of the iteration before."""
    workers = [Worker(make_env, policy.act, WorkerSpec(i, 4, HORIZON, 0)) for i in range(2)]
    return [
        torch.cat([worker.collect(k)[0] for worker in workers])
        for k in range(batches)
        if moved(policy, max(0, k - 1)) is policy
    ]


@pytest.mark.slow
def test_batches_collected_during_updates_have_the_weights_of_one_iteration_before_and_survive_a_lost_worker():
    policy = policy_of(make_env(4, 0))
    wanted = lagged(policy, 6)
    with closing(two_workers(make_env, policy, "collector.overlap=true")) as rollouts:
        for k in range(6):
            rollouts.sync(moved(policy, k))
            if k in (2, 4):
                os.kill(rollouts.processes[k // 4].pid, signal.SIGKILL)
            assert same(wanted[k], rollouts.next()), f"batch {k}"
        assert rollouts.restarts == 2


@pytest.mark.slow
def test_a_batch_that_was_asked_for_before_a_resume_has_the_weights_of_then():
    policy = policy_of(make_env(4, 0))
    wanted = lagged(policy, 5)
    with closing(two_workers(make_env, policy, "collector.overlap=true")) as rollouts:
        for k in range(3):
            rollouts.sync(moved(policy, k))
            rollouts.next()
        state = copy.deepcopy(rollouts.state_dict())
    config = training(overrides=("collector.workers=2", "collector.overlap=true")).collector
    with closing(
        Rollouts(make_env, moved(policy, 3), config, horizon=HORIZON, seed=0, iteration=3, state=state)
    ) as resumed:
        for k in (3, 4):
            resumed.sync(moved(policy, k))
            assert same(wanted[k], resumed.next()), f"batch {k}"


@pytest.mark.slow
@pytest.mark.parametrize("batches", [1, 2])
def test_a_run_of_few_batches_ends_without_a_word(batches, capfd):
    policy = policy_of(make_env(4, 0))
    config = training(overrides=("collector.workers=2", "collector.overlap=true")).collector
    for _ in range(4):
        rollouts = Rollouts(make_env, policy, config, horizon=HORIZON, seed=0, steps=batches * HORIZON)
        with closing(rollouts):
            for _ in range(batches):
                rollouts.sync(policy)
                assert rollouts.next().shape == (8, HORIZON)
    assert capfd.readouterr().err == ""

"""Collection in actors of Ray: the bits of local collection, whatever happens to the actors."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

import pytest
import torch

from core.errors import ConfigError
from tests.helpers.fake_env import make_crashing, make_env, same
from tests.helpers.ray_cases import listening
from tests.helpers.training_configs import policy_of
from trainers.collect.rollouts import CollectionError, Rollouts
from trainers.collect.worker import Worker, WorkerSpec
from trainers.config import RayCollectorConfig

HORIZON = 4
CONFIG = RayCollectorConfig(
    name="ray",
    workers=2,
    worlds=8,
    timeout=None,
    restarts=3,
    address=None,
    cpus=1.0,
    mode="sync",
    ahead=1,
    dashboard=False,
)
pytestmark = pytest.mark.slow


def shifted(policy):
    """Change the weights in place."""
    with torch.no_grad():
        policy.actor.net[-1].bias.add_(0.01)


def test_lost_and_stopped_actors_are_replaced_and_change_no_bit(ray, capfd):
    policy = policy_of(make_env(4, 0))
    workers = [Worker(make_env, policy.act, WorkerSpec(i, 4, HORIZON, 0)) for i in range(2)]

    def wanted(iteration):
        return torch.cat([worker.collect(iteration)[0] for worker in workers])

    rollouts = Rollouts(make_env, policy, CONFIG, horizon=HORIZON, seed=0)
    try:
        assert same(wanted(0), rollouts.next())
        priorities = [os.getpriority(os.PRIO_PROCESS, worker.pid) for worker in rollouts.pool.workers]
        assert priorities == [os.getpriority(os.PRIO_PROCESS, 0)] * 2
        shifted(policy)
        rollouts.sync(policy)
        os.kill(rollouts.pool.workers[1].pid, signal.SIGKILL)
        assert same(wanted(1), rollouts.next())
        os.kill(rollouts.pool.workers[0].pid, signal.SIGSTOP)
        assert same(wanted(2), rollouts.next())
        assert rollouts.restarts == 2
        assert rollouts.measures() == {"time/batch_age": 0.0, "time/restarts": 2.0}
        status = rollouts.status()
        assert (status["workers"], status["restarts"], status["age"]) == ("2/2", "2", "0")
        assert status["127.0.0.1"].endswith("/s")
    finally:
        rollouts.close()
    told = capfd.readouterr().err
    assert "collector worker 1 was lost: its worker process has died; it is replaced" in told
    assert "collector worker 0 " in told
    deadline = time.monotonic() + 5
    while ray.free_cpus < 2 and time.monotonic() < deadline:
        time.sleep(0.1)
    assert ray.free_cpus == 2


def test_async_batches_are_collected_with_the_weights_of_one_iteration_before(ray):
    policy, ages, batches = policy_of(make_env(4, 0)), [], []
    rollouts = Rollouts(make_env, policy, replace(CONFIG, workers=1, worlds=4, mode="async"), horizon=HORIZON, seed=0)
    try:
        for _ in range(4):
            rollouts.sync(policy)
            batches.append(rollouts.next().clone())
            ages.append(rollouts.pool.age)
            shifted(policy)
    finally:
        rollouts.close()
    assert ages == [0, 1, 1, 1]
    policy = policy_of(make_env(4, 0))
    worker = Worker(make_env, policy.act, WorkerSpec(0, 4, HORIZON, 0))
    for iteration, batch in enumerate(batches):
        if iteration > 1:  # the first two are asked for together, with the first weights
            shifted(policy)
        assert same(worker.collect(iteration)[0], batch), iteration


def make_refused(worlds, seed):
    raise ConfigError("robot.urdf=arm.urdf does not exist")


def test_the_exception_of_an_actor_is_in_the_message(ray):
    config = replace(CONFIG, workers=1, worlds=4, restarts=0)
    rollouts = Rollouts(make_crashing, policy_of(make_env(4, 0)), config, horizon=HORIZON, seed=0)
    try:
        rollouts.next()
        with pytest.raises(CollectionError, match="collector worker 0 raised ArithmeticError: the arm is on fire"):
            rollouts.next()
    finally:
        rollouts.close()


def test_a_config_that_a_node_refuses_ends_the_run_at_once(ray):
    config = replace(CONFIG, workers=1, worlds=4)
    rollouts = Rollouts(make_refused, policy_of(make_env(4, 0)), config, horizon=HORIZON, seed=0)
    try:
        with pytest.raises(ConfigError, match=r"robot.urdf=arm.urdf does not exist \(on a node of the cluster\)"):
            rollouts.next()
    finally:
        rollouts.close()


def test_too_few_cores_are_told_at_once(ray):
    start = time.monotonic()
    with pytest.raises(ConfigError, match=r"collector.workers=4 at 1 cores each need 4 cores, and the Ray cluster"):
        Rollouts(make_env, policy_of(make_env(4, 0)), replace(CONFIG, workers=4), horizon=HORIZON, seed=0)
    assert time.monotonic() - start < 2


def test_ray_listens_on_loopback_only(ray):
    (node,) = ray.ray.nodes()
    assert node["NodeManagerAddress"] == "127.0.0.1"
    for port in (node["NodeManagerPort"], node["ObjectManagerPort"]):
        assert listening(port) == "0000000000000000FFFF00000100007F"

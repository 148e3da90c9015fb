"""Environments in programs of other people: an event loop, a pool of processes, threads of their own."""

import asyncio
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import pytest
import torch

from envs import make_env


def reward(seed):
    env = make_env(["task=nl_reach"], seed=seed)
    total = env.rollout(3)["next", "reward"].sum().item()
    env.close()
    return total


def test_an_environment_works_in_a_running_event_loop_and_leaves_threads_alone():
    async def inside():
        return reward(1)

    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(3)
        assert asyncio.run(inside()) < 1
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(threads)


@pytest.mark.slow
def test_a_pickled_environment_works_in_a_process_of_a_pool():
    env = make_env(["task=nl_reach"], seed=4)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        there = pool.submit(first_observation, env).result()
    assert (there == first_observation(env)).all()
    env.close()


def first_observation(env):
    """The robot's part of the observation, as an array, which needs no shared memory."""
    return env.reset()["robot"].numpy()

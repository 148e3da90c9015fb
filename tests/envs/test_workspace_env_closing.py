"""Worlds are freed by whoever owns the environment: each takes 40 MB of memory."""

import pybullet as bullet
from torchrl.collectors import Collector

from tests.helpers.env_cases import make


def test_a_collector_frees_the_worlds_of_its_environment():
    env = make("kuka", "step", "nl_reach", worlds=2)
    clients = [world.client for world in env._worlds]
    collector = Collector(env, None, frames_per_batch=4, total_frames=-1)
    next(iter(collector))
    assert all(map(bullet.isConnected, clients))
    collector.shutdown()
    assert env.is_closed
    assert not any(map(bullet.isConnected, clients))


def test_closing_twice_does_nothing():
    env = make("kuka", "step", "nl_reach")
    env.close()
    env.close()
    assert env.is_closed

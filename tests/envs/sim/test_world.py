"""Objects, resets and memory of worlds."""

import gc
from pathlib import Path

import numpy as np
import pybullet as bullet
import pytest
import torch
from torchrl.collectors import Collector

from tests.helpers.env_cases import BARE_FLANGES, ROBOTS, TOUCHING, Poker, act, clients, hold, make


@pytest.mark.slow
def test_objects_stay_exactly_where_they_were_placed_until_touched():
    env = make("kuka", "step", "nl_reach", "task.num_objects=6", "task.spacing=0.1", worlds=4, seed=1)
    for _ in range(3):
        td = env.reset()
        put = td["objects"].clone()
        for _ in range(40):
            td = act(env, td, hold(env, td))
            assert torch.equal(td["objects"], put)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_objects_are_placed_upright_where_the_task_drew_them(robot):
    env = make(robot, worlds=3, seed=2)
    td = env.reset()
    drawn = [env.task.draw(np.random.default_rng(np.random.SeedSequence(2, spawn_key=(i,)))) for i in range(3)]
    for i, episode in enumerate(drawn):
        rows = td["objects"][i, :, :3].numpy()
        shown = sorted(map(tuple, rows.tolist()))
        assert shown == sorted(map(tuple, episode.scene.positions.astype(np.float32).tolist()))
    assert torch.equal(td["objects"][..., 3:7], torch.tensor([0.0, 0.0, 0.0, 1.0]).expand(3, 3, 4))
    env.close()


@pytest.mark.slow
def test_the_bodies_in_the_slots_have_the_shapes_and_colors_that_are_observed():
    geometry = [bullet.GEOM_BOX, bullet.GEOM_SPHERE, bullet.GEOM_CYLINDER]
    env = make("kuka", "step", "nl_reach", "task.num_objects=4", "task.min_objects=2", seed=2, render=True)
    (world,) = env._worlds  # only Bullet knows what stands there
    for _ in range(15):
        td = env.reset()
        slots = np.flatnonzero(td["objects_mask"][0].numpy())
        assert len(world.pool.shown) == len(slots)
        for body, slot in zip(world.pool.shown, slots, strict=True):
            row = td["objects"][0, slot]
            position, _ = bullet.getBasePositionAndOrientation(body, world.client)
            visual = bullet.getVisualShapeData(body, physicsClientId=world.client)[0]
            assert bullet.getCollisionShapeData(body, -1, world.client)[0][2] == geometry[row[11:14].argmax()]
            np.testing.assert_allclose(visual[7], row[7:11], atol=1e-6)
            np.testing.assert_allclose(position, row[:3], atol=1e-6)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("sleeping", [True, False])
def test_untouched_objects_neither_sink_nor_jump(sleeping):
    env = make("kuka", "step", "nl_reach", f"physics.sleeping={sleeping}", worlds=4, seed=3)
    td = env.reset()
    put = td["objects"][..., :3].clone()
    for _ in range(59):
        td = act(env, td, hold(env, td))
    assert (td["objects"][..., :3] - put).abs().max() < 0.002
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", [robot for robot in ROBOTS if robot not in BARE_FLANGES])
def test_an_object_that_was_pressed_down_lies_on_the_table_afterwards(robot):
    env = make(robot, "step", "nl_reach", TOUCHING, "task.hold_steps=1000", "task.max_steps=1000", worlds=4, seed=4)
    half, lowest = env.config.task.object_size / 2, 1.0
    for _ in range(2):
        td, poker = env.reset(), Poker(env)
        for _ in range(70):
            td = act(env, td, poker(td))
            lowest = min(lowest, heights_on_table(env, td).min())
        for _ in range(20):
            td = act(env, td, env.towards(env.gripper + np.array([0.0, 0.0, 0.1])))
        assert heights_on_table(env, td).min() > half - 0.001
    assert half - 0.001 > lowest > -half  # under an arm's full force the contact gives way, for as long as it presses
    env.close()


def heights_on_table(env, td):
    """Heights of the objects whose centre is over the table's top, metres; those seen at the border may be beyond."""
    top = env.config.workspace.furniture["top"]
    x0, x1, y0, y1, *_ = env.config.workspace.bounds
    corner = np.array(top.size[:2]) / 2
    position = td["objects"][..., :3].double().numpy()
    over = (np.abs(position[..., :2] - top.position[:2]) < corner).all(-1)
    seen = ((position[..., :2] > [x0 + 1e-3, y0 + 1e-3]) & (position[..., :2] < [x1 - 1e-3, y1 - 1e-3])).all(-1)
    return position[over & seen][:, 2]


@pytest.mark.slow
def test_a_touched_object_moves():
    env = make("kuka", "step", "reach", TOUCHING, "task.hold_steps=60", worlds=4, seed=5)
    td = env.reset()
    put, poker = td["objects"][:, 0, :3].clone(), Poker(env)
    for _ in range(50):
        td = act(env, td, poker(td))
    assert ((td["objects"][:, 0, :3] - put).norm(dim=1) > 0.005).any()
    env.close()


def rss():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads memory from /proc")
@pytest.mark.parametrize("render", [False, True])
def test_memory_is_flat_over_many_resets(render):
    env = make("kuka", "step", "nl_reach", seed=6, render=render)
    poker, sizes = Poker(env), []
    for count in (60, 200):
        for _ in range(count):
            td = env.reset()
            td = act(env, td, poker(td))
        gc.collect()
        sizes.append(rss())
    assert sizes[1] < 1.05 * sizes[0]
    assert sizes[1] - sizes[0] < 2 * 2**20  # 10 KB a reset
    env.close()


def test_close_frees_the_worlds_and_is_idempotent():
    before = clients()
    env = make("kuka", worlds=3)
    assert clients() == before + 3
    env.close()
    assert clients() == before
    env.close()
    assert clients() == before
    assert env.is_closed


def test_worlds_can_be_made_and_closed_repeatedly():
    before = clients()
    for _ in range(5):
        env = make("kuka", worlds=2)
        act(env, env.reset(), torch.zeros(2, 3))
        env.close()
    assert clients() == before


def test_a_collector_frees_the_worlds_of_its_environment():
    before, env = clients(), make("kuka", "step", "nl_reach", worlds=2)
    collector = Collector(env, None, frames_per_batch=4, total_frames=-1)
    next(iter(collector))
    assert clients() == before + 2
    collector.shutdown()
    assert env.is_closed
    assert clients() == before

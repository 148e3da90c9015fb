"""Same seed, same bits, where grippers have held things: what they made to hold on is forgotten with the episode."""

import numpy as np
import pytest
import torch

from envs.experts import expert
from tests.helpers.env_cases import ROBOTS, act, differences, make, partial_reset, rollout

STEPS = 60


def history(env, steps=STEPS):
    """What the expert does, each world also begun anew at its own pace, so that some are while they hold something."""
    return rollout(env, steps, lambda td: expert_of(env, td), lambda t, i: t % (23 + 6 * i) == 19)


def expert_of(env, td):
    return expert(env)(td.clone(recurse=False))["action"]


def held(env, td):
    return (env.state.held >= 0).any()


GRASPS = [(robot, "nl_pick_and_place", ()) for robot in ROBOTS] + [
    ("panda", "nl_pick_and_place", ("gripper=magnet",)),
    ("so_arm", "nl_pick_and_place", ("gripper=hinge",)),
    ("kuka", "swipe", ()),
    ("jaco", "pick_and_rotate", ()),
    ("kuka", "nl_push", ()),
]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "task", "more"), GRASPS)
def test_a_seed_gives_the_same_bits_after_any_grasp(robot, task, more):
    env = make(robot, "step", task, *more, worlds=2, seed=5)
    fresh = history(env)
    if env.task.traits.grips:
        assert fresh["privileged", "held"].max() >= 0  # else the test would show little
    env.set_seed(6)
    assert differences(history(env, 34)[:2], fresh[:2]) != []
    env.set_seed(5)
    assert differences(history(env), fresh) == []
    env.close()
    other = make(robot, "step", task, *more, worlds=2, seed=5)
    assert differences(history(other), fresh) == []
    other.close()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_world_with_a_grasp_is_not_changed_by_the_reset_of_another(robot):
    ends = []
    for disturbed in (False, True):
        env = make(
            robot,
            "step",
            "nl_pick_and_place",
            "task.curriculum={near: 0, held: 1, placed: 0}",
            worlds=2,
            seed=5,
        )
        td = env.reset()
        assert (env.state.held >= 0).all()
        for t in range(12):
            td = act(env, td, expert_of(env, td))
            if disturbed and t in (3, 7):
                td = partial_reset(env, td, [1])
        ends.append(td[0].exclude("action").clone())
        env.close()
    assert differences(*ends) == []


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_seed_gives_the_same_bits_after_wild_grasps(robot):
    env = make(
        robot,
        "joints",
        "nl_pick_and_place",
        "task.curriculum={near: 0, held: 0.5, placed: 0}",
        worlds=2,
        seed=5,
    )
    fresh = history(env, 30)
    td, rng = env.reset(), np.random.default_rng(0)
    for t in range(40):
        wild = torch.as_tensor(rng.choice([-1.0, 1.0], env.action_spec.shape), dtype=torch.float32)
        td = act(env, td, wild if t % 8 else env.towards(env.gripper, np.ones(2, bool)))
        over = np.flatnonzero(td["done"][:, 0].numpy())
        td = partial_reset(env, td, over) if len(over) else td
    env.set_seed(5)
    assert differences(history(env, 30), fresh) == []
    env.close()

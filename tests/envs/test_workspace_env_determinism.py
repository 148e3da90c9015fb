"""The same seed gives the same bits: in a fresh environment, after any history, for any number of worlds."""

import numpy as np
import pytest
import torch

from tests.helpers.env_cases import (
    BARE_FLANGES,
    CONTROLS,
    ROBOTS,
    TOUCHING,
    Poker,
    act,
    differences,
    make,
    rollout,
)

STEPS = 100


def own_rhythm(t, i):
    """World i is also reset by itself, each at its own pace."""
    return t % (47 + 7 * i) == 44


def poked(env, steps=STEPS):
    return rollout(env, steps, Poker(env), own_rhythm)


def moved(history):
    """Metres that the most moved object went within an episode."""
    steps = history["objects"][1:, ..., :2] - history["objects"][:-1, ..., :2]
    same = (history["privileged", "sentence"][1:] == history["privileged", "sentence"][:-1]).all(-1)
    steps = steps.norm(dim=-1)[same]
    return steps[steps < 0.03].max()  # a reset is a leap, even where the sentence happens to stay


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "control"), [("kuka", control) for control in CONTROLS] + [(r, "step") for r in ROBOTS if r != "kuka"]
)
def test_a_fresh_environment_gives_the_same_rollout_bit_for_bit(robot, control):
    histories = []
    task = "nl_push" if robot in BARE_FLANGES else "nl_reach"
    for _ in range(2):
        env = make(robot, control, task, TOUCHING, "task.hold_steps=60", worlds=2, seed=5)  # no end while it pushes
        histories.append(poked(env))
        env.close()
    assert moved(histories[0]) > 0.002  # else the test would show little
    assert len({tuple(each.tolist()) for each in histories[0]["instruction"].flatten(0, 1)}) > 5
    assert differences(*histories) == []


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_seed_gives_the_same_bits_after_any_history(robot):
    env = make(robot, worlds=2, seed=5)
    fresh = poked(env)
    for seed, steps in ((6, 13), (7, 45)):
        env.set_seed(seed)
        other = rollout(env, steps, Poker(env, seed))
        assert differences(other[:2], fresh[:2]) != []
        env.set_seed(5)
        assert differences(poked(env), fresh) == []
    env.close()


@pytest.mark.slow
def test_a_seed_gives_the_same_bits_after_wild_motion():
    env = make("panda", "joints", worlds=2, seed=5)
    fresh = poked(env, 60)
    td, rng = env.reset(), np.random.default_rng(0)
    corners = rng.choice([-1.0, 1.0], (6, *env.action_spec.shape))
    for t in range(90):
        td = act(env, td, corners[t // 15])  # through the table, the objects and itself, as far as physics lets it
    env.set_seed(5)
    assert differences(poked(env, 60), fresh) == []
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("control", CONTROLS)
def test_a_world_gives_the_same_bits_for_any_number_of_worlds(control):
    histories = {}
    for worlds in (1, 3, 5):
        env = make("kuka", control, worlds=worlds, seed=5)
        poker, td, steps = Poker(env), env.reset(), []
        for t in range(200 if control == "step" else 80):
            td = act(env, td, poker(td))
            steps.append(td.exclude("action").clone())
            mask = td["done"].clone()
            mask[:, 0] |= torch.tensor([own_rhythm(t, i) for i in range(worlds)])
            td = env.reset(td.exclude("reward", "action").set("_reset", mask))
            steps.append(td.clone())
        histories[worlds] = [torch.stack([step[i] for step in steps if "reward" in step.keys()]) for i in range(worlds)]
        env.close()
    for worlds in (3, 5):
        for i in range(min(worlds, 3)):
            other = histories[1 if i == 0 else 3][i]
            assert differences(histories[worlds][i], other) == []


def test_worlds_differ_from_each_other_and_from_other_seeds():
    env = make(worlds=3, seed=0)
    sentences = []
    for seed in (0, 1):
        env.set_seed(seed)
        td = env.reset()
        sentences += [tuple(row.tolist()) for row in td["objects"].flatten(1)]
    assert len(set(sentences)) == 6
    env.close()

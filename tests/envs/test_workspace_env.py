"""Every task, and every robot with every control, is a correct TorchRL environment.

`check_env_specs` misses an ignored `_reset`, global randomness, wrong rewards and aliased buffers; these tests do not.
"""

import random

import numpy as np
import pytest
import torch
from torchrl.envs.utils import check_env_specs

from envs.mdp.object_rows import COLUMNS
from tests.helpers.env_cases import (
    BARE_FLANGES,
    FEWER,
    Poker,
    act,
    differences,
    hold,
    leaves,
    make,
    name_of,
    partial_reset,
)

pytestmark = pytest.mark.sampled
WORLDS = 3
MARK, IN_THE_AIR = "is the one to be moved; 0 where words say it", "is in the air"


@pytest.fixture(scope="module", params=FEWER, ids=name_of)
def env(request):
    # Where what is asked has been done already, doing nothing succeeds; so does holding what is to be held there.
    begun = ["task.curriculum.placed=0", *["task.curriculum.held=0"] * (request.param[2] == "rearrange")]
    made = make(*request.param, *begun, "task.max_steps=40", worlds=WORLDS, seed=3)
    yield made
    made.close()


def random_actions(env, steps, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (steps, *env.action_spec.shape)).astype(np.float32)


@pytest.mark.slow
def test_check_env_specs_passes(env):
    check_env_specs(env, seed=0)


@pytest.mark.slow
def test_outcomes_rewards_and_ends_of_a_step_are_consistent(env):
    env.set_seed(1)
    td = env.reset()
    for action in random_actions(env, 25):
        td = act(env, td, action)
        assert torch.equal(td["done"], td["terminated"] | td["truncated"])
        assert not (td["terminated"] & td["truncated"]).any()
        ends = td["success"] | td["wrong_object"] | td["wrong_target"]
        assert (td["terminated"] | ~ends).all()
        if not env.task.traits.fails:
            assert torch.equal(td["terminated"], ends)
        assert td["reward"].shape == (WORLDS, 1)
        assert td["reward"].isfinite().all()
        torch.testing.assert_close(td["reward"], td["reward_terms"].sum(1, keepdim=True))
        assert td["reward_terms"].shape == (WORLDS, len(env.reward_names))


@pytest.mark.slow
def test_observations_are_finite_float32_and_within_their_specs_for_any_action(env):
    env.set_seed(2)
    td = env.reset()
    poker = Poker(env)
    for t, action in enumerate(random_actions(env, 50)):
        td = act(env, td, action if t % 2 else poker(td))
        if t % 20 == 19:
            td = partial_reset(env, td, [t % WORLDS])
        assert env.observation_spec.is_in(td.select(*env.observation_spec.keys()))
        for key in ("robot", "objects", "reward_terms"):
            assert td[key].dtype == torch.float32
            assert td[key].isfinite().all()


@pytest.mark.slow
def test_a_partial_reset_resets_the_named_worlds_only(env):
    env.set_seed(4)
    td = env.reset()
    for action in random_actions(env, 8):
        td = act(env, td, action)
    before, after = td.clone(), partial_reset(env, td, [1])
    others = [0, 2]
    shown = ["robot", "objects", "objects_mask", "instruction", "privileged"]
    assert differences(before.select(*shown)[others], after.select(*shown)[others]) == []
    assert {"robot", "objects"} <= set(differences(before.select(*shown)[[1]], after.select(*shown)[[1]]))
    joints = len(env.config.robot.joints)
    noise = max(env.config.task.reset_noise, env.config.task.randomize.start)
    curriculum = env.config.task.curriculum
    if not curriculum.share:  # else some begin elsewhere
        assert np.abs(after["robot"][1, :joints].numpy() - env.kinematics.rest).max() <= noise + 1e-6
    assert (after["robot"][1, joints : 2 * joints] == 0).all()
    assert not after["done"].any()


@pytest.mark.slow
def test_the_reset_of_a_world_does_not_change_the_rollouts_of_others(env):
    actions = random_actions(env, 10)
    ends = []
    for disturbed in (False, True):
        env.set_seed(5)
        td = env.reset()
        for t, action in enumerate(actions):
            td = act(env, td, action)
            if disturbed and t == 4:
                td = partial_reset(env, td, [1])
        ends.append(td[[0, 2]].exclude("action").clone())
    assert differences(*ends) == []


@pytest.mark.slow
def test_a_reset_of_no_world_changes_nothing(env):
    env.set_seed(6)
    td = act(env, env.reset(), random_actions(env, 1)[0])
    after = partial_reset(env, td, [])
    shown = ["robot", "objects", "objects_mask", "instruction", "privileged"]
    assert differences(td.select(*shown), after.select(*shown)) == []


@pytest.mark.slow
def test_returned_tensors_are_never_written_to(env):
    env.set_seed(7)
    handed_out = [env.reset()]
    copies = [handed_out[0].clone()]
    for t, action in enumerate(random_actions(env, 4)):
        handed_out.append(act(env, handed_out[-1], action))
        copies.append(handed_out[-1].clone())
        if t == 2:
            handed_out.append(partial_reset(env, handed_out[-1], [0, 2]))
            copies.append(handed_out[-1].clone())
    assert [differences(td, copy) for td, copy in zip(handed_out, copies, strict=True)] == [[]] * len(copies)


@pytest.mark.slow
def test_a_step_shares_no_memory_with_the_step_before(env):
    env.set_seed(8)
    first = act(env, env.reset(), random_actions(env, 1)[0])
    second = act(env, first, random_actions(env, 1)[0])
    third = partial_reset(env, second, [0])

    def storages(td):
        return {tensor.untyped_storage().data_ptr() for tensor in leaves(td.exclude("action")).values()}

    assert storages(first).isdisjoint(storages(second))
    assert storages(second).isdisjoint(storages(third))


@pytest.mark.slow
def test_each_world_is_truncated_at_exactly_max_steps(env):
    env.set_seed(9)
    td, limit = env.reset(), env.config.task.max_steps
    ages, late = np.zeros(WORLDS, int), 7
    for t in range(limit + late):
        td = act(env, td, hold(env, td))
        ages += 1
        assert td["truncated"][:, 0].tolist() == (ages == limit).tolist()
        assert torch.equal(td["done"], td["truncated"])
        if t + 1 == late:
            td, ages[1] = partial_reset(env, td, [1]), 0
        if t + 1 == limit:
            td, ages[[0, 2]] = partial_reset(env, td, [0, 2]), 0


def test_training_episodes_end_after_the_steps_of_the_curriculum():
    env = make("kuka", "step", "nl_pick_and_place", "task.curriculum={placed:0,max_steps:4}", worlds=WORLDS, seed=3)
    td = env.reset()
    for step in range(4):
        assert not td["truncated"].any(), step
        td = act(env, td, hold(env, td))
    assert td["truncated"].all()
    env.close()


def global_states():
    return random.getstate(), np.random.get_state()[1].tolist(), torch.get_rng_state().tolist()  # noqa: NPY002


def seed_globally(seed):
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    torch.manual_seed(seed)


@pytest.mark.slow
def test_global_random_generators_are_not_used(env):
    ends = []
    for seed in (1, 2):
        env.set_seed(10)
        seed_globally(seed)
        states = global_states()
        td = env.reset()
        for action in random_actions(env, 5):
            td = act(env, td, action)
        ends.append(partial_reset(env, td, [0, 1, 2]).exclude("action").clone())
        assert global_states() == states
    assert differences(*ends) == []


def own_columns(env, *names):
    """Where those of the task's own columns are in the rows of objects that it has."""
    own = [column.name for column in env.task.columns]
    return [COLUMNS.start + own.index(name) for name in names if name in own]


MOVED_SINCE = "share of its way since the instruction was given"  # of a device, which a random move seldom meets


# What may never change; everything else must, over time and episodes.
def constant_elements(env):
    task, joints = env.config.task, len(env.config.robot.joints)
    columns = [14] if task.num_targets else [10, 14, 15]  # size; without targets opacity and role too
    columns += [11, 12, 13] * (len(task.nouns) == 1)
    if env.task.traits.operates:  # levers tilt, and wheels stay as high as they are
        columns += {"press": [3, 4], "turn": [2, 3, 4]}.get(task.name, [])
    columns += own_columns(env, MARK, IN_THE_AIR) if env.task.traits.speaks else []
    columns += own_columns(env, "lies at a target")  # random pokes bring none there: see test_push.py
    rows = {f"objects[{k},{d}]" for k in range(task.slots) for d in columns}
    gripper = {f"robot[{2 * joints + 9}]"}  # fingers that grip nothing stay as they are
    mask = {f"objects_mask[{k}]" for k in range(task.slots)}
    drawn = env.draw_scenes(100, seed=0)["instruction"].numpy()
    usual = [np.unique(column, return_counts=True)[1].max() > 0.9 * len(drawn) for column in drawn.T]
    words = {f"instruction[{i}]" for i in np.flatnonzero(usual)}  # "reach the ...", and padding
    return rows | gripper | mask | words | {"gesture[6]"}  # that a gesture is shown


def constant_so_far(env, seen):
    """Elements that had the same value in all worlds at all steps.

    Of the columns that say how objects are turned, slide or are marked as referents, one object's need to vary.
    """
    constant = set()
    for key in {"robot", "objects", "objects_mask", "instruction", "gesture"} & set(env.observation_spec.keys()):
        values = torch.stack([each[key] for each in seen]).flatten(0, 1)
        for place in np.argwhere((values == values[0]).all(0).numpy()).tolist():
            constant.add(f"{key}[{','.join(map(str, place))}]")
    few = own_columns(env, "slid x (m)", "slid y (m)", MARK, IN_THE_AIR, *[MOVED_SINCE] * env.task.traits.continues)
    for column in (*range(3, 7), *few):
        each = {f"objects[{slot},{column}]" for slot in range(env.config.task.slots)}
        constant -= each if each - constant else set()
    return constant


@pytest.mark.slow
def test_every_element_of_the_observation_varies(env):
    allowed = constant_elements(env)
    # They cannot turn every object over, or take one up, in this time.
    # kuka's magnet stays over what it is only to reach, and nothing else wakes an object.
    above = env.config.robot.name == "kuka" and not env.task.traits.grips
    if above or env.config.robot.name in ("jaco", *BARE_FLANGES):
        allowed |= {f"objects[{k},{d}]" for k in range(env.config.task.slots) for d in range(2, 7)}
        allowed.add(f"robot[{2 * len(env.config.robot.joints) + 11}]")
    env.set_seed(11)
    seen = [env.reset() for _ in range(20)]
    td, poker = seen[-1], Poker(env)
    for t, action in enumerate(random_actions(env, 150)):
        td = act(env, td, action if t % 30 < 4 else poker(td))
        seen.append(td.clone())
        if t % 30 == 29:
            td = partial_reset(env, td, [0, 1, 2])
            seen.append(td.clone())
            if constant_so_far(env, seen) <= allowed:
                break
    assert constant_so_far(env, seen) <= allowed
    alike = env.task.device_width == env.config.task.object_size
    if alike:
        sizes = torch.cat([each["objects"][..., 14][each["objects_mask"].bool()] for each in seen])
        assert len(sizes.unique()) == 1  # a free slot's size is 0

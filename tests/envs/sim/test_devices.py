"""Devices: they are named, operated by an arm, stay or spring back, and go back at reset bit for bit."""

import re

import numpy as np
import pytest
import torch
from torchrl.envs.utils import check_env_specs

from core.errors import ConfigError
from envs.experts import expert
from envs.mdp.object_rows import FACING, nouns_of_rows, scene_of_rows, static_rows
from envs.tasks import State
from envs.tasks.devices import OPERATED, OTHER_OPERATED
from language import DEVICES, NOUNS, ground, parse
from tests.helpers.env_cases import ROBOTS, Poker, act, check_same_bits, hold, make, partial_reset, task_of

pytestmark = pytest.mark.slow

TASKS = {"press": "button", "switch": "lever", "turn": "wheel"}
STAYING = ["switch", "turn"]
WAY = -1  # the column of how far a device has gone
LONG = ("task.hold_steps=1000", "task.max_steps=1000")


def travel(td):
    """(N, K) how far each device has gone, either way."""
    return td["objects"][..., WAY].abs().numpy()


def meant(td):
    """(N,) how far the referents have gone."""
    return travel(td)[range(len(td)), td["privileged", "referent"]]


def others(td):
    """(N,) of two devices, the slot of the one that is not the referent."""
    return 1 - td["privileged", "referent"].numpy()


def operated(env, td, slots=None, steps=60):
    """The expert operates the referents, or these slots, and stays there. Returns every "next"."""
    able, kept = expert(env), []
    for _ in range(steps):
        wanted = td["privileged", "referent"].numpy() if slots is None else slots
        td = act(env, td, able.act(wanted, wanted))
        kept.append(td.exclude("reward", "action").clone())
    return torch.stack(kept)


def away(env, td, steps=25):
    for _ in range(steps):
        up = env.gripper
        up[:, 2] = 0.25
        td = act(env, td, env.towards(up))
    return td


# ---- what is said ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TASKS)
def test_a_sentence_names_the_verb_and_one_device(name):
    task, rng, referents = task_of(name), np.random.default_rng(0), []
    for _ in range(200):
        episode = task.draw(rng)
        instruction = parse(episode.sentence)
        assert (instruction.task, instruction.phrase.noun) == (name, TASKS[name])
        assert ground(instruction, episode.scene) == episode.referent
        assert {thing.noun for thing in episode.scene} == {TASKS[name]}
        referents.append(episode.referent)
    assert 60 < sum(referents) < 140


@pytest.mark.parametrize("name", TASKS)
def test_observed_rows_describe_the_drawn_scene(name):
    env = make("kuka", "step", name, worlds=4, seed=1)
    td = env.reset()
    for i in range(4):
        rows = td["objects"][i].numpy()
        scene = scene_of_rows(rows, nouns=nouns_of_rows(rows, devices=True))
        assert ground(parse(env.sentence(i)), scene) == td["privileged", "referent"][i]
    env.close()


def test_a_device_has_synonyms():
    assert parse("flip the blue handle").phrase.noun == "lever"
    assert parse("press down on the red knob").phrase.noun == "button"
    assert parse("twist the green dial").phrase.noun == "wheel"


# ---- the environment ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TASKS)
def test_check_env_specs_passes(name):
    env = make("kuka", "joints", name, "task.num_objects=3", "task.min_objects=2", "task.spacing=0.15", worlds=2)
    check_env_specs(env, seed=0)
    env.close()


@pytest.mark.parametrize("name", TASKS)
def test_devices_stand_where_they_were_drawn_and_do_not_move(name):
    env = make("kuka", "step", name, worlds=3, seed=2)
    td = env.reset()
    drawn = [env.task.draw(np.random.default_rng(np.random.SeedSequence(2, spawn_key=(i,)))) for i in range(3)]
    for i, episode in enumerate(drawn):
        rows = np.array(sorted(td["objects"][i, :, :7].tolist()))
        lasting = np.array(sorted(static_rows(episode.scene, episode.yaw)[:, :7].tolist()))
        np.testing.assert_allclose(rows[:, :3], lasting[:, :3], atol=1e-5)
        np.testing.assert_allclose(np.abs((rows * lasting)[:, 3:].sum(1)), 1.0, atol=1e-6)  # the same turns
    assert (travel(td) == 0).all()
    for _ in range(40):
        td = act(env, td, hold(env, td))
    assert travel(td).max() < 1e-3
    env.close()


def test_sampled_scenes_have_the_rows_of_simulated_ones():
    env = make("kuka", "step", "switch", worlds=2)
    scenes = env.draw_scenes(5, seed=0)
    assert scenes["objects"].shape[1:] == env.reset()["objects"].shape[1:]
    assert (scenes["objects"][..., WAY] == 0).all()
    torch.testing.assert_close(scenes["objects"][..., FACING].norm(dim=-1), torch.ones(5, 2))
    env.close()


def test_a_world_without_devices_has_no_device_bodies():
    env = make()
    (world,) = env._worlds
    assert (world.devices.bodies, world.furniture.parting) == ([], 0)
    assert env.reset()["objects"].shape[-1] == 16
    env.close()


# ---- what becomes of them -------------------------------------------------------------------------------------------


@pytest.mark.sampled
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", TASKS)
def test_the_expert_operates_the_referent(name, robot):
    env = make(robot, "step", name, worlds=6, seed=21)
    able, td, solved = expert(env), env.reset(), []
    while len(solved) < 24:
        td = act(env, td, able(td.clone())["action"])
        over = np.flatnonzero(td["done"][:, 0].numpy())
        assert (meant(td)[td["success"][:, 0]] >= OPERATED).all()
        solved += td["success"][over, 0].tolist()
        td = partial_reset(env, td, over) if len(over) else td
    env.close()
    assert np.mean(solved) >= 0.95


@pytest.mark.parametrize("name", TASKS)
def test_another_device_ends_the_episode_as_the_wrong_object(name):
    env = make("kuka", "step", name, worlds=6, seed=4)
    td = env.reset()
    history = operated(env, td, others(td), steps=40)
    wrong = history["wrong_object"][..., 0]
    assert wrong.any(0).all()
    assert not history["success"].any()
    for i, first in enumerate(wrong.int().argmax(0).tolist()):
        gone = travel(history[first, i]).max()
        assert gone >= OTHER_OPERATED
        assert travel(history[first - 1, i]).max() < OTHER_OPERATED
    env.close()


@pytest.mark.parametrize("name", TASKS)
def test_a_button_springs_back_and_other_devices_stay(name):
    env = make("kuka", "step", name, *LONG, worlds=3, seed=5)
    td = operated(env, env.reset())[-1]
    assert (meant(td) >= OPERATED).all()
    left = away(env, td)
    assert (meant(left) >= OPERATED).all() == (name in STAYING)
    if name == "press":
        assert meant(left).max() < 1e-3
    else:
        assert (travel(away(env, left, 10)) == travel(left)).all()
    assert (travel(left)[range(3), others(left)] < 1e-3).all()
    after = partial_reset(env, left, [1])
    assert travel(after)[1].max() < 1e-6
    assert (travel(after)[[0, 2]] == travel(left)[[0, 2]]).all()
    env.close()


def test_a_released_button_is_not_pressed():
    env = make("kuka", "step", "press", "task.hold_steps=10", worlds=3, seed=6)
    td = env.reset()
    history = operated(env, td, steps=14)
    assert history["at_goal"].any()
    td = away(env, history[-1])
    assert not td["done"].any()
    terms = torch.stack([*history["reward_terms"], td["reward_terms"]])
    column = env.reward_names.index("operate")
    assert terms[..., column].max() > 0.1
    env.close()


@pytest.mark.parametrize("name", TASKS)
def test_moving_a_device_back_and_forth_has_no_reward(name):
    env = make("kuka", "step", name, *LONG, worlds=2, seed=7)
    td, total = env.reset(), np.zeros((2, len(env.reward_names)))
    for t in range(60):
        place = env.gripper
        place[:, 2] = 0.25
        wanted = td["privileged", "referent"].numpy()
        td = act(env, td, expert(env).act(wanted, wanted) if t < 35 else env.towards(place))
        total += td["reward_terms"].numpy()
    weight = env.config.task.reward["operate"]
    gained = total[:, env.reward_names.index("operate")] / weight
    np.testing.assert_allclose(gained, np.minimum(meant(td) / OPERATED, 1.0), atol=1e-3)
    env.close()


def test_a_wheel_can_be_turned_in_both_directions():
    task = task_of("turn", worlds=1)

    def state(angle):
        turns = np.zeros((1, 2, 4))
        turns[0, :, 2], turns[0, :, 3] = np.sin([angle / 2, 0.0]), np.cos([angle / 2, 0.0])
        places, shown = np.zeros((1, 2, 3)), np.ones((1, 2), bool)
        none = np.zeros((1, 2), bool)
        return State(
            gripper=np.zeros((1, 3)),
            objects=places,
            shown=shown,
            referent=np.zeros(1, int),
            target=np.zeros(1, int),
            movable=shown,
            goals=none,
            quaternions=turns,
            nouns=np.full((1, 2), list(NOUNS).index("wheel")),
            yaw=np.zeros((1, 2)),
        )

    for start in (0.0, 3.1):
        for degrees, far in ((59, False), (61, True), (-59, False), (-61, True)):
            task.reset(np.array([0]), state(start))
            assert task.step(state(start + np.deg2rad(degrees))).at_goal[0] == far


# ---- the same seed, the same bits -----------------------------------------------------------------------------------


@pytest.mark.sampled
@pytest.mark.parametrize(("robot", "control"), [("kuka", "step"), ("panda", "joints")])
@pytest.mark.parametrize("name", TASKS)
def test_a_seed_gives_the_same_bits_after_any_contact_and_for_any_number_of_worlds(name, robot, control):
    def made(worlds):
        return make(robot, control, name, "task.num_objects=3", "task.min_objects=2", *LONG, worlds=worlds, seed=5)

    seen = check_same_bits(made, Poker, between=lambda env: operated(env, env.reset(), steps=45))
    assert len(np.unique(travel(seen))) > 20  # else the test would show little


# ---- what is refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "override", "message"),
    [
        ("press", "task.nouns=[cube]", "task.nouns=['cube'] must be of ['button'] in task.name=press"),
        ("nl_reach", "task.nouns=[lever]", "task.nouns=['lever'] must be of ['cube', 'sphere', 'cylinder']"),
        (
            "nl_reach",
            "task.objects.init=[{noun: wheel, area: [0.4, 0.5, 0, 0.1, 0.03, 0.03]}]",
            "task.objects.init.0.noun=wheel cannot be listed: choose from cube, sphere, cylinder",
        ),
        (
            "turn",
            "task.objects.init=[{area: [0.4, 0.5, 0, 0.1, 0.03, 0.03]}]",
            "task.objects must be empty in task.name=turn",
        ),
        ("switch", "task.num_targets=1", "task.num_targets=1 must be 0 in task.name=switch"),
        ("press", "task.kinds=[]", "must be 1"),
    ],
)
def test_an_impossible_setting_is_an_error(name, override, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        make("kuka", "step", name, override)


def test_a_single_device_needs_no_words():
    env = make("kuka", "step", "press", "task.num_objects=1", "task.kinds=[]")
    assert env.sentence() == ""
    assert operated(env, env.reset(), steps=30)["success"].any()
    env.close()


def test_each_device_has_a_task():
    assert sorted(TASKS.values()) == sorted(DEVICES)

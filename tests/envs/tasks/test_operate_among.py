"""Devices among other devices and loose objects: the words name one, it alone is operated, and the rest stays."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts import expert
from envs.mdp.object_rows import COLUMNS, nouns_of_rows, scene_of_rows
from envs.tasks.devices import OPERATED
from language import DEVICES, NOUNS, SHAPES, ground, parse
from tests.helpers.env_cases import Poker, act, begun, check_same_bits, hold, make, task_of

WORLDS = 4
VERBS = {"nl_press": "button", "nl_switch": "lever", "nl_turn": "wheel"}
KINDS = slice(COLUMNS.start, COLUMNS.start + len(DEVICES))  # the columns that mark devices
FACES = slice(KINDS.stop, KINDS.stop + 2)
NAMES = list(NOUNS)
CASES = [("kuka", "nl_press"), ("panda", "nl_switch"), ("kuka", "nl_turn")]


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def env(request):
    made = make(request.param[0], "step", request.param[1], "task.hold_steps=30", worlds=WORLDS)
    yield made
    made.close()


def is_device(env):
    """(N, K) which objects are devices."""
    return np.isin(env.state.nouns, [NAMES.index(noun) for noun in DEVICES])


def fetched(env, td, slots, steps=45):
    """Every gripper lifts the loose object in its slot (N,). Returns the last "next", and what ended wrongly."""
    wrong, rows = np.zeros(WORLDS, bool), np.arange(WORLDS)
    for _ in range(steps):
        thing, held = env.state.objects[rows, slots], env.state.held == slots
        over = np.linalg.norm((thing - env.gripper)[:, :2], axis=1) < 0.015
        aim = thing + [0.0, 0.0, env.grip_depth]
        aim[:, 2] += np.where(held, 0.15, np.where(over, -0.005 * (env.grip_depth > 0), 0.1))
        low = over & (env.gripper[:, 2] < thing[:, 2] + env.grip_depth + 0.012)
        td = act(env, td, env.towards(aim, held | low))
        wrong |= td["wrong_object"][:, 0].numpy()
    return td, wrong


@pytest.mark.parametrize("name", VERBS)
def test_a_sentence_names_one_of_two_alike_devices_among_other_objects(name):
    task, rng, seconds = task_of(name), np.random.default_rng(0), set()
    for _ in range(100):
        episode = task.draw(rng)
        instruction, nouns = parse(episode.sentence), [thing.noun for thing in episode.scene]
        assert f"nl_{instruction.task}" == name
        assert ground(instruction, episode.scene) == episode.referent
        assert nouns[episode.referent] == VERBS[name]
        assert nouns.count(VERBS[name]) == 2
        assert sum(noun in DEVICES for noun in nouns) == 3
        assert sum(noun in SHAPES for noun in nouns) == 2
        seconds |= {noun for noun in nouns if noun in DEVICES}
        widths = {thing.noun in DEVICES: thing.size for thing in episode.scene}
        assert widths == {True: pytest.approx(0.07), False: 0.05}
    assert seconds == set(DEVICES)


@pytest.mark.slow
def test_rows_say_which_device_an_object_is_where_it_faces_and_how_far_it_has_gone(env):
    td = begun(env)
    rows, device = td["objects"].numpy(), is_device(env)
    for i in range(WORLDS):
        nouns = nouns_of_rows(rows[i], fixtures=tuple(DEVICES))
        assert (nouns == env.state.nouns[i]).all()
        assert ground(parse(env.sentence(i)), scene_of_rows(rows[i], nouns=nouns)) == env.state.referent[i]
    assert (rows[..., KINDS].any(-1) == device).all()
    np.testing.assert_allclose(np.linalg.norm(rows[..., FACES], axis=-1), device, atol=1e-5)
    assert (rows[..., -1] == 0).all()
    scenes = env.draw_scenes(20, seed=0)["objects"].numpy()
    assert scenes.shape[1:] == rows.shape[1:]
    assert (scenes[..., KINDS].sum((1, 2)) == 3).all()
    np.testing.assert_allclose(np.linalg.norm(scenes[..., FACES], axis=-1), scenes[..., KINDS].sum(-1), atol=1e-5)


def test_nothing_moves_while_the_arm_keeps_still(env):
    td = begun(env, seed=4)
    before = env.state.objects.copy()
    for _ in range(25):
        td = act(env, td, hold(env, td))
    np.testing.assert_allclose(env.state.objects, before, atol=1e-3)
    assert not td["done"].any()


def test_the_expert_operates_what_is_meant_and_nothing_else(env):
    td, able = begun(env), expert(env)
    before, rows = env.state.objects.copy(), np.arange(WORLDS)
    for _ in range(29):
        td = act(env, td, able(td.clone())["action"])
        assert not td["wrong_object"].any()
    ways = td["objects"][..., -1].abs().numpy()
    assert (ways[rows, env.state.referent] >= OPERATED).all()
    others = np.ones_like(ways, bool)
    others[rows, env.state.referent] = False
    assert (ways[others] < 0.05).all()
    np.testing.assert_allclose(env.state.objects[others], before[others], atol=2e-3)


def test_another_device_that_is_operated_is_the_wrong_object(env):
    td, able = begun(env, seed=5), expert(env)
    alike = env.state.nouns == env.state.nouns[np.arange(WORLDS), env.state.referent][:, None]
    alike[np.arange(WORLDS), env.state.referent] = False
    slots, wrong = alike.argmax(1), np.zeros(WORLDS, bool)
    for _ in range(30):
        td = act(env, td, able.act(slots, slots))
        wrong |= td["wrong_object"][:, 0].numpy()
    assert wrong.all()


@pytest.mark.slow
def test_a_loose_object_that_is_moved_is_the_wrong_object(env):
    td = begun(env, seed=6)
    slots = (~is_device(env)).argmax(1)
    start = env.state.objects[np.arange(WORLDS), slots].copy()
    td, wrong = fetched(env, td, slots)
    moved = np.linalg.norm(env.state.objects[np.arange(WORLDS), slots] - start, axis=1)
    assert (moved > 0.05).any()  # spheres slip out of fingers
    assert wrong[moved > 0.05].all()


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "name"), [("kuka", "nl_turn"), ("panda", "nl_switch")])
def test_a_seed_gives_the_same_bits_after_any_contact_and_for_any_number_of_worlds(robot, name):
    seen = check_same_bits(lambda n: make(robot, "step", name, "task.hold_steps=100", worlds=n, seed=5), Poker)
    assert seen["objects"][..., -1].unique().numel() > 20  # else the test would show little


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["task.min_objects=2"], "task.min_objects=2 must be at least 3 in task.name=nl_press: 3 devices"),
        (["task.num_targets=1"], "task.num_targets=1 must be 0 in task.name=nl_press"),
        (
            ["task.nouns=[button]"],
            "task.nouns=['button'] must be of ['cube', 'sphere', 'cylinder'] in task.name=nl_press",
        ),
        (["task.objects.init=[{area: [0.4, 0.5, 0, 0.1, 0.03, 0.03]}]"], "task.min_objects=1 must be at least 3"),
        (["task.num_objects=8", "task.spacing=0.3"], "task.num_objects=8"),
    ],
)
def test_an_impossible_setting_is_an_error(overrides, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        make("kuka", "step", "nl_press", *overrides)


def test_what_is_noticed_late_leaves_the_memory_of_all_else_as_it_is(env):
    guide, td = expert(env, privileged=True), env.reset()
    task, state = env.task, env.state
    for _ in range(40):
        td = act(env, td, guide(td.clone())["action"])
        world = int(np.abs(task.travel(state)[range(WORLDS), state.referent]).argmax())
        travelled = task.travel(state).copy()
        if abs(travelled[world, state.referent[world]]) > 0.2:
            break
    assert abs(travelled[world, state.referent[world]]) > 0.2
    loose = np.flatnonzero(state.shown[world] & ~is_device(env)[world])[:1]
    task.notice(world, loose, state)
    np.testing.assert_array_equal(task.travel(state), travelled)
    task.reset(np.array([world]), state)
    assert task.travel(state)[world, state.referent[world]] == 0.0

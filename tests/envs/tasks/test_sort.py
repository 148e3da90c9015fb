"""Sorting: what is said and drawn, one step after another, what counts, and what is refused."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts import Oracle, expert
from envs.interactive.interactive_env import InteractiveEnv
from envs.tasks import NOTHING, GivenInstruction
from envs.tasks.sort import APART, AROUND, SORTED, Spots, is_sorted
from language import parse
from tests.helpers.env_cases import act, config_of, make, task_of

WORLDS = 3
NAME = "nl_sort"
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"
AREA = [0.32, 0.56, -0.3, 0.3]
SIZE = 0.05
GIVEN = ("kind", "referent", "target", "sentence", "heard")


def alike(scene, referent):
    return np.flatnonzero(~scene.targets & (scene.colors == scene.colors[referent]))


@pytest.mark.slow
def test_the_sentence_names_every_object_of_a_colour_and_the_policy_hears_the_first_step():
    task, rng, counts = task_of(NAME, PLAIN), np.random.default_rng(0), set()
    for _ in range(40):
        episode = task.draw(rng)
        scene, target = episode.scene, episode.target
        members = alike(scene, episode.referent)
        whole, step = parse(episode.sentence, scene), parse(episode.heard, scene)
        assert episode.sentence.startswith("sort every ")
        assert sorted(each.init for each in whole.steps) == members.tolist()
        assert {each.goal for each in whole.steps} == {target} == set(np.flatnonzero(scene.targets))
        assert (step.steps[0].task, step.steps[0].init, step.steps[0].goal) == ("sort", episode.referent, target)
        away = np.linalg.norm((scene.positions - scene.positions[target])[~scene.targets][:, :2], axis=1)
        assert (away >= AROUND).all()
        assert (scene.colors == scene.colors[target]).sum() == 1
        assert Spots(AREA, SIZE).inside(scene.positions[target]).sum() >= len(members)
        counts.add((len(members), len(scene) - 1))
    assert counts == {(2, 3), (3, 3), (2, 4), (3, 4), (2, 5), (3, 5)}


def first_step(episode):
    return GivenInstruction(**{field: getattr(episode, field) for field in GIVEN})


def test_steps_go_on_until_all_have_been_brought_and_each_names_one_object():
    task, rng = task_of(NAME, PLAIN), np.random.default_rng(1)
    for _ in range(30):
        episode = task.draw(rng)
        scene, spots = episode.scene, Spots(AREA, SIZE)
        left = set(alike(scene, episode.referent).tolist())
        said = first_step(episode)
        while said is not None:
            assert said.sentence == episode.sentence
            assert parse(said.heard, scene).steps[0].init == said.referent
            assert len(said.heard.split()) > 4
            left.remove(said.referent)
            places = scene.positions.copy()
            mark = places[episode.target]
            places[said.referent] = spots.free(places[None], ~scene.targets[None], mark[None])[0, said.referent]
            scene = scene.moved(places)
            said = task.next_instruction(scene, NOTHING, rng, last=said)
        assert not left


def test_what_was_moved_away_again_is_sorted_once_more():
    task, rng = task_of(NAME, PLAIN), np.random.default_rng(1)
    episode = task.draw(rng)
    mark, members = episode.scene.positions[episode.target], alike(episode.scene, episode.referent)
    places = episode.scene.positions.copy()
    places[members] = mark + [[0.0, 0.1 * i - 0.1, 0.0] for i in range(len(members))]
    last = first_step(episode)
    assert task.next_instruction(episode.scene.moved(places), NOTHING, rng, last=last) is None
    places[members[0]] = mark + [0.0, SORTED + 0.01, 0.0]
    assert task.next_instruction(episode.scene.moved(places), NOTHING, rng, last=last).referent == members[0]


def test_what_no_superlative_names_is_said_to_be_the_farthest_from_the_marked_place():
    task, rng = task_of(NAME, PLAIN, "task.kinds=[color]"), np.random.default_rng(1)
    scene = task_of(NAME, PLAIN).draw(rng)
    last = first_step(scene)
    said = task.next_instruction(scene.scene, NOTHING, rng, last=last)
    assert "farthest from" in said.heard
    assert parse(said.heard, scene.scene).steps[0].init == said.referent


def test_the_middle_is_free_first_and_then_the_nearest_spot_beside_it():
    spots, mark = Spots(AREA, SIZE), np.array([0.44, 0.0, SIZE / 2])
    things = np.array([mark + [0.0, 0.25, 0.0], mark + [0.0, -0.25, 0.0], mark])
    real = np.array([[True, True, False]])
    free = spots.free(things[None], real, mark[None])[0]
    np.testing.assert_allclose(free[:2], [mark, mark])
    things[1] = mark
    free = spots.free(things[None], real, mark[None])[0]
    np.testing.assert_allclose(free[0], mark + [0.0, 0.1, 0.0])
    np.testing.assert_allclose(free[1], mark)  # where it is
    corner = np.array([0.32, 0.3, SIZE / 2])
    things[1] = corner
    free = spots.free(things[None], real, corner[None])[0, 0, :2]
    assert AREA[0] <= free[0] <= AREA[1]
    assert free[1] <= AREA[3]
    assert np.linalg.norm(free - corner[:2]) >= APART
    assert is_sorted(mark + [0.0, 0.129, 0.0], mark, SIZE)
    assert not is_sorted(mark + [[0.0, 0.131, 0.0], [0.0, 0.0, 0.02]], mark, SIZE).any()


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "guide"), [("kuka", expert), ("panda", expert), ("kuka", Oracle)])
def test_the_expert_sorts_all_and_pushes_nothing_in_one_episode_whose_last_step_is_its_success(robot, guide):
    env = make(robot, "step", NAME, PLAIN, worlds=WORLDS, seed=4)
    td, before, rows = env.reset(), env.state.objects.copy(), np.arange(WORLDS)
    colors = env._arrays.rows[:, :, 7:10].copy()
    wanted = [
        np.flatnonzero(env.state.movable[i] & (colors[i] == colors[i, env.state.referent[i]]).all(1)) for i in rows
    ]
    target, sentences = env.state.target.copy(), [env.sentence(i) for i in range(WORLDS)]
    guide, said, over = guide(env), [set() for _ in range(WORLDS)], np.zeros(WORLDS, bool)
    for _ in range(3 * env.config.task.max_steps):
        for i in rows[~over]:
            said[i].add(env.tokenizer.decode(td["instruction"][i].tolist()))
            assert env.sentence(i) == sentences[i]
        td = act(env, td, guide(td.clone())["action"])
        assert not (td["success"] & ~td["terminated"]).any()
        ended = td["done"][:, 0].numpy() & ~over
        assert td["success"][ended].all()
        for i in rows[ended]:
            places, mark = env.state.objects[i], env.state.objects[i, target[i]]
            assert is_sorted(places[wanted[i]], mark, SIZE).all()
            others = np.setdiff1d(np.flatnonzero(env.state.movable[i]), wanted[i])
            np.testing.assert_allclose(places[others], before[i, others], atol=0.01)
            assert len(said[i]) == len(wanted[i])
        over |= ended
        if over.all():
            break
    assert over.all()
    env.close()


def test_what_is_held_at_the_mark_or_lies_in_the_way_of_another_is_not_sorted():
    env = make("kuka", "step", NAME, PLAIN, "task.hold_steps=2", seed=1)
    env.reset()
    state, task = env.state, env.task
    referent, mark = state.referent[0], state.objects[0, state.target[0]].copy()
    other = np.flatnonzero(state.movable[0] & (np.arange(state.shown.shape[1]) != referent))[0]
    begun = state.objects.copy()
    for place, neighbour, holds, reached in (
        ([0.0, 0.12, 0.0], None, False, True),
        ([0.0, 0.12, 0.0], None, True, False),
        ([0.0, 0.14, 0.0], None, False, False),
        ([0.0, 0.0, 0.05], None, False, False),
        ([0.0, 0.12, 0.0], [0.0, 0.06, 0.0], False, False),
        ([0.0, 0.12, 0.0], [0.0, 0.05, 0.0], False, True),
    ):
        state.objects[:] = begun
        if neighbour is not None:
            state.objects[0, other] = mark + neighbour
        state.held[0] = referent
        state.objects[0, referent] = mark + [0.0, 0.0, 0.2]
        task.reset(np.array([0]), state)
        task.step(state)
        state.objects[0, referent], state.held[0] = mark + place, referent if holds else NOTHING
        outcomes = [task.step(state) for _ in range(4)]
        assert outcomes[-1].success[0] == reached, (place, neighbour, holds)
    env.close()


def test_scenes_that_are_drawn_have_the_columns_of_those_that_are_simulated():
    env = make("kuka", "step", NAME, PLAIN, worlds=2, seed=1)
    env.reset()
    for i in range(2):
        episode = env.task.draw(np.random.default_rng(i))
        env.start([episode], seed=0)
        slots = env._arrays.slots[0]
        np.testing.assert_allclose(env.task.seen(env.state)[0, slots], env.task.described(episode), atol=2e-3)
    env.close()


def test_where_a_person_gives_the_instructions_none_follows_by_itself():
    env = InteractiveEnv(config_of(f"task={NAME}", PLAIN), seed=1)
    env.reset()
    assert list(env._next_goals(np.ones(1, bool))) == []
    env.close()


def test_about_half_of_the_training_episodes_begin_with_some_objects_sorted_and_evaluations_do_not():
    for overrides, least, most in (([], 15, 45), ([PLAIN], 0, 0)):
        task, rng, begun = task_of(NAME, *overrides), np.random.default_rng(0), 0
        for _ in range(60):
            episode = task.draw(rng)
            scene = episode.scene
            done = is_sorted(scene.positions, scene.positions[episode.target], SIZE) & ~scene.targets
            assert not done[episode.referent]
            begun += bool(done.any())
        assert least <= begun <= most


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("task.min_objects=2", "task.min_objects=2 must be at least 3"),
        ("task.instructions=2", "task.instructions=2 must be 1 in task.name=nl_sort"),
        ("task.num_targets=2", "task.num_targets=2 must be 1"),
        ("workspace.object_area=[0.4, 0.45, -0.05, 0.05]", "has room for them"),
        ("task.kinds=[shape]", "cannot name what task.name=nl_sort sorts"),
    ],
)
def test_what_cannot_be_sorted_is_refused_in_one_message(override, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        task_of(NAME, override).draw(np.random.default_rng(0))

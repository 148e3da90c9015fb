"""Handing an object to a person: what is said and drawn, what counts, and what is refused."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts import Oracle, expert
from envs.tasks import NOTHING
from envs.tasks.hand_over import AROUND, PUSHED
from envs.tasks.shared.open_hand import HAND_NUMBER
from human import Body
from language import parse
from tests.helpers.env_cases import act, make, partial_reset, succeed_in_all, task_of

WORLDS = 3
NAME = "nl_hand_over"
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"
OFFERING = "workspace=handover"


@pytest.fixture(scope="module", params=["kuka", "panda"])
def env(request):
    made = make(request.param, "step", NAME, PLAIN, worlds=WORLDS, seed=4)
    yield made
    made.close()


def test_the_sentence_names_a_loose_object_and_the_hand_is_its_goal():
    task, rng, places = task_of(NAME, PLAIN, "task.varied=true"), np.random.default_rng(0), []
    sentences = set()
    for _ in range(60):
        episode = task.draw(rng)
        step = parse(episode.sentence, episode.scene).steps[-1]
        assert (step.task, step.init, step.goal) == ("hand_over", episode.referent, episode.target)
        assert episode.scene.nouns[episode.target] == HAND_NUMBER
        assert episode.fixed.tolist() == (episode.scene.nouns == HAND_NUMBER).tolist()
        hand = episode.scene.positions[episode.target]
        others = np.delete(episode.scene.positions, episode.target, axis=0)
        assert (np.linalg.norm((others - hand)[:, :2], axis=1) >= AROUND).all()
        places.append(hand)
        sentences.add(episode.sentence.split(" the ")[0])
    assert (np.ptp(places, axis=0) > [0.07, 0.35, 0.04]).all()
    assert len(sentences) > 4
    for episode in task.each_in_turn(rng):
        assert parse(episode.sentence, episode.scene).steps[-1].init == episode.referent


@pytest.mark.slow
@pytest.mark.parametrize("guide", [expert, Oracle])
def test_the_expert_lays_the_referent_on_the_palm_and_pushes_nothing(env, guide):
    env.set_seed(4)
    td, rows = env.reset(), np.arange(WORLDS)
    guide, before, target = guide(env), env.state.objects.copy(), env.state.target.copy()
    referent = env.state.referent.copy()
    td = succeed_in_all(env, td, guide)
    assert (env.state.held == NOTHING).all()
    at, palms = env.state.objects[rows, referent], env.state.objects[rows, target]
    np.testing.assert_allclose(at - palms, [[0.0, 0.0, 0.025]] * WORLDS, atol=0.02)
    others = np.ones(before.shape[:2], bool)
    others[rows, referent] = False
    np.testing.assert_allclose(env.state.objects[others], before[others], atol=0.01)
    assert not partial_reset(env, td, [0])["success"][0]


def test_what_is_held_over_the_palm_or_lies_beside_it_is_not_handed_over_and_a_pushed_hand_is_a_failure():
    env = make("kuka", "step", NAME, PLAIN, "task.hold_steps=2", seed=1)
    env.reset()
    state, task = env.state, env.task
    referent, target = state.referent[0], state.target[0]
    palm = state.objects[0, target].copy()
    on, beside = palm + [0.02, 0.02, 0.025], palm + [0.0, 0.06, 0.025]
    for place, holds, reached in ((on, True, False), (beside, False, False), (on, False, True)):
        state.held[0] = referent
        state.objects[0, referent] = palm + [0.0, 0.0, 0.1]
        task.reset(np.array([0]), state)
        task.step(state)
        state.objects[0, referent], state.held[0] = place, referent if holds else NOTHING
        outcomes = [task.step(state) for _ in range(4)]
        assert outcomes[-1].success[0] == reached
    state.held[0] = NOTHING
    state.objects[0, referent] = beside
    task.reset(np.array([0]), state)
    state.objects[0, target, 2] = palm[2] - 0.5 * PUSHED
    assert not task.step(state).failed[0]
    state.objects[0, target, 2] = palm[2] - 1.1 * PUSHED
    assert task.step(state).failed[0]
    env.close()


def test_a_gripper_that_presses_on_the_hand_pushes_it_down():
    env = make("kuka", "step", NAME, PLAIN, seed=1)
    td = env.reset()
    for _ in range(80):
        palm = env.state.objects[np.arange(1), env.state.target]
        above = np.linalg.norm((env.gripper - palm)[:, :2]) > 0.01
        td = act(env, td, env.towards(palm + [0.0, 0.0, 0.1 if above else -0.05], np.zeros(1, bool)))
        if td["done"].any():
            break
    assert td["terminated"].any()
    assert not td["success"].any()
    assert env.task.step(env.state).failed[0]
    env.close()


def test_the_left_hand_of_the_person_is_drawn_at_the_palm():
    env = make("kuka", "step", NAME, PLAIN, seed=2, render=True)
    env.reset()
    person, palm = env._worlds[0].person, env.state.objects[0, env.state.target[0]]
    assert isinstance(person, Body)
    hand = person._frame(person._links.index("l_hand"))
    at = hand[:3, :3] @ [0.0, -0.018, -0.055] + hand[:3, 3]
    np.testing.assert_allclose(at, palm, atol=3e-3)
    np.testing.assert_allclose(hand[:3, :3] @ [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], atol=0.03)
    env.close()


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["workspace=table"], "choose workspace=handover"),
        (["workspace=collabtable"], "choose workspace=handover"),
        (["workspace.human.palm=[0.3, 0.56, -0.22, 0.22, 0.1, 0.16]"], "the person cannot hold an open hand there"),
        (["workspace.human.palm=[0.5, 0.9, -0.22, 0.22, 0.1, 0.16]"], "must lie in workspace.gripper_box"),
        (["workspace.human.palm=[0.5, 0.4]"], "must be [] or 6 numbers"),
        (["task.num_objects=1"], "task.num_objects=1 must be at least 2"),
    ],
)
def test_what_cannot_be_handed_over_is_refused_in_one_message(overrides, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        task_of(NAME, *overrides)

"""The open hand of a person in a room: what is drawn and observed of it, what is feasible, and what is refused."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs import make_env
from envs.experts import expert
from envs.mdp.object_rows import COLUMNS
from envs.tasks.shared.feasible import PLAIN_VERBS as VERBS
from envs.tasks.shared.open_hand import HAND_NUMBER, lies_on_palm
from envs.tasks.shared.types import NOTHING
from language import DEVICES, FITTINGS, HAND, parse
from language.verbs import DEVICE_VERBS, HANDING
from tests.helpers.env_cases import act, begun, config_of, make, succeed_in_all, task_of

WORLDS = 3
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"
HANDED = f"task.verbs=[{HANDING}]"
NOBODY = ("task.hand=false", "task.num_objects=11", "task.min_objects=8")


@pytest.fixture(scope="module", params=["kuka", "panda"])
def env(request):
    made = make(request.param, "step", "anything", PLAIN, HANDED, "task.instructions=2", worlds=WORLDS)
    yield made
    made.close()


def on_hand(env):
    """(N, K) which objects lie on the hand."""
    state, half = env.state, env.config.task.object_size / 2
    hands = np.argmax(state.nouns == HAND_NUMBER, axis=1)
    offset = state.objects - state.objects[np.arange(len(hands)), hands][:, None] - [0.0, 0.0, half]
    return lies_on_palm(offset) & state.movable & state.shown


def test_a_hand_is_the_last_object_and_held_out_where_the_person_reaches():
    task, rng, places = task_of("anything"), np.random.default_rng(0), []
    for _ in range(60):
        episode = task.draw(rng)
        hands = np.flatnonzero(episode.scene.nouns == HAND_NUMBER)
        assert hands.tolist() == [len(episode.scene) - 1]
        assert episode.fixed[hands[0]]
        places.append(episode.scene.positions[hands[0]])
    low, high = np.reshape(config_of("task=anything").workspace.human.palm, (3, 2)).T
    assert (np.min(places, axis=0) >= low).all()
    assert (np.max(places, axis=0) <= high).all()
    assert (np.ptp(places, axis=0) > 0.8 * (high - low)).all()


def test_the_policy_observes_which_object_is_the_hand(env):
    td = begun(env, seed=2)
    at = [column.name for column in env.task.columns].index("is the hand")
    assert at == len(FITTINGS) + len(DEVICES)  # after the other marks
    marks = td["objects"][..., COLUMNS.start + at].numpy()
    assert (marks == (env.state.shown & (env.state.nouns == HAND_NUMBER))).all()
    drawn = env.draw_scenes(20, seed=1)
    assert (drawn["objects"][..., COLUMNS.start + at].sum(1) == 1).all()


def test_the_words_name_the_object_alone_and_the_hand_is_its_target():
    task, rng = task_of("anything", HANDED), np.random.default_rng(1)
    for _ in range(20):
        episode = task.draw(rng)
        step = parse(episode.sentence, episode.scene).steps[-1]
        assert (step.task, step.init, step.goal) == (HANDING, episode.referent, episode.target)
        assert HAND not in episode.sentence


@pytest.mark.slow
def test_what_was_handed_over_stays_on_the_hand_and_nothing_else_is_asked_for_then(env):
    td = succeed_in_all(env, begun(env, seed=3), expert(env))
    assert (on_hand(env).sum(1) == 1).all()
    assert on_hand(env)[np.arange(WORLDS), env.state.referent].all()
    assert (env.state.held == NOTHING).all()
    assert td["done"].all()  # no second instruction was possible


@pytest.mark.slow
def test_the_expert_goes_on_after_it_handed_something_over_and_leaves_it_there():
    both = f"task.verbs=[{HANDING},reach]"
    env = make("kuka", "step", "anything", PLAIN, both, "task.instructions=4", worlds=4)
    td, guide, ended = begun(env, seed=6), expert(env), np.zeros(4, bool)
    handed = np.zeros(4, int)
    for _ in range(240):
        verbs = env.state.kind.copy()
        td = act(env, td, guide(td.clone())["action"])
        success, done = td["success"][:, 0].numpy(), td["done"][:, 0].numpy()
        assert success[done & ~ended].all()
        handed += success & ~ended & (verbs == env.task.verbs.index(HANDING))
        ended |= done
        if ended.all():
            break
    assert ended.all()
    assert (on_hand(env).sum(1) == handed).all()
    assert handed.max() == 1
    env.close()


def test_without_a_hand_there_are_the_verbs_and_columns_of_before():
    task, all_of_it = task_of("anything", *NOBODY), task_of("anything")
    assert task.verbs == (*VERBS, *DEVICE_VERBS)
    assert [column for column in all_of_it.columns if column.name != "is the hand"] == list(task.columns)
    assert HAND not in task.fixtures
    assert (task.draw(np.random.default_rng(0)).scene.nouns != HAND_NUMBER).all()


def test_a_hand_needs_a_person_and_devices():
    with pytest.raises(ConfigError, match=re.escape("task.hand=true needs devices, and task.devices=0: take task=an")):
        make_env(["task=anything", "task.devices=0", "task.num_objects=7", "task.min_objects=5"])
    with pytest.raises(ConfigError, match=re.escape("task.hand=true needs devices")):
        make_env(["task=nl_lift", "task.hand=true"])
    with pytest.raises(ConfigError, match=re.escape("workspace.name=studio has none: choose")):
        make_env(["task=anything", "workspace.human.palm=[]"])

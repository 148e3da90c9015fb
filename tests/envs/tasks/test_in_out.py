"""Putting objects into the drawer and the fridge, and taking them out: what is drawn, judged and left."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts import expert
from envs.tasks import NOTHING
from envs.tasks.shared.fittings import OPEN
from language import FITTINGS, parse
from tests.helpers.env_cases import make, partial_reset, succeed_in_all, task_of

WORLDS = 3
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"


@pytest.fixture(scope="module", params=[("kuka", "nl_put_in"), ("panda", "nl_take_out")], ids="-".join)
def env(request):
    made = make(request.param[0], "step", request.param[1], PLAIN, worlds=WORLDS, seed=4)
    yield made
    made.close()


def referent_in(env):
    """(N, K) which fittings the referents are in."""
    return env.task._referent_in(env.state)


@pytest.mark.parametrize("name", ["nl_put_in", "nl_take_out"])
def test_the_sentence_names_a_loose_object_and_an_open_fitting(name):
    task, rng, named = task_of(name, PLAIN), np.random.default_rng(0), set()
    for _ in range(40):
        episode = task.draw(rng)
        step = parse(episode.sentence, episode.scene).steps[-1]
        assert f"nl_{parse(episode.sentence).task}" == name
        assert (step.init, step.goal) == (episode.referent, episode.target)
        assert episode.shares[episode.target] > OPEN
        inside = task.fittings.inside(episode.scene.nouns, episode.scene.positions)
        assert inside[episode.referent, episode.target] == (name == "nl_take_out")
        named.add(episode.scene[episode.target].noun)
    assert named == {*FITTINGS}
    for episode in task.each_in_turn(rng):
        assert parse(episode.sentence, episode.scene).steps[-1].goal == episode.target


@pytest.mark.slow
def test_the_expert_leaves_the_referent_in_or_out_and_pushes_nothing(env):
    env.set_seed(4)
    td, rows = env.reset(), np.arange(WORLDS)
    guide, before, target = expert(env), env.state.objects.copy(), env.state.target.copy()
    referent, insides = env.state.referent.copy(), referent_in(env).any(1)
    putting = env.config.task.name == "nl_put_in"
    assert (insides != putting).all()
    td = succeed_in_all(env, td, guide)
    assert (env.state.held == NOTHING).all()
    assert (referent_in(env)[rows, target] == putting).all()
    others = np.ones(before.shape[:2], bool)
    others[rows, referent] = False
    np.testing.assert_allclose(env.state.objects[others], before[others], atol=0.03)
    assert not partial_reset(env, td, [0])["success"][0]


def test_the_other_fitting_is_the_wrong_target_and_a_pushed_one_a_failure():
    env = make("kuka", "step", "nl_put_in", PLAIN, "task.hold_steps=2", seed=1)
    td, state, task = env.reset(), env.state, env.task
    while state.goals.sum() < 2:  # until both are open
        td = partial_reset(env, td, [0])
    fits, referent, target = task.fittings.middles(state.nouns, state.objects)[0], state.referent[0], state.target[0]
    other = next(slot for slot in np.flatnonzero(state.goals[0]) if slot != target)
    state.objects[0, referent] = fits[other]
    outcomes = [task.step(state) for _ in range(3)]
    assert outcomes[-1].wrong_target[0]
    assert not outcomes[-1].success[0]
    task.reset(np.array([0]), state)
    fitting = task.fittings.by_noun[int(state.nouns[0, target])]
    state.objects[0, target] = fitting.handle_at(fitting.value(0.6))
    assert task.step(state).failed[0]
    env.close()


def test_a_workspace_whose_fittings_hold_nothing_is_refused():
    with pytest.raises(ConfigError, match=re.escape("choose workspace=room")):
        task_of("nl_put_in", "workspace=table")

"""Unstacking in the simulation: what is drawn, where the table is free, and what the expert leaves."""

import re

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts import expert
from envs.tasks import NOTHING
from envs.tasks.shared.free_places import APART
from language import ground, parse
from tests.helpers.env_cases import act, make, task_of

WORLDS, SIZE = 3, 0.05
PLAIN = "task.curriculum={near: 0, held: 0, placed: 0}"


@pytest.fixture(scope="module")
def env():
    made = make("kuka", "step", "nl_unstack", PLAIN, worlds=WORLDS, seed=8)
    yield made
    made.close()


def test_the_sentence_names_one_of_the_upper_objects():
    task, rng, heights = task_of("nl_unstack", PLAIN), np.random.default_rng(0), []
    for _ in range(40):
        episode = task.draw(rng)
        assert episode.sentence.startswith("unstack the ")
        assert ground(parse(episode.sentence), episode.scene) == episode.referent
        assert episode.target is None
        heights.append(episode.scene.positions[:, 2] / SIZE)
        assert heights[-1][episode.referent] == pytest.approx(1.5)
    np.testing.assert_allclose(heights, [[1.5, 1.5, 0.5, 0.5]] * 40)
    assert {episode.referent for episode in task.each_in_turn(rng)} == {0, 1}


def test_the_observed_place_is_free_of_all_other_objects(env):
    env.set_seed(8)
    td = env.reset()
    x0, x1, y0, y1 = env.config.workspace.object_area
    for slot in range(4):
        place = td["objects"][:, slot, :2].double().numpy() + td["objects"][:, slot, -2:].double().numpy()
        others = np.delete(env.state.objects[..., :2], slot, axis=1)
        assert (np.linalg.norm(others - place[:, None], axis=2) >= APART).all()
        assert ((place > np.array([x0, y0]) - 1e-6) & (place < np.array([x1, y1]) + 1e-6)).all()


def test_the_expert_leaves_the_referent_on_the_table_and_all_others_where_they_were(env):
    env.set_seed(8)
    td, rows = env.reset(), np.arange(WORLDS)
    guide, before, referent = expert(env), env.state.objects.copy(), env.state.referent.copy()
    solved = np.zeros(WORLDS, bool)
    for _ in range(60):
        td = act(env, td, guide(td.clone())["action"])
        solved |= td["success"][:, 0].numpy()
    assert solved.all()
    assert (env.state.held == NOTHING).all()
    np.testing.assert_allclose(env.state.objects[rows, referent, 2], SIZE / 2, atol=0.002)
    before[rows, referent] = env.state.objects[rows, referent]
    np.testing.assert_allclose(env.state.objects, before, atol=0.005)


@pytest.mark.parametrize(
    "override", ["task.min_objects=3", "task.objects.init=[{area: [0.4, 0.5, 0, 0.1, 0.03, 0.03]}]"]
)
def test_a_config_without_two_stacks_is_refused(override):
    with pytest.raises(ConfigError, match=re.escape("must be at least 4 in task.name=nl_unstack")):
        task_of("nl_unstack", override)

"""Scenes that are drawn but never simulated show what episodes show as they begin."""

import numpy as np
import pytest

from core.errors import ConfigError
from envs.mdp.object_rows import COLUMNS
from tests.helpers.env_cases import make


@pytest.mark.parametrize("name", ["nl_unstack", "nl_sort", "nl_take_out"])
def test_columns_that_a_scene_tells_are_those_of_an_episode_that_begins_with_it(name, monkeypatch):
    env = make("kuka", "step", name, worlds=1)
    episode = env.task.draw(np.random.default_rng(4))
    begun = env.start([episode], 0)
    monkeypatch.setattr(env.task, "draw", lambda rng: episode)
    drawn = env.draw_scenes(1, seed=4)
    for rows, mask in ((each["objects"][0].numpy(), each["objects_mask"][0].numpy()) for each in (drawn, begun)):
        seen = rows[mask]
        order = np.abs(seen[:, None, :3] - episode.scene.positions).sum(-1).argmin(0)  # rows in the scene's order
        low, high = np.array([(column.low, column.high) for column in env.task.columns]).T
        described = np.clip(env.task.described(episode), low, high)
        np.testing.assert_allclose(seen[order][:, COLUMNS], described, atol=5e-3)
        assert np.ptp(described, axis=0).max() > 0.01
    env.close()


@pytest.mark.parametrize(("most", "slots"), [(0, 3), (2, 3), (5, 5)])
def test_drawn_scenes_may_have_more_objects_than_episodes(most, slots):
    env = make("kuka", "step", "nl_reach", f"task.drawn_objects={most}", worlds=1)
    drawn, begun = env.draw_scenes(40, seed=0), env.reset()
    counts = set(drawn["objects_mask"].sum(1).tolist())
    assert drawn["objects"].shape[1] == slots
    assert counts == set(range(3, slots + 1))
    assert begun["objects"].shape[1] == 3
    env.close()


def test_drawn_objects_must_be_as_many_as_can_be_shown():
    with pytest.raises(ConfigError, match=r"task\.drawn_objects=9 is out of range: it must be in \[0, 8\]"):
        make("kuka", "step", "nl_reach", "task.drawn_objects=9")

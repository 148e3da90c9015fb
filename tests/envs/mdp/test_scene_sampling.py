"""Scenes that are drawn but never simulated show what episodes show as they begin."""

import numpy as np
import pytest

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

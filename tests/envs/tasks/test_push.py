"""Observations of objects that are pushed: how they slide, and whether they lie at a target."""

import numpy as np
import pytest

from envs.experts import expert
from tests.helpers.env_cases import act, make


@pytest.fixture(scope="module")
def pushed():
    """(T + 1, 4, K, ...) rows, places and targets of four worlds, pushed by the expert; and whether any began anew."""
    env = make("kuka", "step", "nl_push", worlds=4, seed=2)
    guide, td, seen = expert(env), env.reset(), []
    for _ in range(env.config.task.max_steps):
        state = env.state
        seen.append((td["objects"].numpy(), state.objects.copy(), state.goals.copy(), state.movable.copy()))
        td = act(env, td, guide(td)["action"])
        if td["done"].any():
            break
    radius = env.config.task.radius
    env.close()
    return *(np.stack(each) for each in zip(*seen, strict=True)), radius


def test_rows_of_objects_hold_their_motion_in_the_last_step(pushed):
    rows, places, _, movable, _ = pushed
    slid = np.diff(places, axis=0)[..., :2]
    assert np.abs(slid).max() > 0.005
    seen = rows[1:][movable[1:]][:, -3:-1]
    np.testing.assert_allclose(seen, np.clip(slid[movable[1:]], -0.03, 0.03), atol=1e-6)
    assert not rows[0, ..., -3:-1].any()


def test_rows_of_objects_hold_whether_they_lie_at_a_target(pushed):
    rows, places, targets, movable, radius = pushed
    apart = np.linalg.norm(places[:, :, :, None] - places[:, :, None], axis=-1)
    nearest = np.where(targets[:, :, None], apart, np.inf).min(-1)[movable]
    seen = rows[movable][:, -1]
    assert (seen[nearest < radius - 0.005] == 1).all()
    assert (seen[nearest > radius + 0.005] == 0).all()
    assert seen.min() == 0 < seen.max()

"""Commands of a session on a table: places, stacks, and what the gripper holds."""

import numpy as np
import pytest

from tests.helpers.sessions import run_to_end, session_fixture

session = session_fixture(seed=1, task="nl_pick_and_place", driver="expert", objects=2)


@pytest.fixture
def placing(session):
    session.shuffle()
    return session


def real_and_targets(session):
    targets = session.scene().targets
    return np.flatnonzero(~targets).tolist(), np.flatnonzero(targets).tolist()


@pytest.mark.slow
def test_a_place_without_an_object_is_marked_by_a_see_through_one(placing):
    (first, *_), targets = real_and_targets(placing)
    _, x1, y0, _ = placing.env.config.workspace.object_area
    result = placing.say(f"put {placing.object_names()[first]} in the back right corner please")
    assert result.steps[-1].place == pytest.approx((x1, y0))
    assert min(np.linalg.norm(placing.scene().positions[targets][:, :2] - (x1, y0), axis=1)) < 1e-3
    assert run_to_end(placing).startswith("Done")
    assert np.linalg.norm(placing.scene().positions[first][:2] - (x1, y0)) < placing.env.config.task.radius


def test_undo_brings_an_object_back(placing):
    (first, *_), _ = real_and_targets(placing)
    before = placing.scene().positions[first]
    placing.say(f"put {placing.object_names()[first]} in the back left corner")
    run_to_end(placing)
    assert np.linalg.norm(placing.scene().positions[first] - before) > 0.05
    assert len(placing.say("undo that").steps) == 2  # take and place: nothing else has moved
    assert run_to_end(placing).startswith("Done")
    assert np.linalg.norm(placing.scene().positions[first] - before) < placing.env.config.task.radius


def test_a_place_on_another_object_is_reached_though_the_task_does_not_stack(placing):
    (first, second, *_), _ = real_and_targets(placing)
    names, below = placing.object_names(), placing.scene().positions[second]
    placing.say(f"stick {names[first]} onto {names[second]} pls")
    assert run_to_end(placing).startswith("Done")
    size = placing.env.config.task.object_size
    assert np.linalg.norm(placing.scene().positions[first] - below - [0, 0, size]) < 0.01
    assert np.linalg.norm(placing.scene().positions[second] - below) < 0.01


def test_an_object_is_held_until_a_later_sentence_says_where_it_goes(placing):
    x0, _, y0, _ = placing.env.config.workspace.object_area
    while np.linalg.norm(placing.scene().positions[:, :2] - (x0, y0), axis=1).min() < 0.1:
        placing.shuffle()  # the corner is taken
    (first, *_), _ = real_and_targets(placing)
    placing.say(f"pls pick up {placing.object_names()[first]}")
    assert run_to_end(placing).startswith("Done")
    assert placing.scene().positions[first, 2] > 0.1
    placing.say("drop it in the front right corner")
    assert run_to_end(placing).startswith("Done")
    assert np.linalg.norm(placing.scene().positions[first, :2] - (x0, y0)) < placing.env.config.task.radius

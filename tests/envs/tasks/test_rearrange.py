"""Rearrange: what is drawn on the board, what is observed, and where it is refused."""

import numpy as np
import pytest

from conf.schema import ConfigError
from envs.tasks.grid import above
from language import parse
from tests.helpers.env_cases import make, task_of

SIZE, CELL = 0.025, 0.0375


@pytest.mark.parametrize("name", ["rearrange", "nl_rearrange"])
def test_the_referent_is_on_top_of_its_stack_and_the_target_in_another_one(name):
    task, rng = task_of(name, "task.curriculum={near: 0, held: 0, placed: 0}"), np.random.default_rng(0)
    for _ in range(40):
        episode = task.draw(rng)
        places, targets = episode.scene.positions, episode.scene.targets
        over = above(places, SIZE)
        assert targets.sum() == 1
        assert targets[episode.target]
        assert not over[episode.referent].any()
        assert not over[episode.target].any()
        assert np.abs(places[episode.referent] - places[episode.target])[:2].max() > CELL / 2
        assert 1 <= (~targets).sum() <= 16


def test_sentences_name_the_referent_and_the_see_through_place():
    task, rng = task_of("nl_rearrange"), np.random.default_rng(1)
    for _ in range(15):
        episode = task.draw(rng)
        step = parse(episode.sentence, episode.scene).steps[-1]
        assert (step.init, step.goal) == (episode.referent, episode.target)
        assert not episode.shapes.any()  # words name cubes only


def test_without_words_some_objects_on_top_are_pyramids_and_nothing_stands_on_them():
    task, rng, seen = task_of("rearrange"), np.random.default_rng(2), 0
    for _ in range(40):
        episode = task.draw(rng)
        pyramids = episode.shapes == task.shapes.index("pyramid")
        assert not above(episode.scene.positions, SIZE)[pyramids].any()
        assert not pyramids[episode.target]
        seen += int(pyramids.sum())
    assert seen > 10


def test_a_column_of_the_objects_marks_the_referent():
    env = make("kuka", "step", "rearrange", worlds=3, seed=5)
    rows = env.reset()["objects"].numpy()
    np.testing.assert_array_equal(rows[..., -1].argmax(1), env.state.referent)
    np.testing.assert_array_equal(rows[..., -1].sum(1), 1.0)
    env.close()


def test_stacks_stay_where_they_are_while_nothing_touches_them():
    env = make("kuka", "step", "rearrange", "task.num_objects=60", "task.min_objects=60", seed=6)
    td = env.reset()
    before = env.state.objects.copy()
    for _ in range(20):
        td = env.step(td.clone(recurse=False).set("action", td["hold"]))["next"]
    np.testing.assert_array_equal(env.state.objects, before)
    env.close()


@pytest.mark.parametrize("share", ["near", "held", "placed"])
def test_episodes_of_the_curriculum_begin_without_touching_other_stacks(share):
    shares = {"near": 0, "held": 0, "placed": 0} | {share: 1}
    curriculum = "task.curriculum={" + ", ".join(f"{name}: {value}" for name, value in shares.items()) + "}"
    env = make("kuka", "step", "rearrange", curriculum, "task.min_objects=16", worlds=6, seed=7)
    td = env.reset()
    rows = np.arange(6)
    assert ((env.state.held == env.state.referent) == (share == "held")).all()
    before = env.state.objects.copy()
    for _ in range(5):
        action = td["hold"].clone()
        action[:, -1] = 1.0 if share == "held" else -1.0
        td = env.step(td.clone(recurse=False).set("action", action))["next"]
    moved = np.linalg.norm(env.state.objects - before, axis=2)
    moved[rows, env.state.referent] = 0.0
    assert moved[env.state.shown].max() < 0.002
    assert not td["wrong_object"].any()
    env.close()


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["workspace=table"], "needs a board, which workspace=table lacks: choose board"),
        (["task.spacing=0.05"], "task.spacing=0.05 does not fit the board of workspace=board: it must be 0.0375"),
        (["task.levels=9"], "task.levels=9 does not fit the board"),
        (["task.num_objects=129"], r"task.num_objects=129 is out of range"),
        (["robot=so_arm"], r"robot=so_arm tilts its gripper \(position_first\), and a rod must point down"),
    ],
)
def test_what_does_not_fit_a_board_is_refused_in_one_message(overrides, message):
    with pytest.raises(ConfigError, match=message):
        task_of("rearrange", *overrides)

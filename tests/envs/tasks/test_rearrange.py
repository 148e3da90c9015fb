"""Rearrange: drawn boards, observations, and refused configs."""

import numpy as np
import pytest

from core.errors import ConfigError
from envs.mdp.object_rows import COLUMNS
from envs.tasks.board import CLEARANCE, above
from envs.tasks.shared.types import NOTHING, State
from language import parse
from language.tokenizer import count_words
from tests.helpers.env_cases import make, task_of

SIZE, CELL = 0.025, 0.0375
MARK, HEIGHT = COLUMNS.start, COLUMNS.start + 2  # columns of an object's row


@pytest.mark.parametrize("name", ["rearrange", "nl_rearrange"])
def test_the_referent_is_on_top_of_its_stack_and_the_target_in_another_one(name):
    task, rng = task_of(name, "task.curriculum={near: 0, held: 0, placed: 0}"), np.random.default_rng(0)
    for _ in range(40):
        episode = task.draw(rng)
        places, targets = episode.scene.positions, episode.scene.targets
        over = above(places, SIZE)
        assert targets.sum() == 1
        assert targets[episode.target]
        if is_straight_over_the_referent(episode):
            assert name == "rearrange"
            continue
        assert not over[episode.referent].any()
        assert not over[episode.target].any()
        assert np.abs(places[episode.referent] - places[episode.target])[:2].max() > CELL / 2
        assert 1 <= (~targets).sum() <= 16


def is_straight_over_the_referent(episode):
    offset = episode.scene.positions[episode.target] - episode.scene.positions[episode.referent]
    return np.abs(offset[:2]).max() < SIZE / 2 and offset[2] > SIZE / 2


def test_some_objects_are_only_to_be_taken_up_where_no_words_name_them():
    task, rng = task_of("rearrange", "task.curriculum={near: 0, held: 0, placed: 0}"), np.random.default_rng(3)
    share = np.mean([is_straight_over_the_referent(task.draw(rng)) for _ in range(200)])
    assert 0.04 < share < 0.2


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
        standing = np.ones(len(pyramids), bool)
        standing[episode.target] = not is_straight_over_the_referent(episode)
        assert not above(episode.scene.positions, SIZE)[pyramids][:, standing].any()
        assert not pyramids[episode.target]
        seen += int(pyramids.sum())
    assert seen > 10


def test_a_column_of_the_objects_marks_the_referent():
    env = make("kuka", "step", "rearrange", worlds=3, seed=5)
    for marks in (env.reset()["objects"][..., MARK].numpy(), drawn_marks(env)):
        np.testing.assert_array_equal(marks.sum(1), 1.0)
    np.testing.assert_array_equal(env.reset()["objects"][..., MARK].argmax(1), env.state.referent)
    env.close()


def drawn_marks(env):
    scenes = env.draw_scenes(5, 0)
    marks = scenes["objects"][..., MARK].numpy()
    np.testing.assert_array_equal(marks.argmax(1), scenes["privileged", "referent"])
    return marks


def test_no_column_tells_which_object_is_meant_where_words_do():
    env = make("kuka", "step", "nl_rearrange", worlds=3, seed=5)
    for rows in (env.reset()["objects"], env.draw_scenes(3, 0)["objects"]):
        assert not rows[..., MARK].any()
    env.close()


def stacked(held=NOTHING, gripper=(0.3, 0.0, 0.2)):
    """A tower of three (slots 0 to 2) on the way to a single object (3), and a place (4) in the air over that one."""
    places = [(0.4, 0.0, (level + 0.5) * SIZE) for level in range(3)] + [(0.5, 0.0, SIZE / 2), (0.5, 0.0, 4.5 * SIZE)]
    free = np.array([[True, True, True, True, False]])
    return State(
        gripper=np.array([gripper], float),
        objects=np.array([places]),
        shown=np.ones((1, 5), bool),
        referent=np.array([3]),
        target=np.array([4]),
        movable=free,
        goals=~free,
        quaternions=np.zeros((1, 5, 4)),
        held=np.array([held]),
    )


def test_columns_tell_how_high_the_gripper_is_over_what_stands_on_the_way_to_each_object():
    task = task_of("rearrange", "task.num_objects=4", "task.min_objects=4")
    rows = task.seen(stacked())[0]
    np.testing.assert_allclose(rows[:, HEIGHT - MARK], [0.125, 0.125, 0.15, 0.125, 0.125])  # itself is not on the way
    np.testing.assert_allclose(rows[:, HEIGHT - MARK] - rows[:, HEIGHT - MARK + 1], CLEARANCE + SIZE / 2)
    np.testing.assert_allclose(task.seen(stacked(held=2))[0, 4, HEIGHT - MARK], 0.15)  # nor is what is held
    beside = task.seen(stacked(gripper=(0.3, 0.3, 0.2)))[0]
    np.testing.assert_allclose(beside[3:, HEIGHT - MARK], [0.2, 0.175])


def test_columns_tell_what_is_in_the_air_and_where_the_gripper_would_hold_each_object():
    task = task_of("rearrange", "task.num_objects=4", "task.min_objects=4")
    np.testing.assert_array_equal(task.seen(stacked())[0, :, 1], [0, 0, 0, 0, 1])
    np.testing.assert_array_equal(task.seen(stacked(held=1))[0, :, 1], [0, 0, 1, 0, 1])
    offset = task.seen(stacked(gripper=(0.5, 0.0, SIZE)))[0, 3, -3:]
    np.testing.assert_allclose(offset, 0.0, atol=1e-12)


def test_what_is_brought_to_a_place_in_the_air_is_held_there_and_not_released():
    for held, over in ((3, True), (NOTHING, False)):
        task = task_of("rearrange", "task.num_objects=4", "task.min_objects=4", "task.hold_steps=3")
        task.reset(np.array([0]), stacked())
        assert task.in_the_air[0]
        raised = stacked(held=3)
        raised.objects[0, 3, 2] = 4.5 * SIZE
        task.step(raised)
        raised.held[0] = held
        assert [bool(task.step(raised).success[0]) for _ in range(4)][-1] == over


def test_some_targets_are_in_the_air_and_nothing_begins_released_there():
    share = "task.curriculum={near: 0, held: 0, placed: 1}"
    task, rng, seen = task_of("rearrange", share), np.random.default_rng(4), 0
    for _ in range(60):
        episode = task.draw(rng)
        solid = ~episode.scene.targets & (np.arange(len(episode.scene)) != episode.referent)
        places, target = episode.scene.positions, episode.scene.positions[episode.target]
        below = np.abs(places[solid] - target + [0, 0, SIZE]).max(1) < SIZE / 2
        in_the_air = target[2] > SIZE and not below.any()
        assert (episode.start is None) == in_the_air
        seen += in_the_air
    assert 0 < seen < 30


@pytest.mark.slow
def test_stacks_stay_where_they_are_while_nothing_touches_them():
    start = "task.curriculum={near: 0, held: 0, placed: 0}"
    env = make("kuka", "step", "rearrange", "task.num_objects=60", "task.min_objects=60", start, seed=6)
    td = env.reset()
    before = env.state.objects.copy()
    for _ in range(20):
        td = env.step(td.clone(recurse=False).set("action", td["hold"]))["next"]
    np.testing.assert_array_equal(env.state.objects, before)
    env.close()


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_phrases_are_drawn_again_until_the_sentence_is_short_enough(monkeypatch):
    task, rng = task_of("nl_rearrange"), np.random.default_rng(0)
    lengths = [count_words(task.draw(rng).sentence) for _ in range(20)]
    most = int(np.median(lengths))
    assert max(lengths) > most
    monkeypatch.setattr("envs.tasks.shared.sentences.MAX_WORDS", most)
    assert max(count_words(task.draw(rng).sentence) for _ in range(20)) <= most
    monkeypatch.setattr("envs.tasks.shared.sentences.MAX_WORDS", 3)
    with pytest.raises(ConfigError, match="only sentences of more than 3 words"):
        task.draw(rng)

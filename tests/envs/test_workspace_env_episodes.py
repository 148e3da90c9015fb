"""Drawn episodes and their sentences, and what the environment observes of them."""

from collections import Counter

import numpy as np
import pytest
import torch

from core.overrides import compose
from language import COLORS, NOUNS, SHAPES, Object, Scene, color_name, ground, parse
from tests.helpers.env_cases import TOUCHING, act, make, task_of

DRAWS = 3000

BLIND = {  # slots that a policy could choose without reading; each must do no better than chance
    "first": lambda scene: 0,
    "last": lambda scene: len(scene) - 1,
    "leftmost": lambda scene: scene.positions[:, 1].argmax(),
    "rightmost": lambda scene: scene.positions[:, 1].argmin(),
    "middle": lambda scene: np.abs(scene.positions[:, 1] - np.median(scene.positions[:, 1])).argmin(),
    "nearest to the robot": lambda scene: scene.positions[:, 0].argmin(),
    "farthest from the robot": lambda scene: scene.positions[:, 0].argmax(),
    "nearest to the middle of the table": lambda scene: np.linalg.norm(
        scene.positions - scene.positions.mean(0), axis=1
    ).argmin(),
    "most alone": lambda scene: _apart(scene.positions).min(1).argmax(),
    "first of the colors": lambda scene: scene.colors.argmin(),
    "last of the colors": lambda scene: scene.colors.argmax(),
    "of a color of its own": lambda scene: _rarity(scene.colors).argmin(),
    "of a color that others have": lambda scene: _rarity(scene.colors).argmax(),
    "first of the shapes": lambda scene: scene.nouns.argmin(),
    "last of the shapes": lambda scene: scene.nouns.argmax(),
    "of a shape of its own": lambda scene: _rarity(scene.nouns).argmin(),
    "of a shape that others have": lambda scene: _rarity(scene.nouns).argmax(),
    "of a look of its own": lambda scene: _rarity(scene.nouns * 10 + scene.colors).argmin(),
}


def _apart(positions):
    apart = np.linalg.norm(positions[:, None] - positions, axis=2)
    np.fill_diagonal(apart, np.inf)
    return apart


def _rarity(values):
    return (values[:, None] == values).sum(1)


@pytest.fixture(scope="module", params=[(3, 3), (5, 2)], ids=["3", "2 to 5"])
def drawn(request):
    slots, least = request.param
    task = task_of("nl_reach", f"task.num_objects={slots}", f"task.min_objects={least}")
    rng = np.random.default_rng(1)
    return task, [task.draw(rng) for _ in range(DRAWS)]


@pytest.mark.slow
@pytest.mark.parametrize("guess", BLIND)
def test_only_the_sentence_identifies_the_referent(drawn, guess):
    _, episodes = drawn
    hits = sum(BLIND[guess](episode.scene) == episode.referent for episode in episodes)
    chances = np.array([1 / len(episode.scene) for episode in episodes])
    sigma = np.sqrt((chances * (1 - chances)).sum())
    assert abs(hits - chances.sum()) < 4 * sigma


@pytest.mark.slow
def test_every_number_of_objects_kind_color_and_shape_occurs(drawn):
    task, episodes = drawn
    config = task.config
    counts = Counter(len(episode.scene) for episode in episodes)
    assert set(counts) == set(range(config.min_objects, config.num_objects + 1))
    assert min(counts.values()) > 0.8 * DRAWS / len(counts)
    kinds = Counter(task.kind_names[episode.kind] for episode in episodes)
    assert set(kinds) == set(config.kinds)
    assert min(kinds.values()) > 0.05 * DRAWS
    looks = Counter((thing.color, thing.noun) for episode in episodes for thing in episode.scene)
    assert len(looks) == len(COLORS) * len(SHAPES)
    assert min(looks.values()) > 0.5 * max(looks.values())


def test_objects_stand_apart_on_the_table_within_their_area(drawn):
    task, episodes = drawn
    x0, x1, y0, y1 = compose()["workspace"]["object_area"]
    for episode in episodes:
        positions = episode.scene.positions
        assert _apart(positions).min() >= task.config.spacing
        assert (positions >= [x0, y0, task.config.object_size / 2]).all()
        assert (positions <= [x1, y1, task.config.object_size / 2]).all()
    everywhere = np.concatenate([episode.scene.positions[:, :2] for episode in episodes])
    np.testing.assert_allclose(everywhere.min(0), [x0, y0], atol=0.01)
    np.testing.assert_allclose(everywhere.max(0), [x1, y1], atol=0.01)


@pytest.mark.slow
def test_the_sentence_names_the_referent_with_the_declared_kind(drawn):
    task, episodes = drawn
    for episode in episodes:
        instruction = parse(episode.sentence)
        assert ground(instruction, episode.scene) == episode.referent
        assert task.kind_names[episode.kind] == instruction.phrase.kind


def test_the_same_generator_draws_the_same_episodes():
    task = task_of("nl_reach")
    one, other = ([task.draw(np.random.default_rng(3)).sentence for _ in range(5)] for _ in range(2))
    assert one == other


@pytest.mark.slow
@pytest.mark.parametrize("kind", compose(["task=nl_reach"])["task"]["kinds"])
def test_a_task_of_one_kind_draws_sentences_of_that_kind_only(kind):
    task, rng = task_of("nl_reach", f"task.kinds=[{kind}]"), np.random.default_rng(0)
    assert {parse(task.draw(rng).sentence).phrase.kind for _ in range(50)} == {kind}


@pytest.fixture(scope="module")
def shown():
    """Many first observations of an environment with more slots than objects."""
    env = make("kuka", "step", "nl_reach", "task.num_objects=5", "task.min_objects=2", worlds=8, seed=4)
    seen = torch.cat([env.reset() for _ in range(150)])
    yield env, seen
    env.close()


def chi_square(counts):
    counts = np.asarray(counts, float)
    return ((counts - counts.mean()) ** 2 / counts.mean()).sum()


@pytest.mark.slow
def test_referents_and_objects_are_spread_evenly_over_the_slots(shown):
    _, seen = shown
    limit = 23.5  # chi-square with 4 degrees of freedom: one in 10 000
    assert chi_square(np.bincount(seen["privileged", "referent"].numpy(), minlength=5)) < limit
    for objects in range(2, 6):
        some = seen[seen["objects_mask"].sum(1) == objects]
        assert len(some) > 200
        assert chi_square(np.bincount(some["privileged", "referent"].numpy(), minlength=5)) < limit
        if objects < 5:  # counts of a draw without repetition scatter less than chi-square allows
            assert chi_square(some["objects_mask"].sum(0).numpy()) < limit


def test_slots_without_an_object_are_masked_and_zero(shown):
    _, seen = shown
    mask = seen["objects_mask"]
    assert set(mask.sum(1).tolist()) == {2, 3, 4, 5}
    assert (seen["objects"][~mask] == 0).all()
    assert (seen["objects"][mask][:, 7:14].abs().sum(1) > 0).all()
    assert mask.gather(1, seen["privileged", "referent"][:, None]).all()


def scene_of(rows):
    """The scene that the rows of the objects observation show."""
    return Scene(
        Object(
            noun=list(NOUNS)[int(row[11:14].argmax())],
            color=color_name(row[7:11].tolist()),
            position=tuple(row[:3].double().tolist()),
            size=float(row[14]),
        )
        for row in rows
    )


@pytest.mark.slow
def test_the_sentence_grounds_to_the_referents_slot_in_the_observation(shown):
    env, seen = shown
    for each in seen:
        slots = torch.nonzero(each["objects_mask"])[:, 0]
        sentence = bytes(each["privileged", "sentence"].tolist()).rstrip(b"\0").decode()
        assert env.tokenizer.decode(each["instruction"].tolist()) == sentence
        scene = scene_of(each["objects"][slots])
        assert slots[ground(parse(sentence), scene)] == each["privileged", "referent"]
        assert env.kind_names[each["privileged", "kind"]] == parse(sentence).phrase.kind


def test_the_goal_is_the_position_of_the_referent(shown):
    _, seen = shown
    rows = seen["objects"][range(len(seen)), seen["privileged", "referent"]]
    assert torch.equal(rows[:, :3], seen["privileged", "goal"])


def test_reach_shows_one_object_without_a_sentence():
    env = make("kuka", "step", "reach")
    td = env.reset()
    assert td["objects_mask"].tolist() == [[True]]
    assert td["instruction"].abs().sum() == 0
    assert env.sentence() == ""
    env.close()


@pytest.mark.slow
def test_the_goal_follows_an_object_that_is_pushed():
    env = make("kuka", "step", "reach", TOUCHING, "task.hold_steps=60", seed=3)
    td = env.reset()
    start = td["privileged", "goal"].clone()
    beside = start.double().numpy() + np.array([-0.09, 0.0, 0.0])
    for t in range(45):
        aim = beside + np.array([0.0, 0.0, 0.1]) if t < 15 else beside if t < 25 else beside + np.array([0.2, 0.0, 0.0])
        td = act(env, td, env.towards(aim))
    assert (td["privileged", "goal"] - start)[0, 0] > 0.03
    assert torch.equal(td["privileged", "goal"], td["objects"][:, 0, :3])
    env.close()

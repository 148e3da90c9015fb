"""What the tasks judge, draw and say."""

import itertools
from collections import Counter

import numpy as np
import pytest
import torch
from env_cases import act, make

from conf.overrides import compose
from conf.schema import ConfigError, read
from envs.tasks import TASKS, State, TaskConfig
from language import NOUNS, Object, Scene, color_name, ground, parse

TARGET, OTHER = np.array([0.4, 0.2, 0.025]), np.array([0.4, -0.2, 0.025])


def task_of(name, *overrides, worlds=1):
    config = compose([f"task={name}", *overrides])
    task = read(TaskConfig, config["task"], "task")
    return TASKS[name](task, config["workspace"]["object_area"], worlds)


def state(gripper, objects=(TARGET, OTHER), shown=None, referent=0):
    shown = [True] * len(objects) if shown is None else shown
    return State(np.array([gripper]), np.array([objects]), np.array([shown]), np.array([referent]))


def judged(task, places, **more):
    """Outcomes of an episode in which the gripper is at these places, one a step."""
    task.reset(np.array([0]), state(np.array([0.4, 0.0, 0.3]), **more))
    return [task.step(state(place, **more)) for place in places]


def flags(outcomes, name):
    return [bool(getattr(outcome, name)[0]) for outcome in outcomes]


AWAY = np.array([0.4, 0.0, 0.3])


@pytest.mark.parametrize("name", TASKS)
def test_success_needs_hold_steps_running_at_the_referent(name):
    task = task_of(name, "task.hold_steps=4")
    outcomes = judged(task, [TARGET] * 5)
    assert flags(outcomes, "success") == [False, False, False, True, True]
    assert flags(outcomes, "at_goal") == [True] * 5
    assert flags(outcomes, "wrong_object") == [False] * 5


@pytest.mark.parametrize("name", TASKS)
def test_as_long_at_another_object_is_the_wrong_object(name):
    outcomes = judged(task_of(name, "task.hold_steps=4"), [OTHER] * 4)
    assert flags(outcomes, "wrong_object") == [False, False, False, True]
    assert not any(flags(outcomes, "success") + flags(outcomes, "at_goal"))


@pytest.mark.parametrize(
    ("place", "elsewhere", "flag"),
    [
        (TARGET, AWAY, "success"),
        (TARGET, OTHER, "success"),
        (OTHER, AWAY, "wrong_object"),
        (OTHER, TARGET, "wrong_object"),
    ],
)
def test_leaving_in_between_starts_the_count_anew(place, elsewhere, flag):
    outcomes = judged(task_of("nl_reach", "task.hold_steps=4"), [place] * 3 + [elsewhere] + [place] * 4)
    assert flags(outcomes, flag) == [False] * 7 + [True]


def test_a_new_episode_starts_the_count_anew_in_its_own_world_alone():
    task = task_of("nl_reach", "task.hold_steps=4", worlds=2)
    both = state(TARGET)
    both = State(*(np.concatenate((a, a)) for a in (both.gripper, both.objects, both.shown, both.referent)))
    task.reset(np.array([0, 1]), both)
    for _ in range(3):
        task.step(both)
    task.reset(np.array([1]), both)
    assert task.step(both).success.tolist() == [True, False]


@pytest.mark.parametrize("distance", [0.049, 0.051])
@pytest.mark.parametrize("direction", list(itertools.product([-1, 0, 1], repeat=3))[:13])
def test_near_is_within_the_radius_in_every_direction(distance, direction):
    place = TARGET + distance * np.array(direction) / np.linalg.norm(direction)
    (outcome,) = judged(task_of("nl_reach", "task.radius=0.05"), [place])
    assert bool(outcome.at_goal[0]) == (distance < 0.05)


def test_between_two_objects_that_were_pushed_together_the_nearer_one_counts():
    pushed = (TARGET, TARGET + [0.0, 0.05, 0.0])
    task = task_of("nl_reach", "task.hold_steps=2")
    nearer_other = TARGET + [0.0, 0.03, 0.0]
    outcomes = judged(task, [nearer_other] * 2, objects=pushed)
    assert flags(outcomes, "wrong_object") == [False, True]
    assert not any(flags(outcomes, "at_goal"))


def test_slots_that_show_nothing_are_never_reached():
    task = task_of("nl_reach", "task.hold_steps=1")
    (outcome,) = judged(task, [OTHER], shown=[True, False])
    assert not outcome.wrong_object[0]
    assert not outcome.at_goal[0]


@pytest.mark.parametrize("name", TASKS)
def test_the_terms_of_the_reward(name):
    task = task_of(name, "task.hold_steps=2")
    places = [np.array([0.4, 0.0, 0.2]), np.array([0.4, 0.1, 0.1]), TARGET, TARGET]
    outcomes = judged(task, places)
    distances = [np.linalg.norm(place - TARGET) for place in (AWAY, *places)]
    progress = [float(outcome.terms["progress"][0]) for outcome in outcomes]
    np.testing.assert_allclose(progress, -np.diff(distances), atol=1e-12)
    assert [float(outcome.terms["time"][0]) for outcome in outcomes] == [1.0] * 4
    assert [float(outcome.terms["success"][0]) for outcome in outcomes] == [0, 0, 0, 1]
    wrong = judged(task, [OTHER, OTHER])
    assert [float(outcome.terms["wrong_object"][0]) for outcome in wrong] == [0, 1]
    assert set(outcomes[0].terms) == set(task.terms)


def test_the_reward_is_the_terms_times_their_weights_and_zero_where_none_is_given():
    env = make("kuka", "step", "reach", "~task.reward.progress", "task.reward.time=-0.25")
    td = act(env, env.reset(), [[1.0, 0.0, -1.0]])
    assert td["reward"].item() == -0.25
    assert dict(zip(env.reward_names, td["reward_terms"][0].tolist(), strict=True))["time"] == -0.25
    env.close()
    env = make("kuka", "step", "reach", "task.reward.progress=100", "~task.reward.time")
    td = env.reset()
    before = np.linalg.norm(env.gripper - td["objects"][0, :, :3].numpy(), axis=1)
    td = act(env, td, [[0.0, 0.0, -1.0]])
    after = np.linalg.norm(env.gripper - td["objects"][0, :, :3].numpy(), axis=1)
    assert td["reward"].item() == pytest.approx(100 * (before - after).item(), abs=1e-3)
    env.close()


@pytest.mark.parametrize("name", TASKS)
def test_an_unknown_reward_term_is_refused(name):
    with pytest.raises(ConfigError, match=r"task\.reward\.progres is not a known term; did you mean 'progress'"):
        task_of(name, "+task.reward.progres=1")


def goto(env, td, place, steps):
    """The gripper over place (N, 3), then down on it, until done."""
    for _ in range(steps):
        beside = np.linalg.norm((place - env.gripper)[:, :2], axis=1)
        td = act(env, td, env.towards(place + np.outer(np.where(beside < 0.02, 0.03, 0.1), [0, 0, 1])))
        if td["done"].any():
            break
    return td


@pytest.mark.parametrize(("right", "flag"), [(True, "success"), (False, "wrong_object")])
def test_holding_at_an_object_ends_the_episode(right, flag):
    env = make("kuka", "step", "nl_reach", seed=2)
    td = env.reset()
    referent = td["privileged", "referent"].item()
    slot = referent if right else (referent + 1) % 3
    td = goto(env, td, td["objects"][:, slot, :3].double().numpy(), 60)
    assert td[flag].item()
    assert td["terminated"].item()
    assert not td["truncated"].item()
    assert td["at_goal"].item() == right
    terms = dict(zip(env.reward_names, td["reward_terms"][0].tolist(), strict=True))
    assert terms[flag] == env.config.task.reward[flag]
    assert terms["success" if not right else "wrong_object"] == 0
    env.close()


# ---- what is drawn -----------------------------------------------------------------------------------------------

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


@pytest.mark.parametrize("guess", BLIND)
def test_nothing_but_the_words_tells_which_object_is_meant(drawn, guess):
    _, episodes = drawn
    hits = sum(BLIND[guess](episode.scene) == episode.referent for episode in episodes)
    chances = np.array([1 / len(episode.scene) for episode in episodes])
    sigma = np.sqrt((chances * (1 - chances)).sum())
    assert abs(hits - chances.sum()) < 4 * sigma


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
    assert len(looks) == 7 * len(NOUNS)
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


def test_the_sentence_names_the_referent_and_its_kind_is_told_rightly(drawn):
    task, episodes = drawn
    for episode in episodes:
        instruction = parse(episode.sentence)
        assert ground(instruction, episode.scene) == episode.referent
        assert task.kind_names[episode.kind] == instruction.phrase.kind


def test_the_same_generator_draws_the_same_episodes():
    task = task_of("nl_reach")
    one, other = ([task.draw(np.random.default_rng(3)).sentence for _ in range(5)] for _ in range(2))
    assert one == other


@pytest.mark.parametrize("kind", compose(["task=nl_reach"])["task"]["kinds"])
def test_a_task_of_one_kind_says_that_kind_alone(kind):
    task, rng = task_of("nl_reach", f"task.kinds=[{kind}]"), np.random.default_rng(0)
    assert {parse(task.draw(rng).sentence).phrase.kind for _ in range(50)} == {kind}


# ---- what the environment shows of it ----------------------------------------------------------------------------


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


def test_slots_that_show_no_object_are_masked_and_empty(shown):
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


def test_the_words_ground_to_the_referents_slot_in_what_is_observed(shown):
    env, seen = shown
    for each in seen:
        slots = torch.nonzero(each["objects_mask"])[:, 0]
        sentence = bytes(each["privileged", "sentence"].tolist()).rstrip(b"\0").decode()
        assert env.tokenizer.decode(each["instruction"].tolist()) == sentence
        scene = scene_of(each["objects"][slots])
        assert slots[ground(parse(sentence), scene)] == each["privileged", "referent"]
        assert env.kind_names[each["privileged", "kind"]] == parse(sentence).phrase.kind


def test_the_goal_is_where_the_referent_stands(shown):
    _, seen = shown
    rows = seen["objects"][range(len(seen)), seen["privileged", "referent"]]
    assert torch.equal(rows[:, :3], seen["privileged", "goal"])


def test_reach_shows_one_object_and_says_nothing():
    env = make("kuka", "step", "reach")
    td = env.reset()
    assert td["objects_mask"].tolist() == [[True]]
    assert td["instruction"].abs().sum() == 0
    assert env.sentence() == ""
    env.close()


def test_the_goal_follows_an_object_that_is_pushed():
    env = make("kuka", "step", "reach", "task.hold_steps=60", seed=3)
    td = env.reset()
    start = td["privileged", "goal"].clone()
    beside = start.double().numpy() + [-0.09, 0.0, 0.0]
    for t in range(45):
        aim = beside + [0.0, 0.0, 0.1] if t < 15 else beside if t < 25 else beside + [0.2, 0.0, 0.0]
        td = act(env, td, env.towards(aim))
    assert (td["privileged", "goal"] - start)[0, 0] > 0.03
    assert torch.equal(td["privileged", "goal"], td["objects"][:, 0, :3])
    env.close()

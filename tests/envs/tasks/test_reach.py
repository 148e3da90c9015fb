"""Outcomes of reaching tasks: success, the wrong object, rewards."""

import itertools

import numpy as np
import pytest

from core.errors import ConfigError
from envs.tasks import TASKS, State
from envs.tasks.reach import Reach
from tests.helpers.env_cases import act, make, task_of

REACHING = [name for name, kind in TASKS.items() if issubclass(kind, Reach)]
TARGET, OTHER = np.array([0.4, 0.2, 0.025]), np.array([0.4, -0.2, 0.025])


def state(gripper, objects=(TARGET, OTHER), shown=None, referent=0):
    shown = [True] * len(objects) if shown is None else shown
    return State(
        gripper=np.array([gripper]),
        objects=np.array([objects]),
        shown=np.array([shown]),
        referent=np.array([referent]),
    )


def judged(task, places, **more):
    """Outcomes of an episode in which the gripper is at these places, one a step."""
    task.reset(np.array([0]), state(np.array([0.4, 0.0, 0.3]), **more))
    return [task.step(state(place, **more)) for place in places]


def flags(outcomes, name):
    return [bool(getattr(outcome, name)[0]) for outcome in outcomes]


AWAY = np.array([0.4, 0.0, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize("name", REACHING)
def test_success_needs_hold_steps_running_at_the_referent(name):
    task = task_of(name, "task.hold_steps=4")
    outcomes = judged(task, [TARGET] * 5)
    assert flags(outcomes, "success") == [False, False, False, True, True]
    assert flags(outcomes, "at_goal") == [True] * 5
    assert flags(outcomes, "wrong_object") == [False] * 5


@pytest.mark.slow
@pytest.mark.parametrize("name", REACHING)
def test_hold_steps_at_another_object_are_the_wrong_object(name):
    outcomes = judged(task_of(name, "task.hold_steps=4"), [OTHER] * 4)
    assert flags(outcomes, "wrong_object") == [False, False, False, True]
    assert not any(flags(outcomes, "success") + flags(outcomes, "at_goal"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "elsewhere", "flag"),
    [
        (TARGET, AWAY, "success"),
        (TARGET, OTHER, "success"),
        (OTHER, AWAY, "wrong_object"),
        (OTHER, TARGET, "wrong_object"),
    ],
)
def test_leaving_the_referent_restarts_the_count(place, elsewhere, flag):
    outcomes = judged(task_of("nl_reach", "task.hold_steps=4"), [place] * 3 + [elsewhere] + [place] * 4)
    assert flags(outcomes, flag) == [False] * 7 + [True]


def test_a_reset_restarts_the_count_in_its_own_world_only():
    task = task_of("nl_reach", "task.hold_steps=4", worlds=2)
    both = state(TARGET)
    names = ("gripper", "objects", "shown", "referent")
    both = State(**{name: np.concatenate((getattr(both, name),) * 2) for name in names})
    task.reset(np.array([0, 1]), both)
    for _ in range(3):
        task.step(both)
    task.reset(np.array([1]), both)
    assert task.step(both).success.tolist() == [True, False]


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.049, 0.051])
@pytest.mark.parametrize("direction", list(itertools.product([-1, 0, 1], repeat=3))[:13])
def test_near_is_within_the_radius_in_every_direction(distance, direction):
    place = TARGET + distance * np.array(direction) / np.linalg.norm(direction)
    (outcome,) = judged(task_of("nl_reach", "task.radius=0.05"), [place])
    assert bool(outcome.at_goal[0]) == (distance < 0.05)


def test_of_two_touching_objects_the_nearer_one_counts():
    pushed = (TARGET, TARGET + np.array([0.0, 0.05, 0.0]))
    task = task_of("nl_reach", "task.hold_steps=2")
    nearer_other = TARGET + np.array([0.0, 0.03, 0.0])
    outcomes = judged(task, [nearer_other] * 2, objects=pushed)
    assert flags(outcomes, "wrong_object") == [False, True]
    assert not any(flags(outcomes, "at_goal"))


def test_empty_slots_are_never_reached():
    task = task_of("nl_reach", "task.hold_steps=1")
    (outcome,) = judged(task, [OTHER], shown=[True, False])
    assert not outcome.wrong_object[0]
    assert not outcome.at_goal[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", REACHING)
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


@pytest.mark.slow
def test_the_reward_is_the_terms_times_their_weights():
    env = make("kuka", "step", "reach", "task.reward.progress=0", "task.reward.time=-0.25")
    td = act(env, env.reset(), [[1.0, 0.0, -1.0]])
    assert td["reward"].item() == -0.25
    assert dict(zip(env.reward_names, td["reward_terms"][0].tolist(), strict=True))["time"] == -0.25
    env.close()
    env = make("kuka", "step", "reach", "task.reward.progress=100", "task.reward.time=0")
    td = env.reset()
    before = np.linalg.norm(env.gripper - td["objects"][0, :, :3].numpy(), axis=1)
    td = act(env, td, [[0.0, 0.0, -1.0]])
    after = np.linalg.norm(env.gripper - td["objects"][0, :, :3].numpy(), axis=1)
    assert td["reward"].item() == pytest.approx(100 * (before - after).item(), abs=1e-3)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", REACHING)
def test_an_unknown_reward_term_is_refused(name):
    with pytest.raises(
        ConfigError, match=r"task\.reward\.progres is not a known term of task\.name=\w+; did you mean 'progress'"
    ):
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


@pytest.mark.parametrize(("name", "opening"), [("nl_reach", 1), ("nl_push", 0)])
def test_fingers_are_open_to_reach_and_closed_to_push(name, opening):
    env = make("panda", task=name)
    td = env.reset()
    for _ in range(3):
        td = act(env, td, env.rand_action(td)["action"])
        assert td["robot"][0, 2 * 7 + 9] == pytest.approx(opening, abs=0.05)
    env.close()

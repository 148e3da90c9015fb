"""What the tasks that move objects judge: success, the wrong object, the wrong target, and what spoils them."""

from dataclasses import replace

import numpy as np
import pytest

from envs.tasks import NOTHING, TASKS, State
from envs.tasks.manipulation import Manipulation
from envs.tasks.operate import Operate
from tests.helpers.env_cases import task_of

REST = 0.025  # metres of an object's middle above the table
THING, OTHER = np.array([0.4, 0.2, REST]), np.array([0.4, -0.2, REST])
GOAL, ELSEWHERE = np.array([0.5, 0.0, REST]), np.array([0.5, -0.25, REST])
AWAY, UP = np.array([0.4, 0.0, 0.3]), np.array([0.0, 0.0, 1.0])
MOVING = sorted(
    name for name, kind in TASKS.items() if issubclass(kind, Manipulation) and not issubclass(kind, Operate)
)


def moment(thing=THING, held=NOTHING, gripper=None, other=OTHER, yaw=0.0):
    """The referent (slot 0), another object (1), its target (2) and another target (3)."""
    gripper = (thing if held == 0 else AWAY) if gripper is None else gripper
    quaternions = np.zeros((1, 4, 4))
    quaternions[..., 3] = 1.0
    quaternions[:, 0, 2:] = np.sin(yaw / 2), np.cos(yaw / 2)
    return State(
        gripper=np.array([gripper]),
        objects=np.array([[thing, other, GOAL, ELSEWHERE]]),
        shown=np.ones((1, 4), bool),
        referent=np.array([0]),
        target=np.array([2]),
        movable=np.array([[True, True, False, False]]),
        targets=np.array([[False, False, True, True]]),
        quaternions=quaternions,
        held=np.array([held]),
    )


WITH_TARGETS = ("pick_and_place", "nl_pick_and_place", "push", "nl_push", "swipe", "throw")


def four(name):
    """The task with two objects and, where it has any, two targets; success takes three steps."""
    more = ["task.hold_steps=3", "task.num_objects=2", "task.kinds=[color]"]
    return task_of(name, *more, *["task.num_targets=2"] * (name in WITH_TARGETS))


def fitting(task, state):
    """The state without the targets, where the task has none."""
    slots = task.config.slots
    per_object = ("objects", "shown", "movable", "targets", "quaternions")
    return replace(state, **{name: getattr(state, name)[:, :slots] for name in per_object})


def judged(name, moments):
    """The outcomes of these moments, one a step."""
    task = four(name)
    task.reset(np.array([0]), fitting(task, moment()))
    return [task.step(fitting(task, each)) for each in moments]


def ends(outcomes):
    """What the last of them ended with, or nothing."""
    names = ("success", "wrong_object", "wrong_target", "failed")
    return [name for name in names if getattr(outcomes[-1], name) is not None and getattr(outcomes[-1], name)[0]]


def between(start, end, count):
    return [start + share * (end - start) for share in np.linspace(0, 1, count)]


CARRIED = [moment(place, held=0) for place in (THING, THING + 0.1 * UP, GOAL + 0.1 * UP, GOAL)]
DRAWN = [moment(place, held=0) for place in between(THING, GOAL, 12)]
PUSHED = [moment(place) for place in between(THING, GOAL, 12)]
LEFT = [moment(GOAL)] * 4
FAR = THING + [0.0, -0.18, 0.0]  # that much short of the target in the direction in which it is thrown

# What is done, and how it ends.
DONE = {
    "placed": (["pick_and_place"], CARRIED + LEFT, "success"),
    "placed 4.9 cm beside": (["pick_and_place"], CARRIED + [moment(GOAL + [0, 0.049, 0])] * 4, "success"),
    "placed 5.1 cm beside": (["pick_and_place"], CARRIED + [moment(GOAL + [0, 0.051, 0])] * 4, None),
    "held at the target": (["pick_and_place", "swipe"], DRAWN + [moment(GOAL, held=0)] * 9, None),
    "only pushed there": (["pick_and_place", "swipe"], PUSHED + LEFT, None),
    "pushed there": (["push"], PUSHED + LEFT, "success"),
    "pushed through": (["push"], [moment(place) for place in between(THING, 1.6 * GOAL - 0.6 * THING, 12)], None),
    "pushed out of reach": (["push"], [moment(place) for place in between(THING, 2 * GOAL - THING, 12)], "failed"),
    "pushed over the border": (["push"], [moment([0.4, 0.315, REST])], None),
    "pushed 2 cm beyond it": (["push"], [moment([0.4, 0.321, REST])], "failed"),
    "pushed to the other target": (["push"], [moment(place) for place in between(THING, ELSEWHERE, 12)]
                                   + [moment(ELSEWHERE)] * 4, "wrong_target"),
    "placed at the other target": (["pick_and_place"], [*CARRIED[:2], moment(ELSEWHERE, held=0)]
                                   + [moment(ELSEWHERE)] * 4, "wrong_target"),
    "drawn there": (["swipe"], DRAWN + LEFT, "success"),
    "drawn round": (["swipe"], [moment(THING, held=0), moment((THING + GOAL) / 2 + [0.04, 0.02, 0], held=0)], "failed"),
    "drawn 3 cm beside the line": (["swipe"], [moment(THING, held=0), moment(THING + [0.0134, 0.0, 0.0])], None),
    "lifted on the way": (["swipe"], [moment(THING, held=0), moment(THING + 0.016 * UP, held=0)], "failed"),
    "grasped": (["nl_grasp"], [moment(held=0)] * 3, "success"),
    "grasped for a moment": (["nl_grasp"], [moment(held=0)] * 2 + [moment()] * 2, None),
    "the other one grasped": (["nl_grasp", "nl_lift"], [moment(held=1)] * 3, "wrong_object"),
    "lifted": (["nl_lift"], [moment(THING + 0.16 * UP, held=0)] * 3, "success"),
    "lifted 14 cm": (["nl_lift"], [moment(THING + 0.14 * UP, held=0)] * 5, None),
    "up in the air but not held": (["nl_lift"], [moment(THING + 0.16 * UP)] * 5, None),
    "poked": (["poke"], [moment(THING + [0, 0.03, 0])] * 5, "success"),
    "poked, the gripper still near": (["poke"], [moment(THING + [0, 0.03, 0], gripper=THING)] * 5, None),
    "barely touched": (["poke"], [moment(THING + [0, 0.015, 0])] * 5, None),
    "poked too far": (["poke"], [moment(THING + [0, 0.125, 0])], "failed"),
    "thrown": (["throw"], [moment(GOAL + [0, 0.16, 0.1], held=0), moment(GOAL + [0, 0.06, 0.05])] + LEFT, "success"),
    "thrown too short": (["throw"], [moment(GOAL + [0, 0.16, 0.1], held=0)] + [moment(GOAL + [0, 0.12, 0])] * 5, None),
    "let go of too near": (["throw"], [moment(GOAL + [0, 0.14, 0.1], held=0)] + LEFT, None),
    "let go of too low": (["throw"], [moment(GOAL + [0, 0.16, 0.02], held=0)] + LEFT, None),
    "thrown and taken up again": (["throw"], [moment(GOAL + [0, 0.16, 0.1], held=0), moment(GOAL), moment(GOAL, held=0)]
                                  + LEFT, None),
    "turned": (["pick_and_rotate"], [moment(held=0), moment(THING + 0.1 * UP, held=0, yaw=0.9)]
               + [moment(yaw=0.9)] * 4, "success"),
    "turned the other way": (["pick_and_rotate"], [moment(held=0), moment(THING + 0.1 * UP, held=0, yaw=-0.9)]
                             + [moment(yaw=-0.9)] * 4, "success"),
    "turned by 40 degrees": (["pick_and_rotate"], [moment(THING + 0.1 * UP, held=0)] + [moment(yaw=0.7)] * 5, None),
    "turned on the table": (["pick_and_rotate"], [moment(held=0, yaw=0.9)] + [moment(yaw=0.9)] * 5, None),
    "turned and held": (["pick_and_rotate"], [moment(THING + 0.1 * UP, held=0)] + [moment(held=0, yaw=0.9)] * 5, None),
}  # fmt: skip


@pytest.mark.parametrize("what", DONE)
def test_what_is_done_ends_as_it_should(what):
    names, moments, end = DONE[what]
    for name in names:
        outcomes = judged(name, moments)
        assert ends(outcomes) == ([end] if end else []), name


@pytest.mark.parametrize("name", MOVING)
def test_another_object_moved_by_5_cm_is_the_wrong_object(name):
    for moved, end in ((0.049, []), (0.051, ["wrong_object"])):
        assert ends(judged(name, [moment(other=OTHER + [0, moved, 0])])) == end


@pytest.mark.parametrize("name", MOVING)
def test_doing_nothing_ends_nothing(name):
    assert ends(judged(name, [moment()] * 10)) == []


@pytest.mark.parametrize("name", MOVING)
def test_a_new_episode_forgets_what_was_done(name):
    plain = name.removeprefix("nl_")
    moments = next(
        moments
        for names, moments, end in DONE.values()
        if plain in [each.removeprefix("nl_") for each in names] and end == "success"
    )
    task = four(name)
    first = fitting(task, moment())
    task.reset(np.array([0]), first)
    assert [task.step(fitting(task, each)) for each in moments][-1].success[0]
    task.reset(np.array([0]), first)
    after = task.step(first)
    assert not after.success[0]
    assert not after.at_goal[0]
    assert all(float(after.terms[term][0]) == 0 for term in task.potentials)


@pytest.mark.parametrize("name", MOVING)
def test_going_to_and_fro_pays_nothing(name):
    task, rng = four(name), np.random.default_rng(0)
    loop = [
        moment(THING + 0.01 * rng.uniform(-1, 1, 3) * [1, 1, 0], gripper=AWAY + 0.1 * rng.uniform(-1, 1, 3))
        for _ in range(20)
    ]
    task.reset(np.array([0]), fitting(task, moment()))
    terms = [task.step(fitting(task, each)).terms for each in [*loop, moment()]]
    for term in task.potentials:
        assert sum(float(each[term][0]) for each in terms) == pytest.approx(0, abs=1e-9)

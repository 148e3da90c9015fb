"""Hand-made states of manipulation tasks, and whole episodes with their expected outcomes."""

from dataclasses import replace

import numpy as np

from envs.tasks import NOTHING, TASKS, State
from envs.tasks.devices import OperateDevice
from envs.tasks.hand_over import HandOver
from envs.tasks.shared.manipulation import Manipulation
from envs.tasks.sort import Sort
from tests.helpers.env_cases import task_of

REST = 0.025  # metres of an object's middle above the table
THING, OTHER = np.array([0.4, 0.2, REST]), np.array([0.4, -0.2, REST])
GOAL, ELSEWHERE = np.array([0.5, 0.0, REST]), np.array([0.5, -0.25, REST])
AWAY, UP = np.array([0.4, 0.0, 0.3]), np.array([0.0, 0.0, 1.0])
MOVING = sorted(
    name
    for name, kind in TASKS.items()
    if issubclass(kind, Manipulation)
    and kind.fitting_starts is None
    and not issubclass(kind, OperateDevice | HandOver | Sort)
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
        goals=np.array([[False, False, True, True]]),
        quaternions=quaternions,
        held=np.array([held]),
    )


def based(state, offset, lean=0.0):
    """The state with the object in the target's slot moved by offset (m) and leaning by `lean` degrees about x."""
    objects, quaternions, half = state.objects.copy(), state.quaternions.copy(), np.radians(lean) / 2
    objects[:, 2] += offset
    quaternions[:, 2] = [np.sin(half), 0.0, 0.0, np.cos(half)]
    return replace(state, objects=objects, quaternions=quaternions)


BOARD = ("rearrange", "nl_rearrange")
WITH_TARGETS = ("pick_and_place", "nl_pick_and_place", "push", "nl_push", "swipe", "throw", *BOARD)


def four(name, *overrides):
    """The task with two objects and two goals, where it has any; success takes three steps, within `radius`."""
    real = 4 if TASKS[name].traits.real_goals or name == "nl_unstack" else 2
    more = ["task.hold_steps=3", f"task.num_objects={real}", "task.kinds=[color]", "task.curriculum.radius=0"]
    return task_of(name, *more, *["task.num_targets=2"] * (name in WITH_TARGETS), *overrides)


def state_for(task, state):
    """The state without the targets where the task has none; where its goals are real, with objects for targets."""
    slots = task.config.slots
    if task.traits.real_goals:
        state = replace(state, movable=state.shown, goals=state.shown)
    per_object = ("objects", "shown", "movable", "goals", "quaternions")
    return replace(state, **{name: getattr(state, name)[:, :slots] for name in per_object})


def judged(name, moments, *overrides):
    """The outcomes of these moments, one a step."""
    task = four(name, *overrides)
    task.reset(np.array([0]), state_for(task, moment()))
    return [task.step(state_for(task, each)) for each in moments]


def ends(outcomes):
    """How the last of them ended the episode; nothing if it did not."""
    names = ("success", "wrong_object", "wrong_target", "failed")
    return [name for name in names if getattr(outcomes[-1], name) is not None and getattr(outcomes[-1], name)[0]]


def between(start, end, count):
    return [start + share * (end - start) for share in np.linspace(0, 1, count)]


CARRIED = [moment(place, held=0) for place in (THING, THING + 0.1 * UP, GOAL + 0.1 * UP, GOAL)]
DRAWN = [moment(place, held=0) for place in between(THING, GOAL, 12)]
PUSHED = [moment(place) for place in between(THING, GOAL, 12)]
LEFT = [moment(GOAL)] * 4
TOP, WRONG_TOP = GOAL + 2 * REST * UP, ELSEWHERE + 2 * REST * UP
RAISED = [moment(THING, held=0), moment(THING + 0.1 * UP, held=0), moment(TOP, held=0)]
FAR = THING + [0.0, -0.18, 0.0]  # that much short of the target in the direction in which it is thrown

# What is done, and how it ends.
DONE = {
    "placed": (["pick_and_place"], CARRIED + LEFT, "success"),
    "placed 4.9 cm beside": (["pick_and_place"], CARRIED + [moment(GOAL + [0, 0.049, 0])] * 4, "success"),
    "placed 5.1 cm beside": (["pick_and_place"], CARRIED + [moment(GOAL + [0, 0.051, 0])] * 4, None),
    "moved on the board": (["rearrange", "nl_rearrange"], CARRIED + LEFT, "success"),
    "moved to 1.8 cm beside it": (["rearrange"], CARRIED + [moment(GOAL + [0.018, 0.018, 0])] * 4, "success"),
    "moved to 1.9 cm beside it": (["rearrange"], CARRIED + [moment(GOAL + [0.019, 0, 0])] * 4, None),
    "moved to the level above": (["rearrange"], CARRIED + [moment(GOAL + REST * UP)] * 4, None),
    "held at the target": (["pick_and_place", "swipe", "rearrange"], DRAWN + [moment(GOAL, held=0)] * 9, None),
    "only pushed there": (["pick_and_place", "swipe", "rearrange"], PUSHED + LEFT, None),
    "pushed there": (["push"], PUSHED + LEFT, "success"),
    "pushed through": (["push"], [moment(place) for place in between(THING, 1.6 * GOAL - 0.6 * THING, 12)], None),
    "pushed out of reach": (["push"], [moment(place) for place in between(THING, 2 * GOAL - THING, 12)], "failed"),
    "pushed over the border": (["push"], [moment([0.4, 0.315, REST])], None),
    "pushed 2 cm beyond it": (["push"], [moment([0.4, 0.321, REST])], "failed"),
    "pushed to the other target": (["push"], [moment(place) for place in between(THING, ELSEWHERE, 12)]
                                   + [moment(ELSEWHERE)] * 4, "wrong_target"),
    "placed at the other target": (["pick_and_place"], [*CARRIED[:2], moment(ELSEWHERE, held=0)]
                                   + [moment(ELSEWHERE)] * 4, "wrong_target"),
    "stacked": (["nl_stack"], RAISED + [moment(TOP)] * 4, "success"),
    "unstacked": (["nl_unstack"], RAISED[:2] + [moment(THING + [0, -0.2, 0])] * 4, "success"),
    "unstacked 7 cm beside another": (["nl_unstack"], RAISED[:2] + [moment(GOAL + [0, 0.07, 0])] * 4, "success"),
    "unstacked 6 cm beside another": (["nl_unstack"], RAISED[:2] + [moment(GOAL + [0, 0.06, 0])] * 4, None),
    "put on another one": (["nl_unstack"], RAISED + [moment(TOP)] * 4, None),
    "held over the table": (["nl_unstack"], RAISED[:2] + [moment(THING + [0, -0.2, 0], held=0)] * 9, None),
    "stacked 1.9 cm beside": (["nl_stack"], RAISED + [moment(TOP + [0, 0.019, 0])] * 4, "success"),
    "stacked 2.1 cm beside": (["nl_stack"], RAISED + [moment(TOP + [0, 0.021, 0])] * 4, None),
    "held on top": (["nl_stack"], RAISED + [moment(TOP, held=0)] * 9, None),
    "put down beside the base": (["nl_stack"], RAISED + [moment(GOAL + [0, 0.06, 0])] * 4, None),
    "stacked on the other base": (["nl_stack"], RAISED + [moment(WRONG_TOP)] * 4, "wrong_target"),
    "stacked on a base that was moved by 4.9 cm":
        (["nl_stack"], RAISED + [based(moment(TOP + [0, 0.049, 0]), [0, 0.049, 0])] * 4, "success"),
    "the base moved by 5.1 cm": (["nl_stack"], [based(moment(), [0, 0.051, 0])], "failed"),
    "the base leaning by 25 degrees": (["nl_stack"], [based(moment(), [0, 0, 0], 25)] * 4, None),
    "the base leaning by 27 degrees": (["nl_stack"], [based(moment(), [0, 0, 0], 27)] * 4, "failed"),
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

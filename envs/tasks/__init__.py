"""The tasks, by the name that their YAML gives."""

from envs.tasks.base import Task
from envs.tasks.grasp import Grasp
from envs.tasks.lift import Lift
from envs.tasks.nl_reach import NLReach
from envs.tasks.nl_reach_gesture import NLReachGesture
from envs.tasks.pick_and_place import PickAndPlace
from envs.tasks.pick_and_rotate import PickAndRotate
from envs.tasks.poke import Poke
from envs.tasks.press import PressButton
from envs.tasks.push import Push
from envs.tasks.reach import Reach
from envs.tasks.reach_gesture import ReachGesture
from envs.tasks.swipe import Swipe
from envs.tasks.switch import SwitchLever
from envs.tasks.throw import Throw
from envs.tasks.turn import TurnWheel
from envs.tasks.types import NOTHING, CurriculumConfig, Episode, GestureSwitch, Outcome, State, TaskConfig

TASKS: dict[str, type[Task]] = {
    "reach": Reach,
    "nl_reach": NLReach,
    "reach_gesture": ReachGesture,
    "nl_reach_gesture": NLReachGesture,
    "pick_and_place": PickAndPlace,
    "nl_pick_and_place": PickAndPlace,
    "push": Push,
    "nl_push": Push,
    "nl_grasp": Grasp,
    "nl_lift": Lift,
    "swipe": Swipe,
    "poke": Poke,
    "throw": Throw,
    "pick_and_rotate": PickAndRotate,
    "press": PressButton,
    "switch": SwitchLever,
    "turn": TurnWheel,
}

__all__ = [
    "NOTHING",
    "TASKS",
    "CurriculumConfig",
    "Episode",
    "GestureSwitch",
    "Grasp",
    "Lift",
    "NLReach",
    "NLReachGesture",
    "Outcome",
    "PickAndPlace",
    "PickAndRotate",
    "Poke",
    "PressButton",
    "Push",
    "Reach",
    "ReachGesture",
    "State",
    "Swipe",
    "SwitchLever",
    "Task",
    "TaskConfig",
    "Throw",
    "Turn",
    "TurnWheel",
]

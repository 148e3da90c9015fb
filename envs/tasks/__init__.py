"""The tasks, by the name that their YAML gives."""

from envs.tasks.base import Episode, Outcome, State, TaskConfig, Turn
from envs.tasks.nl_reach import NLReach
from envs.tasks.nl_reach_gesture import NLReachGesture
from envs.tasks.reach import Reach
from envs.tasks.reach_gesture import ReachGesture

TASKS: dict[str, type[Reach]] = {
    "reach": Reach,
    "nl_reach": NLReach,
    "reach_gesture": ReachGesture,
    "nl_reach_gesture": NLReachGesture,
}

__all__ = [
    "TASKS",
    "Episode",
    "NLReach",
    "NLReachGesture",
    "Outcome",
    "Reach",
    "ReachGesture",
    "State",
    "TaskConfig",
    "Turn",
]

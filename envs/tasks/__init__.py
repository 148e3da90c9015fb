"""The tasks, by the name that their YAML gives."""

from envs.tasks.base import Episode, Outcome, State, TaskConfig
from envs.tasks.nl_reach import NLReach
from envs.tasks.reach import Reach

TASKS: dict[str, type[Reach]] = {"reach": Reach, "nl_reach": NLReach}

__all__ = ["TASKS", "Episode", "NLReach", "Outcome", "Reach", "State", "TaskConfig"]

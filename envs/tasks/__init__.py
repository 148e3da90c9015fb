"""The tasks: goals of episodes, reward terms, and ends of episodes.

`TASKS` maps the `name` of each conf/task/*.yaml to its class. Every module of this package is imported here, so that a
new file registers its task without an edit elsewhere. What tasks share is in `envs.tasks.shared`, which imports none of
them.
"""

from importlib import import_module
from pkgutil import iter_modules

from envs.tasks.shared.base import TASK_VERBS, TASKS, Task, register_task
from envs.tasks.shared.task_config import NO_CURRICULUM, CurriculumConfig, RandomizeConfig, TaskConfig
from envs.tasks.shared.types import (
    NOTHING,
    EpisodeSpec,
    GestureSwitch,
    GivenInstruction,
    GripperStart,
    State,
    StepOutcome,
    TaskTraits,
)

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)

__all__ = [
    "NOTHING",
    "NO_CURRICULUM",
    "TASKS",
    "TASK_VERBS",
    "CurriculumConfig",
    "EpisodeSpec",
    "GestureSwitch",
    "GivenInstruction",
    "GripperStart",
    "RandomizeConfig",
    "State",
    "StepOutcome",
    "Task",
    "TaskConfig",
    "TaskTraits",
    "register_task",
]

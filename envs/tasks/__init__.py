"""The tasks: goals of episodes, reward terms, and ends of episodes.

`TASKS` maps the `name` of each conf/task/*.yaml to its class. Every module of this package is imported here, so that a
new file registers its task without an edit elsewhere.
"""

from importlib import import_module
from pkgutil import iter_modules

from envs.tasks.shared.base import TASKS, Task, register_task
from envs.tasks.shared.types import (
    NO_CURRICULUM,
    NOTHING,
    CurriculumConfig,
    EpisodeSpec,
    GestureSwitch,
    Outcome,
    RandomizeConfig,
    Said,
    State,
    TaskConfig,
)

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)

__all__ = [
    "NOTHING",
    "NO_CURRICULUM",
    "TASKS",
    "CurriculumConfig",
    "EpisodeSpec",
    "GestureSwitch",
    "Outcome",
    "RandomizeConfig",
    "Said",
    "State",
    "Task",
    "TaskConfig",
    "register_task",
]

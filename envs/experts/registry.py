"""The table of scripted experts, which expert classes enter by decorator."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from conf.schema import ConfigError
from envs.experts.base import Expert
from envs.workspace_env import WorkspaceEnv

EXPERTS: dict[str, type[Expert]] = {}
ExpertClass = TypeVar("ExpertClass", bound=type[Expert])


def register_expert(*tasks: str) -> Callable[[ExpertClass], ExpertClass]:
    """Class decorator that registers the expert for tasks, given by their names in `envs.tasks.TASKS`.

    Raises ValueError where a task has an expert already.
    """

    def register(expert: ExpertClass) -> ExpertClass:
        for task in tasks:
            if task in EXPERTS:
                raise ValueError(f"task {task!r} has an expert already: {EXPERTS[task].__name__}")
            EXPERTS[task] = expert
        return expert

    return register


def expert(env: WorkspaceEnv) -> Expert:
    """Returns a new expert for the environment's task. Raises ConfigError where none is registered."""
    name = env.config.task.name
    if name not in EXPERTS:
        raise ConfigError(
            f"task={name} has no scripted expert: register one with @register_expert({name!r}) in envs/experts/"
        )
    return EXPERTS[name](env)

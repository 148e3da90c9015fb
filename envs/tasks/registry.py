"""The table of tasks, which task classes enter by decorator."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from language import VERBS
from language.errors import check_known

if TYPE_CHECKING:
    from envs.tasks.base import Task

TASKS: dict[str, type[Task]] = {}
TaskClass = TypeVar("TaskClass", bound="type[Task]")


def register_task(*names: str, verb: str) -> Callable[[TaskClass], TaskClass]:
    """Class decorator that registers a task.

    Args:
        names: The values of `name` in conf/task/*.yaml that select the class.
        verb: The key of `language.VERBS` for the task's sentences.

    Raises:
        LanguageError: The verb is unknown.
        ValueError: A name is taken.
    """
    check_known("verb", verb, VERBS)

    def register(task: TaskClass) -> TaskClass:
        for name in names:
            if name in TASKS:
                raise ValueError(f"task {name!r} is registered already, as {TASKS[name].__name__}")
            TASKS[name] = task
        task.verb = verb
        return task

    return register

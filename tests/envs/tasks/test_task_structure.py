"""How tasks are built: few levels of classes, traits that are declared, and docstrings with fixed headings."""

import ast
import inspect
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from envs.tasks import TASKS, Task, TaskTraits
from envs.tasks.shared.manipulation import Manipulation

HEADINGS = ("Instruction", "Success", "Failure", "Reward terms", "Config keys")
CLASSES = sorted(set(TASKS.values()), key=lambda task: task.__name__)
MOST_LEVELS = 4
SHARED = Path(__file__).parents[3] / "envs" / "tasks" / "shared"


def levels(task):
    """The task classes from `Task` down to this one."""
    return [each for each in task.__mro__ if issubclass(each, Task)]


@pytest.mark.parametrize("task", CLASSES)
def test_no_task_is_more_than_four_classes_deep(task):
    assert len(levels(task)) <= MOST_LEVELS


@pytest.mark.parametrize("task", CLASSES)
def test_a_task_has_one_base_class(task):
    for each in levels(task):
        assert len(each.__bases__) == 1, f"{each.__name__} has several bases: use composition"


def test_traits_are_frozen_and_every_one_is_documented():
    with pytest.raises(FrozenInstanceError):
        TASKS["reach"].traits.moves = True
    for field in fields(TaskTraits):
        assert f"    {field.name}: " in inspect.getdoc(TaskTraits)


@pytest.mark.parametrize("task", CLASSES)
def test_no_class_attribute_of_a_task_repeats_a_trait(task):
    for name in (field.name for field in fields(TaskTraits)):
        assert not hasattr(task, name), f"{task.__name__}.{name}: declare it in `traits`"


@pytest.mark.parametrize("task", CLASSES)
def test_the_docstring_has_the_fixed_headings_in_their_order(task):
    lines = [line.strip() for line in task.__doc__.splitlines()]
    found = [line.split(":")[0] for line in lines if line.split(":")[0] in HEADINGS]
    assert found == list(HEADINGS)


@pytest.mark.parametrize("task", CLASSES)
def test_the_docstring_names_every_reward_term(task):
    text = " ".join(task.__doc__.split("Reward terms:")[1].split("Config keys:")[0].split())
    assert [term for term in task.terms if term not in text] == []


@pytest.mark.parametrize("task", [task for task in CLASSES if issubclass(task, Manipulation)])
def test_the_term_for_failure_follows_from_the_traits(task):
    assert ("failed" in task.terms) == task.traits.fails


def test_what_tasks_share_imports_no_task():
    for path in sorted(SHARED.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("envs.tasks"):
                assert str(node.module).startswith("envs.tasks.shared"), f"{path.name} imports {node.module}"

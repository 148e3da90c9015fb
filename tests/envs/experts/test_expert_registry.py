"""Experts register by decorator, and a task without one raises a clear error."""

from types import SimpleNamespace

import pytest

from core.errors import ConfigError
from envs.experts import EXPERTS, expert, register_expert
from envs.tasks import TASKS


def test_every_task_has_an_expert():
    assert set(EXPERTS) == set(TASKS)


def test_a_task_has_one_expert():
    with pytest.raises(ValueError, match="task 'reach' has an expert already: ReachExpert"):
        register_expert("reach")(EXPERTS["reach"])


def test_a_task_without_an_expert_is_one_clear_error():
    env = SimpleNamespace(config=SimpleNamespace(task=SimpleNamespace(name="wave")))
    with pytest.raises(ConfigError, match=r"^task=wave has no scripted expert: register one [^\n]+$"):
        expert(env)

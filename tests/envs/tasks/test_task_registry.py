"""Tasks register by decorator, and each option of `task` states the weights of all reward terms."""

import numpy as np
import pytest
import yaml

from core.errors import ConfigError
from core.overrides import ROOT, compose, groups
from envs.config import read_env
from envs.tasks import TASK_VERBS, TASKS, register_task
from language import VERBS, LanguageError
from tests.helpers.env_cases import task_of

OPTIONS = groups()["task"]


@pytest.mark.slow
def test_every_registered_task_has_an_option_and_a_verb():
    assert {compose([f"task={option}"]).task.name for option in OPTIONS} == set(TASKS)
    assert set(TASK_VERBS) == set(TASKS)
    assert set(TASK_VERBS.values()) <= set(VERBS)


def test_a_decorated_class_is_found_by_its_names(monkeypatch):
    monkeypatch.setattr("envs.tasks.shared.base.TASKS", {})
    monkeypatch.setattr("envs.tasks.shared.base.TASK_VERBS", {})
    from envs.tasks.shared import base

    wave = base.register_task("wave", "nl_wave", verb="reach")(type("Wave", (TASKS["reach"],), {}))
    assert {"wave": wave, "nl_wave": wave} == base.TASKS
    assert base.TASK_VERBS == {"wave": "reach", "nl_wave": "reach"}


def test_a_name_is_registered_once():
    with pytest.raises(ValueError, match="task 'reach' is registered already, as Reach"):
        register_task("reach", verb="reach")(TASKS["reach"])


def test_an_unknown_verb_is_refused():
    with pytest.raises(LanguageError, match="did you mean 'reach'"):
        register_task("wave", verb="reech")


@pytest.mark.slow
@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_states_the_weight_of_each_term_itself(option):
    written = yaml.safe_load((ROOT / "task" / f"{option}.yaml").read_text(encoding="utf-8"))
    own = written.get("task", written)["reward"]
    assert set(own) == set(TASKS[compose([f"task={option}"]).task.name].terms)
    assert own == read_env(compose([f"task={option}"])).task.reward


@pytest.mark.slow
@pytest.mark.parametrize("option", OPTIONS)
def test_an_unknown_reward_term_is_refused(option):
    with pytest.raises(ConfigError, match=r"^task\.reward\.progres is not a known term of task\.name=\w+; [^\n]+$"):
        task_of(option, "+task.reward.progres=1")


@pytest.mark.slow
@pytest.mark.parametrize("option", OPTIONS)
def test_a_missing_reward_term_is_refused(option):
    with pytest.raises(ConfigError, match=r"^task\.reward\.success has no value: task\.name=\w+ needs a weight for"):
        task_of(option, "~task.reward.success")


def test_the_sentences_of_a_reaching_task_have_the_verb_that_it_is_registered_with(monkeypatch):
    monkeypatch.setitem(TASK_VERBS, "nl_reach", "lift")
    task = task_of("nl_reach")
    assert {task.draw(np.random.default_rng(seed)).sentence.split()[0] for seed in range(5)} == {"lift"}

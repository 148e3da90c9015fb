"""The conditions of the robustness table."""

from __future__ import annotations

import pytest

from core.errors import ConfigError
from core.overrides import apply, compose
from envs import read_env
from envs.perturbed_conditions import PLAIN, conditions, each_condition
from trainers.reports.evaluation_text import table, with_ratios


@pytest.mark.slow
def test_each_condition_of_the_default_task_can_be_built_and_changes_something():
    config = compose([])
    built = []
    for condition in conditions(config).values():
        env = read_env(apply(config, condition.overrides)).without_curriculum().randomized(condition.randomize)
        assert env not in built
        built.append(env)
    assert len(built) > 12


def test_what_a_task_cannot_do_is_left_out_with_the_reason():
    def evaluate(condition):
        if any("num_objects" in word for word in condition.overrides):
            raise ConfigError("too many")
        return {"success_at_end": 1.0}

    results, impossible = each_condition(compose([]), evaluate)
    assert set(impossible.values()) == {"too many"}
    assert PLAIN in results
    assert not set(results) & set(impossible)


def test_an_impossible_plain_condition_is_an_error():
    def evaluate(condition):
        raise ConfigError("no")

    with pytest.raises(ConfigError, match="no"):
        each_condition(compose([]), evaluate)


def test_the_table_has_ratios_and_marks_the_worst_row():
    def result(success):
        return {"success_at_end": success, "ci95": [0.5, 0.9], "disturbed": 0.0, "wrong_object": 0.0, "episodes": 10}

    rows = with_ratios({PLAIN: result(0.8), "delay": result(0.6)})
    assert [row["over_plain"] for row in rows] == pytest.approx([1.0, 0.75])
    text = table(rows)
    assert "| delay (worst) | 0.600 (0.500-0.900) | 0.750 | 0.000 | 0.000 | 10 |" in text

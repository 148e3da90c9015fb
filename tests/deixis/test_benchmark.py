"""The protocol for policies of any origin."""

import numpy as np
import pytest

import deixis
from core.errors import ConfigError, UseError
from deixis.benchmark import AUDITS, PARTS, ROWS, SEEDS, SUITES, VERBS, audit_rows, least_difference, row_seed
from envs.tasks import TASKS
from trainers.collect.worker import derive_seed

FEW = {"parts": ["words"], "episodes": 4, "seeds": [0], "worlds": 4, "overrides": ["task.max_steps=6"]}


class Still:
    """Holds still, and remembers what it was given."""

    def __init__(self):
        self.seen, self.resets = [], 0

    def reset(self):
        self.resets += 1

    def __call__(self, observation):
        self.seen.append(observation)
        return np.zeros((len(observation["robot"]), 3), np.float32)


def test_the_verbs_are_those_of_the_task_with_devices():
    assert len(VERBS) == len(set(VERBS)) == 14
    assert [row.name for row in ROWS if row.part == "verbs"] == list(VERBS)
    assert set(TASKS["anything"].verbs) < set(VERBS)


@pytest.mark.slow
def test_any_callable_is_evaluated_and_the_audits_change_what_it_is_given(monkeypatch):
    monkeypatch.setitem(SUITES, "deixis-14", [row for row in ROWS if row.name == "train"])
    policy = Still()
    report = deixis.evaluate(policy, instruction="text", audits=True, **FEW)
    assert [row["name"] for row in report["rows"]] == ["train", *AUDITS]
    assert all(row["episodes"] == 4 and row["success"] <= row["ci95"][1] for row in report["rows"])
    assert report["versions"]["pybullet"]
    assert policy.resets == len(report["rows"])
    first = policy.seen[::6]
    assert all(sentence for sentence in first[0]["instruction"])
    assert not any(first[1]["instruction"])  # no words
    assert set(first[2]["instruction"]) != set(first[0]["instruction"])
    assert not first[3]["objects"].any()  # no scene
    np.testing.assert_array_equal(first[0]["objects"][..., :7], first[-1]["objects"][..., :7])
    assert (first[0]["objects"][..., 7:10] != first[-1]["objects"][..., 7:10]).any()  # other shades


def test_no_seed_is_of_training_and_each_part_has_its_own():
    seeds = {row_seed(row, seed) for row in ROWS for seed in SEEDS}
    assert len(seeds) == len(PARTS) * len(SEEDS)
    assert not seeds & {derive_seed(seed, index) for seed in range(20) for index in range(200)}
    assert min(seeds) >= 2**30  # training has none of these: trainers/collect/worker.py
    of_runs = {derive_seed(seed, index, evaluation=True) for seed in range(20) for index in [*range(99), 2**20]}
    assert not seeds & of_runs


def test_the_least_difference_is_that_of_two_shares():
    assert least_difference(0.5, 2000) == pytest.approx(0.031, abs=5e-4)
    assert least_difference(0.98, 2000) == pytest.approx(0.0087, abs=5e-4)
    assert least_difference(1.0, 2000) > 0


def test_audits_have_the_size_of_the_objects_of_the_task():
    names = {row.name: row for row in audit_rows("words")}
    assert names["objects 0.8 x"].overrides == ("task=nl_reach_large", "task.object_size=0.04")
    assert audit_rows("chains") == []


def test_what_is_wrong_is_said():
    for settings, text in (
        ({"suite": "deixis-15"}, "did you mean 'deixis-14'"),
        ({"parts": ["verb"]}, "did you mean 'verbs'"),
        ({"episodes": 2, "seeds": [0, 1, 2]}, "episodes=2 must be at least one for each"),
        ({"worlds": 1}, "worlds=1 must be at least 2"),
        ({"parts": []}, "has no part"),
    ):
        with pytest.raises(ConfigError, match=text):
            deixis.evaluate(Still(), **settings)
    with pytest.raises(ConfigError, match=r"give deixis.load_policy\('nl_reach_kuka'\)"):
        deixis.evaluate("nl_reach_kuka", **FEW)
    with pytest.raises(ConfigError, match="none for the part 'words'"):
        deixis.evaluate({}, **FEW)
    with pytest.raises(UseError, match="must be callable"):
        deixis.evaluate(3, **FEW)

"""Runs in a directory, and groups of equal configurations."""

from __future__ import annotations

import pytest

from tests.helpers.run_folders import add_run, config
from trainers.sweeps.runs import command_line, distinct_overrides, find_runs, group_by_configuration

DEFAULT = "kuka step nl_reach ppo"


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ([config(0), config(1), config(2)], [DEFAULT]),
        ([config(0, algo="sac"), config(1), config(2, algo="sac")], ["sac", "ppo"]),
        ([config(0), config(0, robot="panda", control="joints")], ["kuka step", "panda joints"]),
        ([config(0), config(0, robot="panda"), config(0, algo="sac")], ["kuka ppo", "panda ppo", "kuka sac"]),
        ([config(0, networks=1), config(0, networks=3)], [f"{DEFAULT}, policy.networks={n}" for n in (1, 3)]),
        ([config(0, scenario=2), config(0, scenario=3, control="joints")], ["2: kuka step ppo", "3: kuka joints ppo"]),
        ([config(0, scenario=2), config(0, robot="jaco")], ["2: kuka step ppo", "jaco step ppo"]),
        ([config(0, scenario=2, task="a"), config(0, scenario=2, task="b")], ["a", "b"]),
        ([config(0, scenario=s, task="abc"[s]) for s in (1, 2)], ["1: kuka step b ppo", "2: kuka step c ppo"]),
    ],
)  # fmt: skip
def test_groups_are_labelled_by_what_differs_except_the_seed(values, labels, tmp_path):
    for number, each in enumerate(values):
        add_run(tmp_path / f"{number}_a", each)
    assert list(group_by_configuration(find_runs(tmp_path))) == labels


def test_jobs_are_read_in_the_order_of_their_numbers(tmp_path):
    for number in (10, 9, 0):
        add_run(tmp_path / f"{number}_a", config(number))
    assert [run.seed for run in find_runs(tmp_path)] == [0, 9, 10]


def test_a_command_line_has_no_quotes_around_numbers():
    assert command_line(["scenario='2'", "seed=0"], "-m") == "python train.py -m scenario=2 seed=0"


def test_runs_are_named_by_the_overrides_that_not_all_share():
    assert distinct_overrides([["seed=0", "algo=sac"], ["seed=1", "algo=sac"]]) == ["seed=0", "seed=1"]
    assert distinct_overrides([["seed=0"]]) == ["seed=0"]
    assert distinct_overrides([["a=1"], ["a=1"]]) == ["default", "default"]

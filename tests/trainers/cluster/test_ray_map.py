"""A function over many inputs on Ray: results in order, and lost tasks done again."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from core.errors import ConfigError, Interrupted, RunError
from trainers.cluster.ray_map import evaluate_shards, map_on_cluster
from trainers.evaluation.evaluation import EpisodeOutcome


def squared(folder: Path, value: int) -> int:
    if value == 2 and not (folder / "lost").exists():
        (folder / "lost").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if value == 7:
        raise ConfigError("seven is refused")
    if value == 8:
        raise ArithmeticError("eight is too much")
    return value * value


def outcomes(shard: tuple[int, int]) -> tuple[list[EpisodeOutcome], list[str]]:
    number, episodes = shard
    return [EpisodeOutcome(0, i < number, True, False, 0.1 * i * number, 5 + i) for i in range(episodes)], ["colour"]


@pytest.mark.slow
def test_results_are_in_order_and_a_lost_task_is_done_again(ray, tmp_path, capfd):
    assert list(map_on_cluster(partial(squared, tmp_path), range(6), "number")) == [0, 1, 4, 9, 16, 25]
    assert (
        "warning: number 2 was lost: WorkerCrashedError; it is done again (1 of at most 3 times)"
        in capfd.readouterr().err
    )


@pytest.mark.slow
def test_exceptions_of_tasks_are_told_by_their_input(ray, tmp_path):
    with pytest.raises(ConfigError, match=r"seven is refused \(on a node of the cluster\)"):
        list(map_on_cluster(partial(squared, tmp_path), [7], "number"))
    with pytest.raises(RunError, match="number 0 raised ArithmeticError: eight is too much"):
        list(map_on_cluster(partial(squared, tmp_path), [8], "number"))
    with pytest.raises(Interrupted):
        list(map_on_cluster(partial(squared, tmp_path), [1], "number", stop=lambda: True))


@pytest.mark.slow
def test_an_evaluation_on_a_cluster_has_the_result_of_one_process(ray):
    here = evaluate_shards(outcomes, 22, 4, on_cluster=False)
    assert evaluate_shards(outcomes, 22, 4, on_cluster=True) == here
    assert (here["episodes"], here["shards"]) == (22, 4)


def test_the_number_of_shards_on_a_cluster_follows_from_that_of_the_episodes(monkeypatch):
    monkeypatch.setattr("trainers.cluster.ray_map.map_on_cluster", lambda function, inputs, name: map(function, inputs))
    assert evaluate_shards(outcomes, 1001, None, on_cluster=True)["shards"] == 3
    assert "shards" not in evaluate_shards(outcomes, 1001, None, on_cluster=False)

"""A run that was stopped and resumed equals a run that was never stopped, bit for bit."""

from __future__ import annotations

import signal
from functools import partial

import pytest
import torch

from tests.helpers.fake_env import WORDS, FakeEnv, make_env
from tests.helpers.labelled_fake_env import make_labelled
from tests.helpers.short_training import train, untimed_rows
from tests.helpers.training_configs import config, training
from trainers.collect.worker import Worker
from trainers.evaluation.evaluation import evaluate
from trainers.run import checkpoint
from trainers.run.progress import Progress
from trainers.run.train_loop import TrainingRun

LONG = ["total_frames=512", "eval.interval=192", "eval.episodes=8", "algo.grounding_scenes=8"]
IMITATION = ["algo.updates_per_frame=0.1", "algo.buffer=300", "algo.expert_until=1.0"]
OFF_POLICY = ["algo.updates_per_frame=0.1", "algo.learning_starts=100", "algo.buffer=300"]  # overwritten before the end
DEMONSTRATED = [*OFF_POLICY, "algo.demonstrations=128"]
OVERLAP = ["collector.workers=2", "collector.overlap=true"]


def overrides_of(algo):
    own = {"sac": OFF_POLICY, "td3": OFF_POLICY, "tqc": DEMONSTRATED, "bc": IMITATION}
    return [*LONG, *own.get(algo, ["algo.epochs=1"])]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """`whole(algo, overrides, **options)` gives the folder of a run that was never stopped; each is trained once."""
    folders = {}

    def folder_of(algo, overrides, **options):
        key = (algo, *overrides)
        if key not in folders:
            folders[key] = tmp_path_factory.mktemp(algo)
            train(folders[key], algo, overrides=overrides, **options)
        return folders[key]

    return folder_of


def weights(folder):
    """All numbers of the networks and optimizers."""
    return dict(leaves("", checkpoint.load(folder / "checkpoints" / "last.pt")["algorithm"]))


def leaves(name, value):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(f"{name}/{key}", item)
    elif isinstance(value, list | tuple):
        for key, item in enumerate(value):
            yield from leaves(f"{name}/{key}", item)
    else:
        yield name, value


def assert_same_run(one, other):
    assert untimed_rows(one) == untimed_rows(other)
    a, b = weights(one), weights(other)
    assert a.keys() == b.keys()
    different = [key for key in a if not (torch.equal(a[key], b[key]) if torch.is_tensor(a[key]) else a[key] == b[key])]
    assert different == []


def stop_in_collection(monkeypatch, iteration):
    """A signal arrives while the batch of this iteration is collected."""
    collect = Worker.collect

    def stopped(worker, number):
        if number == iteration:
            signal.raise_signal(signal.SIGTERM)
        return collect(worker, number)

    monkeypatch.setattr(Worker, "collect", stopped)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("algo", "iteration"), [("ppo", 2), ("sac", 12), ("td3", 11), ("tqc", 2), ("tqc", 11), ("bc", 2)]
)
def test_a_run_that_a_signal_stopped_goes_on_exactly(whole, tmp_path, monkeypatch, algo, iteration):
    overrides, folder = overrides_of(algo), tmp_path / "stopped"
    options = {"make": make_labelled} if algo in ("bc", "tqc") else {}
    undisturbed = whole(algo, overrides, **options)
    with monkeypatch.context() as patch:
        stop_in_collection(patch, iteration)
        with pytest.raises(SystemExit):
            train(folder, algo, overrides=overrides, **options)
    assert len(untimed_rows(folder)) == iteration + 1
    train(folder, algo, overrides=overrides, resume=checkpoint.find(folder), **options)
    assert_same_run(undisturbed, folder)


@pytest.mark.slow
@pytest.mark.parametrize(("algo", "collector"), [("ppo", []), ("sac", []), ("ppo", OVERLAP)])
def test_a_run_that_ended_before_its_schedule_goes_on_exactly(whole, tmp_path, capsys, algo, collector):
    overrides = [*overrides_of(algo), *collector]
    undisturbed = whole(algo, overrides)
    folder = tmp_path / "parts"
    for frames in (150, 350, 512):
        parts = [*overrides, f"total_frames={frames}", "schedule_frames=512"]
        train(folder, algo, overrides=parts, resume=checkpoint.find(folder) if frames > 150 else None)
    assert_same_run(undisturbed, folder)
    assert "metrics.csv lacks" not in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("evaluation", [2, 3])  # the third is the final one
def test_an_evaluation_that_was_interrupted_is_repeated(whole, tmp_path, monkeypatch, evaluation):
    calls = []

    def stopped(*arguments, **options):
        calls.append(1)
        if len(calls) == evaluation:
            signal.raise_signal(signal.SIGHUP)
        return evaluate(*arguments, **options)

    overrides, folder = overrides_of("ppo"), tmp_path / "stopped"
    undisturbed = whole("ppo", overrides)
    monkeypatch.setattr("trainers.run.evaluator.evaluate", stopped)
    with pytest.raises(SystemExit) as left:
        train(folder, overrides=overrides)
    assert left.value.code == 128 + signal.SIGHUP
    train(folder, overrides=overrides, resume=checkpoint.find(folder))
    assert_same_run(undisturbed, folder)


@pytest.mark.slow
def test_an_evaluation_beside_training_that_a_signal_stopped_is_repeated(tmp_path, monkeypatch):
    overrides = [*overrides_of("ppo"), *OVERLAP, "eval.overlap=true", "eval.interval=128", "eval.interval_episodes=16"]
    train(tmp_path / "whole", overrides=overrides)
    folder, show = tmp_path / "stopped", Progress.show

    def stopped(progress, row, status=None):
        show(progress, row, status)
        if row["frames"] == 384:  # the evaluation after 128 frames is still running, and others wait
            signal.raise_signal(signal.SIGTERM)

    with monkeypatch.context() as patch:
        patch.setattr(Progress, "show", stopped)
        with pytest.raises(SystemExit):
            train(folder, overrides=overrides, make_eval_env=partial(FakeEnv, nap=0.02))
    state = checkpoint.load(folder / "checkpoints" / "last.pt", to_train=True)["state"]
    assert [payload["counters"]["frames"] for payload in state["pending"]] == [128, 256, 384]
    assert [row["frames"] for row in state["rows"]] == [128, 256, 384]
    train(folder, overrides=overrides, resume=checkpoint.find(folder))
    assert_same_run(tmp_path / "whole", folder)


class Killed(BaseException):
    """Stands for a kill: the run saves nothing when it is raised."""


@pytest.mark.slow
def test_a_kill_loses_what_came_after_the_last_checkpoint_alone(whole, tmp_path, monkeypatch):
    """Rows that were written after the checkpoint are measured again, and are the same."""
    overrides, folder = overrides_of("sac"), tmp_path / "killed"
    undisturbed, collect = whole("sac", overrides), Worker.collect

    def killed(worker, number):
        if number == 8:
            raise Killed
        return collect(worker, number)

    with monkeypatch.context() as patch:
        patch.setattr(Worker, "collect", killed)
        with pytest.raises(Killed):
            train(folder, "sac", overrides=overrides)
    path = checkpoint.find(folder)
    assert checkpoint.load(path)["counters"]["frames"] < float(untimed_rows(folder)[-1]["frames"])
    train(folder, "sac", overrides=overrides, resume=path)
    assert_same_run(undisturbed, folder)


@pytest.mark.slow
def test_checkpoints_are_written_between_evaluations_and_the_latest_are_kept(tmp_path):
    overrides = [*overrides_of("sac"), "total_frames=300", "checkpoint.every=0.001", "checkpoint.keep=2"]
    train(tmp_path, "sac", overrides=overrides, make=slow_env)
    kept = sorted(path.name for path in (tmp_path / "checkpoints").glob("[0-9]*.pt"))
    assert len(kept) == 2
    whole = tmp_path / "whole"
    train(whole, "sac", overrides=overrides)
    again = tmp_path / "checkpoints" / kept[0]
    train(tmp_path, "sac", overrides=overrides, resume=again)
    assert_same_run(whole, tmp_path)


def slow_env(worlds, seed):
    env = make_env(worlds, seed)
    env.nap = 0.01
    return env


def test_a_row_that_another_collector_measured_is_resumed_without_its_own_columns(tmp_path):
    run = TrainingRun(training(), make_env, tmp_path, config=config(), vocabulary=WORDS)
    row = {"frames": 128.0, "time/restarts": 1.0, "time/batch_age": 0.0}
    run.load_running_state({**run.running_state(), "rows": [row], "memories": {}})
    run.close()
    assert run.rows == [{"frames": 128.0}]

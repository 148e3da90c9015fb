"""Training runs: determinism, resuming, errors and signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from functools import partial
from pathlib import Path

import pytest
import torch

from core.errors import ConfigError
from tests.helpers.fake_env import FakeEnv, make_env
from tests.helpers.short_training import train, untimed_rows
from trainers.algorithms.algorithm import DivergedError
from trainers.collect.rollouts import CollectionError
from trainers.evaluation.evaluation import evaluate
from trainers.run import checkpoint
from trainers.run.metrics import read_metrics
from trainers.run.progress import Progress
from trainers.utils.files import read_checked_json

ROOT = Path(__file__).parents[3]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run(tmp_path):
    """Of SAC; that of PPO is checked on real worlds."""
    results = [train(tmp_path / name, "sac") for name in "ab"]
    assert untimed_rows(tmp_path / "a") == untimed_rows(tmp_path / "b")
    assert len(untimed_rows(tmp_path / "a")) > 2
    assert results[0]["mean_return"] == results[1]["mean_return"]


@pytest.mark.slow
def test_evaluations_beside_training_change_nothing(tmp_path):
    for overlap in ("true", "false"):
        train(tmp_path / overlap, overrides=["collector.workers=2", "eval.interval=128", f"eval.overlap={overlap}"])
    rows = untimed_rows(tmp_path / "true")
    assert rows == untimed_rows(tmp_path / "false")
    assert [row["eval/success_at_end"] == "nan" for row in rows] == [False] * 4
    best = [checkpoint.load(tmp_path / name / "checkpoints" / "best.pt")["counters"] for name in ("true", "false")]
    assert best[0]["frames"] == best[1]["frames"]
    assert best[0]["best"] == best[1]["best"]


@pytest.mark.slow
def test_the_final_evaluation_is_that_of_the_last_row(tmp_path):
    result = train(tmp_path, overrides=["eval.interval=128"])
    *rows, last = read_metrics(tmp_path / "metrics.csv")
    assert [row["frames"] for row in rows] == [128, 256, 384]
    assert all(row["eval/success_at_end"] * 8 % 1 == 0 for row in rows)  # of eval.interval_episodes
    for name in ("success_at_end", "wrong_object", "mean_return"):
        assert last[f"eval/{name}"] == pytest.approx(result[name])
    best = checkpoint.load(tmp_path / "checkpoints" / "best.pt")["counters"]["best"]
    assert best == pytest.approx(max(row["eval/success_at_end"] for row in (*rows, last)))


@pytest.mark.slow
def test_training_goes_on_while_two_evaluations_wait_and_not_three(tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(Progress, "show", lambda _, row, status=None: shown.append(row["frames"]))
    monkeypatch.setattr(Progress, "show_evaluation", lambda _, row: shown.append((row["frames"], len(shown))))
    overrides = ["collector.workers=2", "eval.interval=128", "eval.overlap=true", "total_frames=640"]
    train(tmp_path, overrides=overrides, make_eval_env=partial(FakeEnv, nap=0.05))
    assert shown[:4] == [128, 256, 384, (128, 3)]


@pytest.mark.slow
def test_a_run_learns_the_instructions_and_writes_its_report(tmp_path):
    overrides = ["total_frames=12000", "collector.worlds=16", "algo.horizon=32", "algo.minibatch=256"]
    overrides += ["eval.video_episodes=1", "eval.interval=6000", "eval.episodes=60", "logger=[tensorboard]"]
    result = train(tmp_path, overrides=overrides, drawn=True, make_video_env=partial(make_env, 1, 9))
    assert result["success_at_end"] > 0.8
    assert result["episodes"] == 60
    assert read_checked_json(tmp_path / "eval.json") == result
    assert {"success_once", "wrong_object", "ci95", "frames", "wall_s", "frames_per_s", "by_kind"} <= set(result)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"checkpoints", "metrics.csv", "eval.json", "learning_curve.png", "evaluation.mp4", "tensorboard"}


@pytest.mark.slow
@pytest.mark.parametrize("algo", ["ppo", "sac"])
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_a_run_without_grounding_supervision_finishes(tmp_path, algo, policy):
    overrides = ["algo.grounding_weight=0.0", "total_frames=256", "policy.privileged_critic=false"]
    assert train(tmp_path, algo, policy, overrides=overrides)["episodes"] == 20


@pytest.mark.slow
@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_resumed_run_continues_the_metrics(tmp_path, algo):
    train(tmp_path, algo)
    rows = untimed_rows(tmp_path)
    resumed = train(tmp_path, algo, overrides=["total_frames=1024"], resume=checkpoint.find(tmp_path))
    assert resumed["frames"] == 1024
    assert untimed_rows(tmp_path)[: len(rows)] == rows
    assert [float(row["frames"]) for row in untimed_rows(tmp_path)] == sorted(
        {float(r["frames"]) for r in untimed_rows(tmp_path)}
    )


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_run_uses_total_frames_to_the_last_step_of_all_worlds(tmp_path, algo, workers):
    result = train(tmp_path, algo, overrides=["total_frames=300", f"collector.workers={workers}"])
    assert result["frames"] == 300 // 8 * 8
    assert float(untimed_rows(tmp_path)[-1]["frames"]) == 300 // 8 * 8


@pytest.mark.slow
def test_a_checkpoint_of_another_algorithm_is_refused(tmp_path):
    train(tmp_path, overrides=["total_frames=128"])
    before = (tmp_path / "metrics.csv").read_bytes()
    with pytest.raises(checkpoint.CheckpointError, match="another algo or policy"):
        train(tmp_path, policy="mlp", resume=checkpoint.find(tmp_path))
    assert (tmp_path / "metrics.csv").read_bytes() == before


def poisoned_env(worlds, seed):
    return FakeEnv(worlds, seed, poison=20)


def test_a_reward_that_is_not_finite_ends_the_run_and_saves_the_batch(tmp_path):
    with pytest.raises(DivergedError, match=r"next/reward is not finite.*diverged\.pt"):
        train(tmp_path, make=poisoned_env)
    batch = torch.load(tmp_path / "diverged.pt", weights_only=True)
    assert batch["next"]["reward"].isnan().any()


def blind_env(worlds, seed):
    return FakeEnv(worlds, seed, poison=20, poisoned="robot")


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "kind"), [(1, "make"), (2, "make"), (1, "make_eval_env")])
def test_an_observation_that_is_not_finite_is_named_and_saved(tmp_path, workers, kind):
    overrides = [f"collector.workers={workers}", "collector.restarts=0"]
    with pytest.raises(CollectionError, match=r"observation robot is not a finite.*diverged\.pt"):
        train(tmp_path, overrides=overrides, **{kind: blind_env})
    frame = torch.load(tmp_path / "diverged.pt", weights_only=True)
    assert frame["robot"].isnan().any()
    assert frame["objects"].isfinite().all()


def test_the_result_is_reported_even_if_it_cannot_be_written(tmp_path):
    (tmp_path / "eval.json").mkdir()
    results = []
    with pytest.raises(ConfigError, match=r"eval\.json cannot be written"):
        train(tmp_path, overrides=["total_frames=128"], on_result=results.append)
    assert [result["frames"] for result in results] == [128]


SCRIPT = """
from pathlib import Path
from functools import partial
from core.platform_tuning import lean_imports
with lean_imports():
    from trainers.run.train_loop import fit
from tests.helpers.fake_env import WORDS, FakeEnv
from tests.helpers.training_configs import config, training
def make(worlds, seed):
    return FakeEnv(worlds, seed, nap=0.002)
if __name__ == "__main__":
    o = ("total_frames=1000000", "collector.workers=2")
    fit(training(overrides=o), make, Path("out"), config(overrides=o), WORDS)
"""


@pytest.mark.slow
def test_a_signal_during_an_evaluation_loses_no_row(tmp_path, monkeypatch):
    def stopped(*arguments, **options):
        signal.raise_signal(signal.SIGINT)
        return evaluate(*arguments, **options)

    monkeypatch.setattr("trainers.run.evaluator.evaluate", stopped)
    with pytest.raises(SystemExit) as left:
        train(tmp_path, overrides=["eval.interval=256"])
    assert left.value.code == 130
    saved = checkpoint.load(tmp_path / "checkpoints" / "last.pt")
    assert saved["counters"]["frames"] == read_metrics(tmp_path / "metrics.csv")[-1]["frames"] > 0


@pytest.mark.slow
def test_sigterm_to_all_processes_saves_a_checkpoint_and_ends_them(tmp_path):
    (tmp_path / "script.py").write_text(textwrap.dedent(SCRIPT))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen([sys.executable, "script.py"], cwd=tmp_path, env=environment, start_new_session=True)
    metrics = tmp_path / "out" / "metrics.csv"
    try:
        deadline = time.monotonic() + 240  # where others are busy, the imports alone take a minute
        while len(read_metrics(metrics)) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGTERM)  # as a job scheduler does: the workers hear it too
        assert process.wait(30) == 143
    finally:
        process.kill()
    assert checkpoint.load(tmp_path / "out" / "checkpoints" / "last.pt")["counters"]["frames"] >= 256
    assert gone(process.pid)


def gone(group, seconds=5.0):
    """Whether no process of the group is left, after the moment that multiprocessing's own tracker takes to notice."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False

import json
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

from tests.helpers.fake_env import WORDS, FakeEnv, make_env
from tests.helpers.plans import config, plan
from trainers.algorithms.algorithm import DivergedError
from trainers.models.policy import build_policy
from trainers.rollout.collection import CollectionError, Rollouts, derive_seed
from trainers.rollout.episode_statistics import EpisodeStatistics
from trainers.rollout.evaluation import evaluate
from trainers.run import checkpoint
from trainers.run.metrics import MetricsWriter, read_metrics
from trainers.run.train_loop import fit

ROOT = Path(__file__).parents[2]


def run(folder, algo="ppo", policy="grounded", make=make_env, overrides=(), **options):
    small = plan(algo, policy, tuple(overrides))
    return fit(small, make, folder, config(algo, policy, tuple(overrides)), WORDS, progress=False, **options)


def untimed(folder):
    rows = read_metrics(folder / "metrics.csv")
    return [{k: repr(v) for k, v in row.items() if not k.startswith("time/")} for row in rows]


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_the_same_seed_the_same_run(tmp_path, algo):
    results = [run(tmp_path / name, algo) for name in "ab"]
    assert untimed(tmp_path / "a") == untimed(tmp_path / "b")
    assert len(untimed(tmp_path / "a")) > 2
    assert results[0]["mean_return"] == results[1]["mean_return"]


def test_it_learns_what_the_words_mean_and_leaves_a_report(tmp_path):
    overrides = ["total_frames=12000", "collector.worlds=16", "algo.horizon=32", "algo.minibatch=256"]
    overrides += ["eval.video_episodes=1", "eval.interval=6000", "eval.episodes=60", "logger=[tensorboard]"]
    result = run(tmp_path, overrides=overrides, make_video_env=partial(make_env, 1, 9))
    assert result["success_at_end"] > 0.8
    assert result["episodes"] == 60
    assert json.loads((tmp_path / "eval.json").read_text()) == result
    assert {"success_once", "wrong_object", "ci95", "frames", "wall_s", "frames_per_s", "by_kind"} <= set(result)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"checkpoints", "metrics.csv", "eval.json", "learning_curve.png", "evaluation.mp4", "tensorboard"}


@pytest.mark.parametrize("algo", ["ppo", "sac"])
@pytest.mark.parametrize("policy", ["grounded", "mlp"])
def test_nothing_is_taught_about_the_words_and_it_still_runs(tmp_path, algo, policy):
    overrides = ["algo.grounding_weight=0.0", "total_frames=256", "policy.privileged_critic=false"]
    assert run(tmp_path, algo, policy, overrides=overrides)["episodes"] == 20


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_a_resumed_run_goes_on(tmp_path, algo):
    run(tmp_path, algo)
    rows = untimed(tmp_path)
    resumed = run(tmp_path, algo, overrides=["total_frames=1024"], resume=checkpoint.find(tmp_path))
    assert resumed["frames"] == 1024
    assert untimed(tmp_path)[: len(rows)] == rows
    assert [float(row["frames"]) for row in untimed(tmp_path)] == sorted(
        {float(r["frames"]) for r in untimed(tmp_path)}
    )


def test_a_run_never_takes_more_frames_than_it_was_given(tmp_path):
    assert 150 < run(tmp_path, overrides=["total_frames=300"])["frames"] <= 300


def test_a_checkpoint_of_another_algorithm_is_refused(tmp_path):
    run(tmp_path, overrides=["total_frames=128"])
    before = (tmp_path / "metrics.csv").read_bytes()
    with pytest.raises(checkpoint.CheckpointError, match="another algo or policy"):
        run(tmp_path, policy="mlp", resume=checkpoint.find(tmp_path))
    assert (tmp_path / "metrics.csv").read_bytes() == before


def poisoned(worlds, seed):
    return FakeEnv(worlds, seed, poison=20)


def test_not_a_number_stops_the_run_and_leaves_the_batch(tmp_path):
    with pytest.raises(DivergedError, match=r"next/reward is not finite.*diverged\.pt"):
        run(tmp_path, make=poisoned)
    batch = torch.load(tmp_path / "diverged.pt", weights_only=True)
    assert batch["next"]["reward"].isnan().any()


def test_seeds_of_training_and_evaluation_never_meet():
    trained = {derive_seed(s, i) for s in range(50) for i in range(50)}
    judged = {derive_seed(s, i, evaluation=True) for s in range(50) for i in range(50)}
    assert len(trained) == len(judged) == 2500
    assert max(trained) < min(judged) < 2**31


def test_episodes_are_carried_over_from_batch_to_batch():
    env = make_env(4, 0)
    batch = env.rollout(60, break_when_any_done=False)
    whole, parts = EpisodeStatistics(env.reward_names), EpisodeStatistics(env.reward_names)
    expected = whole.measure(batch)
    pieces = [parts.measure(batch[:, i : i + 7]) for i in range(0, 60, 7)]
    count = sum(p["train/episodes"] for p in pieces)
    mean = sum(p["train/return"] * p["train/episodes"] for p in pieces if p["train/episodes"]) / count
    assert count == expected["train/episodes"]
    assert mean == pytest.approx(expected["train/return"], rel=1e-6)
    assert expected["reward/there"] + expected["reward/near"] == pytest.approx(float(batch["next", "reward"].mean()))


def test_metrics_keep_one_header_and_forget_what_comes_again(tmp_path):
    metrics = MetricsWriter(tmp_path, ["frames", "a"])
    for frames in (1, 2, 3):
        metrics.write({"frames": frames, "a": frames / 3} if frames != 2 else {"frames": 2})
    with pytest.raises(ValueError, match="b"):
        metrics.write({"frames": 4, "b": 0})
    metrics.close()
    MetricsWriter(tmp_path, ["frames", "a"], after=2).close()
    assert [row["frames"] for row in read_metrics(tmp_path / "metrics.csv")] == [1, 2]
    assert read_metrics(tmp_path / "metrics.csv")[0]["a"] == 1 / 3


def test_two_workers_get_the_weights_and_one_killed_ends_the_run():
    env = make_env(4, 0)
    policy = build_policy(plan().policy, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, plan(overrides=("collector.workers=2",)).collector, 4, 0)
    try:
        batch = rollouts.next().clone()
        assert batch.shape == (8, 4)
        assert not torch.equal(batch["robot"][:4], batch["robot"][4:])
        with torch.no_grad():
            policy.actor.log_std.fill_(-4.0)
            policy.actor.net[-1].bias.fill_(0.5)
        rollouts.sync(policy)
        rollouts.next()
        assert rollouts.next()["action"].mean() == pytest.approx(0.5, abs=0.05)
        pids = [process.pid for process in rollouts.processes]
        os.kill(pids[1], signal.SIGKILL)
        with pytest.raises(CollectionError, match="exit code -9"):
            drain(rollouts)
    finally:
        rollouts.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


@pytest.mark.parametrize("count", [1, 2])
def test_workers_killed_before_they_take_new_weights_end_the_run_too(monkeypatch, count):
    monkeypatch.setattr("trainers.rollout.worker_monitor.GRACE_SECONDS", 1.0)
    env = make_env(4, 0)
    policy = build_policy(plan().policy, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make_env, policy, plan(overrides=("collector.workers=2",)).collector, 4, 0)
    try:
        rollouts.next()
        for process in rollouts.processes[:count]:
            os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(CollectionError, match="failed"):
            drain(rollouts, policy)
    finally:
        rollouts.close()


def drain(rollouts, policy=None):
    if policy is not None:
        rollouts.sync(policy)  # TorchRL would wait for a dead worker's acknowledgement for ever
    for _ in range(3):  # what a worker had sent before its end may still come
        rollouts.next()


SCRIPT = """
from pathlib import Path
from functools import partial
from tests.helpers.fake_env import WORDS, FakeEnv
from tests.helpers.plans import config, plan
from trainers.run.train_loop import fit
def make(worlds, seed):
    return FakeEnv(worlds, seed, nap=0.002)
if __name__ == "__main__":
    o = ("total_frames=1000000", "collector.workers=2")
    fit(plan(overrides=o), make, Path("out"), config(overrides=o), WORDS, progress=False)
"""


def test_who_stops_a_run_in_an_evaluation_loses_no_row(tmp_path, monkeypatch):
    def stopped(*arguments, **options):
        signal.raise_signal(signal.SIGINT)
        return evaluate(*arguments, **options)

    monkeypatch.setattr("trainers.run.train_loop.evaluate", stopped)
    with pytest.raises(SystemExit) as left:
        run(tmp_path, overrides=["eval.interval=256"])
    assert left.value.code == 130
    saved = checkpoint.load(tmp_path / "checkpoints" / "last.pt")
    assert saved["counters"]["frames"] == read_metrics(tmp_path / "metrics.csv")[-1]["frames"] > 0


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_saves_and_ends_cleanly(tmp_path, number, code):
    (tmp_path / "script.py").write_text(textwrap.dedent(SCRIPT))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen([sys.executable, "script.py"], cwd=tmp_path, env=environment, start_new_session=True)
    metrics = tmp_path / "out" / "metrics.csv"
    try:
        deadline = time.monotonic() + 60
        while len(read_metrics(metrics)) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
        os.killpg(process.pid, number)  # as a terminal and a job scheduler do: the workers hear it too
        assert process.wait(30) == code
    finally:
        process.kill()
    assert checkpoint.load(tmp_path / "out" / "checkpoints" / "last.pt")["counters"]["frames"] >= 256
    assert gone(process.pid)


def gone(group, patience=5.0):
    """Whether no process of the group is left, after the moment that multiprocessing's own tracker takes to notice."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False

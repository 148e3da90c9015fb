"""The training loop: collect, update, evaluate and report, until all frames are used or a signal asks to stop."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase

from trainers.algorithms.algorithm import DivergedError
from trainers.algorithms.build import build_algorithm
from trainers.config import Plan, cores, frames_per_batch
from trainers.models.policy import Policy
from trainers.reports.plots import learning_curve
from trainers.rollout.collection import MakeEnv, Rollouts, derive_seed
from trainers.rollout.episode_statistics import EpisodeStatistics
from trainers.rollout.evaluation import EvalResult, Interrupted, evaluate
from trainers.rollout.video import record_video
from trainers.run import checkpoint
from trainers.run.metrics import EVALUATION_NAMES, MetricsWriter
from trainers.run.progress import Progress
from trainers.run.signals import StopSignal
from trainers.utils.atomic_io import atomic_path
from trainers.utils.checked_files import write_checked_json

TIMINGS = ("time/collect", "time/update", "time/evaluate", "time/total", "time/frames_per_s")
SCENE_SEEDS = 2**30  # added to an iteration: index of the seed of its drawn scenes


class TrainingRun:
    """One training run: the state that the steps of `fit` share.

    counters: plain numbers that a resumed run continues from.
    """

    def __init__(
        self,
        plan: Plan,
        make_env: MakeEnv,
        folder: Path,
        config: dict[str, Any],
        vocabulary: list[str],
        make_eval_env: MakeEnv | None = None,
    ) -> None:
        self.plan, self.make_env, self.folder = plan, make_env, folder
        self.config, self.vocabulary = config, vocabulary
        self.counters: dict[str, Any] = {
            "frames": 0,
            "iteration": 0,
            "evaluations": 0,
            "best": -1.0,
            "seconds": 0.0,
        }
        self.start_time, self.earlier_seconds = time.perf_counter(), 0.0
        torch.manual_seed(plan.run.seed)
        eval_seed = derive_seed(plan.run.seed, 0, evaluation=True)
        self.eval_env = (make_eval_env or make_env)(plan.eval.worlds, eval_seed)
        self.policy, self.algorithm = build_algorithm(
            plan, self.eval_env.observation_spec, self.eval_env.action_unit, vocabulary, self.eval_env.hindsight
        )
        self.widths = checkpoint.widths(self.eval_env.observation_spec, self.eval_env.action_spec)
        self.statistics = EpisodeStatistics(self.eval_env.reward_names)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of metrics.csv."""
        evaluation = (f"eval/{name}" for name in EVALUATION_NAMES)
        return ("frames", *self.statistics.metrics, *self.algorithm.metrics, *evaluation, *TIMINGS)

    def resume(self, path: Path) -> None:
        """Continue from a checkpoint. The worlds start new episodes.

        Raises:
            CheckpointError: the checkpoint is damaged, or was trained with another config.
        """
        state = checkpoint.load(path, to_train=True)
        checkpoint.check_fits(state, self.vocabulary, self.widths)
        try:
            self.algorithm.load_state_dict(state["algorithm"])
        except (KeyError, RuntimeError, ValueError) as error:
            text = str(error).splitlines()[-1].strip()
            raise checkpoint.CheckpointError(f"{path} was trained with another algo or policy: {text}") from None
        self.counters |= state["counters"]
        self.earlier_seconds = self.counters["seconds"]
        torch.set_rng_state(state["rng"])

    def seconds(self) -> float:
        """Seconds of the run, including start-up and the time before a resume."""
        return self.earlier_seconds + time.perf_counter() - self.start_time

    def save(self, name: str) -> Path:
        """Write checkpoints/<name>.pt and return its path."""
        path = self.folder / "checkpoints" / f"{name}.pt"
        payload = {
            "config": self.config,
            "vocabulary": list(self.vocabulary),
            "widths": self.widths,
            "algorithm": self.algorithm.state_dict(),
            "counters": dict(self.counters),
            "rng": torch.get_rng_state(),
        }
        checkpoint.save(path, payload)
        return path

    def train(self, metrics: MetricsWriter, stop: StopSignal, progress: Progress) -> None:
        """Collect and update as many whole batches as total_frames holds, but at least one.

        Raises:
            Interrupted: a signal asked to stop; raised between two updates.
            DivergedError: a value is not finite.
            CollectionError: a worker process is lost.
        """
        seed = derive_seed(self.plan.run.seed, self.counters["iteration"])
        rollouts = Rollouts(self.make_env, self.policy, self.plan.collector, self.plan.algo.horizon, seed)
        with closing(rollouts):
            while not self.frames_exhausted():
                row = self.iterate(rollouts, stop)
                metrics.write(row)
                progress.show(row)
                if stop():
                    raise Interrupted

    def iterate(self, rollouts: Rollouts, stop: StopSignal) -> dict[str, float]:
        """One batch, one update, and an evaluation if one is due. Returns the row of metrics.csv."""
        start = time.perf_counter()
        rollouts.sync(self.policy)
        batch = rollouts.next()
        collected = time.perf_counter()
        torch.set_num_threads(self.plan.run.update_threads or cores())  # the workers are idle during the update
        progress = self.counters["frames"] / self.plan.run.total_frames
        self.add_drawn_scenes()
        update_metrics = self.algorithm.update(batch, min(progress, 1.0))
        updated = time.perf_counter()
        torch.set_num_threads(1)
        self.counters["frames"] += batch.numel()
        self.counters["iteration"] += 1
        row = {"frames": self.counters["frames"], **self.statistics.measure(batch), **update_metrics}
        with suppress(Interrupted):  # write the row of the finished update first; `train` stops after that
            row |= self.evaluate_if_due(stop)
        evaluated = time.perf_counter()
        self.counters["seconds"] = self.seconds()
        times = (collected - start, updated - collected, evaluated - updated, self.counters["seconds"])
        return row | dict(zip(TIMINGS, (*times, batch.numel() / (updated - start)), strict=True))

    def add_drawn_scenes(self) -> None:
        """Give the algorithm generated, unsimulated scenes to learn grounding from; they use no frames."""
        if self.algorithm.scenes_per_update:
            seed = derive_seed(self.plan.run.seed, SCENE_SEEDS + self.counters["iteration"])
            self.algorithm.add_scenes(self.eval_env.draw_scenes(self.algorithm.scenes_per_update, seed))

    def frames_exhausted(self) -> bool:
        """Whether another batch would exceed total_frames."""
        frames = self.counters["frames"]
        return frames > 0 and frames + frames_per_batch(self.plan) > self.plan.run.total_frames

    def evaluate_if_due(self, stop: StopSignal) -> dict[str, float]:
        """Evaluate once every eval.interval frames and after the last batch.

        Saves the checkpoint "last", and "best" if no earlier evaluation had a higher success.

        Returns:
            The evaluation's columns of metrics.csv; {} if no evaluation is due.
        """
        frames, interval = self.counters["frames"], self.plan.eval.interval
        same_interval = frames // interval == (frames - frames_per_batch(self.plan)) // interval
        if same_interval and not self.frames_exhausted():
            return {}
        self.counters["evaluations"] += 1
        result = self.evaluate(self.plan.eval.interval_episodes, self.counters["evaluations"], stop)
        if result.success_at_end >= self.counters["best"]:  # of equal results the later one
            self.counters["best"] = result.success_at_end
            self.save("best")
        self.save("last")
        return {f"eval/{name}": getattr(result, name) for name in EVALUATION_NAMES}

    def evaluate(self, episodes: int, index: int, stop: StopSignal) -> EvalResult:
        """Evaluate the deterministic policy on episodes that neither training nor another `index` uses."""
        seed = derive_seed(self.plan.run.seed, index, evaluation=True)
        return evaluate(self.eval_env, _on_cpu(self.policy), episodes, seed, stop)

    def finish(self, stop: StopSignal, make_video_env: Callable[[], EnvBase] | None) -> dict[str, Any]:
        """Evaluate the last policy on eval.episodes episodes; write eval.json, the learning curve and the video.

        Returns:
            The values of eval.json.
        """
        result = self.evaluate(self.plan.eval.episodes, 0, stop).as_dict()
        frames, seconds = self.counters["frames"], self.seconds()
        result |= {"frames": frames, "wall_s": seconds, "frames_per_s": frames / max(seconds, 1e-9)}
        result["seed"] = self.plan.run.seed
        write_checked_json(self.folder / "eval.json", result)
        learning_curve(self.folder / "metrics.csv", self.folder / "learning_curve.png")
        if make_video_env is not None and self.plan.eval.video_episodes:
            with closing(make_video_env()) as env, atomic_path(self.folder / "evaluation.mp4") as video:
                record_video(env, _on_cpu(self.policy), video, self.plan.eval.video_episodes)
        return result


def fit(
    plan: Plan,
    make_env: MakeEnv,
    folder: Path,
    config: dict[str, Any],
    vocabulary: list[str],
    resume: Path | None = None,
    make_video_env: Callable[[], EnvBase] | None = None,
    progress: bool = True,
    make_eval_env: MakeEnv | None = None,
) -> dict[str, Any]:
    """Train a policy and write its report.

    Args:
        plan: the validated parameters.
        make_env: `make_env(worlds, seed)` builds the environment; picklable, also called in worker processes.
        folder: of the run; created if missing.
        config: the composed config as plain values, saved in checkpoints.
        vocabulary: the tokenizer's words.
        resume: a checkpoint file to continue from.
        make_video_env: builds an environment of one world that renders. None for no video.
        progress: whether to show progress on the terminal.
        make_eval_env: like `make_env`, for evaluations; by default `make_env`.

    Returns:
        The values of eval.json.

    Raises:
        SystemExit: after SIGINT or SIGTERM, with status 128 + signal; "last" is saved and the workers have ended.
        DivergedError: a loss, reward or observation is not finite; the batch is saved.
        CollectionError: a worker process is lost.
        CheckpointError: the checkpoint cannot be resumed or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run = TrainingRun(plan, make_env, folder, config, vocabulary, make_eval_env)
    with closing(run.eval_env):
        if resume is not None:
            run.resume(resume)
        done = run.counters["frames"]
        metrics = MetricsWriter(folder, run.columns, plan.run.logger, done if resume else None)
        with closing(metrics), StopSignal() as stop, Progress(plan.run.total_frames, done, progress) as shown:
            try:
                run.train(metrics, stop, shown)
                return run.finish(stop, make_video_env)
            except Exception as error:
                _save_after_error(run, error, stop)
                raise


def _save_after_error(run: TrainingRun, error: Exception, stop: StopSignal) -> None:
    """Save the batch of a diverged run, or "last" of a stopped run, and raise an error that says so."""
    if isinstance(error, DivergedError):
        path = run.folder / "diverged.pt"
        torch.save(error.batch.detach().clone().to_dict(), path)
        raise DivergedError(f"{error}; the batch is saved in {path}", error.batch) from error
    if stop():  # a worker killed by the same signal raises CollectionError
        run.save("last")
        raise SystemExit(128 + stop.signal) from None


def _on_cpu(policy: Policy) -> TensorDictModuleBase:
    """The policy as it acts in the worlds, which are on the CPU; a copy if it learns on another device."""
    return policy.act if next(policy.parameters()).device.type == "cpu" else copy.deepcopy(policy).cpu().act

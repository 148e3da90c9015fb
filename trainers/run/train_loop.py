"""collect ─► update ─► evaluate ─► report, until the frames are spent or somebody asks to stop."""

from __future__ import annotations

import copy
import signal
import time
from collections.abc import Callable
from contextlib import suppress
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
from trainers.rollout.collection import Episodes, MakeEnv, Rollouts, derive_seed
from trainers.rollout.evaluation import EvalResult, Interrupted, evaluate
from trainers.rollout.video import record
from trainers.run import checkpoint
from trainers.run.metrics import EVALUATION_NAMES, MetricsWriter
from trainers.run.progress import Progress
from trainers.utils.atomic_io import write_json

TIMINGS = ("time/collect", "time/update", "time/evaluate", "time/total", "time/frames_per_s")


class Stop:
    """Turns SIGINT and SIGTERM into a question that the loop asks where it can answer. A context manager."""

    def __init__(self) -> None:
        self.signal = 0

    def __enter__(self) -> Stop:
        self.former = {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self.former.items():
            signal.signal(number, handler)

    def __call__(self) -> bool:
        return bool(self.signal)

    def _note(self, number: int, _frame: object) -> None:
        self.signal = number


class Run:
    """One training run. `fit` is the way in; this holds what its steps share.

    counters: plain numbers that a resumed run goes on from.
    """

    def __init__(
        self,
        plan: Plan,
        make_env: MakeEnv,
        folder: Path,
        config: dict[str, Any],
        vocabulary: list[str],
        make_judge: MakeEnv | None = None,
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
        self.began, self.before = time.perf_counter(), 0.0
        torch.manual_seed(plan.run.seed)
        self.judge = (make_judge or make_env)(plan.eval.worlds, derive_seed(plan.run.seed, 0, evaluation=True))
        self.policy, self.algorithm = build_algorithm(
            plan, self.judge.observation_spec, self.judge.action_unit, vocabulary, self.judge.hindsight
        )
        self.widths = checkpoint.widths(self.judge.observation_spec, self.judge.action_spec)
        self.episodes = Episodes(self.judge.reward_names)

    def resume(self, path: Path) -> None:
        """Go on from the checkpoint. The worlds begin new episodes. Raises CheckpointError."""
        state = checkpoint.load(path, to_train=True)
        checkpoint.check_fits(state, self.vocabulary, self.widths)
        try:
            self.algorithm.load_state_dict(state["algorithm"])
        except (KeyError, RuntimeError, ValueError) as error:
            text = str(error).splitlines()[-1].strip()
            raise checkpoint.CheckpointError(f"{path} was trained with another algo or policy: {text}") from None
        self.counters |= state["counters"]
        self.before = self.counters["seconds"]
        torch.set_rng_state(state["rng"])

    def seconds(self) -> float:
        """How long the run has taken, start-up and what came before a resume included."""
        return self.before + time.perf_counter() - self.began

    def save(self, name: str) -> Path:
        """Write checkpoints/<name>.pt."""
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

    def train(self, metrics: MetricsWriter, stop: Stop, progress: Progress) -> None:
        """As many whole batches as total_frames holds, but one at least.

        Raises Interrupted between two updates, DivergedError, CollectionError.
        """
        seed = derive_seed(self.plan.run.seed, self.counters["iteration"])
        rollouts = Rollouts(self.make_env, self.policy, self.plan.collector, self.plan.algo.horizon, seed)
        try:
            while not self.spent():
                row = self.iterate(rollouts, stop)
                metrics.write(row)
                progress.show(row)
                if stop():
                    raise Interrupted
        finally:
            rollouts.close()

    def iterate(self, rollouts: Rollouts, stop: Stop) -> dict[str, float]:
        """One batch, one update, and an evaluation where one is due. What was measured."""
        began = time.perf_counter()
        rollouts.sync(self.policy)
        batch = rollouts.next()
        collected = time.perf_counter()
        torch.set_num_threads(self.plan.run.update_threads or cores())  # the workers are idle now
        progress = self.counters["frames"] / self.plan.run.total_frames
        self.imagine()
        learned = self.algorithm.update(batch, min(progress, 1.0))
        updated = time.perf_counter()
        torch.set_num_threads(1)
        self.counters["frames"] += batch.numel()
        self.counters["iteration"] += 1
        row = {"frames": self.counters["frames"], **self.episodes.measure(batch), **learned}
        with suppress(Interrupted):  # the update is done, and has its row; who asked to stop still does
            row |= self.evaluate_if_due(stop)
        ended = time.perf_counter()
        self.counters["seconds"] = self.seconds()
        times = (collected - began, updated - collected, ended - updated, self.counters["seconds"])
        return row | dict(zip(TIMINGS, (*times, batch.numel() / (updated - began)), strict=True))

    def imagine(self) -> None:
        """Give the algorithm what it wants to read beside what the workers met: none of it costs a frame."""
        if self.algorithm.wants_scenes:
            seed = derive_seed(self.plan.run.seed, 2**30 + self.counters["iteration"])
            self.algorithm.study(self.judge.draw_scenes(self.algorithm.wants_scenes, seed))

    def spent(self) -> bool:
        """Whether no batch is left that would stay within total_frames."""
        frames = self.counters["frames"]
        return frames > 0 and frames + frames_per_batch(self.plan) > self.plan.run.total_frames

    def evaluate_if_due(self, stop: Stop) -> dict[str, float]:
        """Judge the deterministic policy once an interval, and keep it as "best" if it is; save "last" either way."""
        frames, interval = self.counters["frames"], self.plan.eval.interval
        if frames // interval == (frames - frames_per_batch(self.plan)) // interval and not self.spent():
            return {}
        self.counters["evaluations"] += 1
        result = self.evaluate(self.plan.eval.interval_episodes, self.counters["evaluations"], stop)
        if result.success_at_end >= self.counters["best"]:  # of equals the later one
            self.counters["best"] = result.success_at_end
            self.save("best")
        self.save("last")
        return {f"eval/{name}": getattr(result, name) for name in EVALUATION_NAMES}

    def evaluate(self, episodes: int, index: int, stop: Stop) -> EvalResult:
        """Episodes of evaluation `index`: none of them is ever trained on, or seen by another evaluation."""
        seed = derive_seed(self.plan.run.seed, index, evaluation=True)
        return evaluate(self.judge, _on_cpu(self.policy), episodes, seed, stop)

    def finish(self, stop: Stop, make_video_env: Callable[[], EnvBase] | None) -> dict[str, Any]:
        """Judge the last policy over eval.episodes fresh episodes and leave eval.json, the curve and the film."""
        result = self.evaluate(self.plan.eval.episodes, 0, stop).as_dict()
        frames, seconds = self.counters["frames"], self.seconds()
        result |= {"frames": frames, "wall_s": seconds, "frames_per_s": frames / max(seconds, 1e-9)}
        result["seed"] = self.plan.run.seed
        write_json(self.folder / "eval.json", result)
        learning_curve(self.folder / "metrics.csv", self.folder / "learning_curve.png")
        if make_video_env is not None and self.plan.eval.video_episodes:
            film(
                make_video_env,
                _on_cpu(self.policy),
                self.folder / "evaluation.mp4",
                self.plan.eval.video_episodes,
            )
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
    make_judge: MakeEnv | None = None,
) -> dict[str, Any]:
    """Train by `plan`, leave the report in `folder`, return what eval.json holds.

    make_env(worlds, seed): picklable, called in worker processes too. config: the composed config as plain values,
    kept in checkpoints. vocabulary: the tokenizer's words. resume: a checkpoint file to go on from. make_video_env:
    builds an environment that renders. make_judge: what evaluations are done in, where not in the same worlds.

    Raises SystemExit (128 + signal) after SIGINT and SIGTERM, once `last` is saved and the workers are gone;
    DivergedError once the offending batch is saved; CollectionError for a worker lost; CheckpointError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run = Run(plan, make_env, folder, config, vocabulary, make_judge)
    try:
        if resume is not None:
            run.resume(resume)
        columns = (
            "frames",
            *run.episodes.metrics,
            *run.algorithm.metrics,
            *(f"eval/{n}" for n in EVALUATION_NAMES),
            *TIMINGS,
        )
        metrics = MetricsWriter(folder, columns, plan.run.logger, run.counters["frames"] if resume else None)
        with Stop() as stop, Progress(plan.run.total_frames, run.counters["frames"], progress) as shown:
            try:
                run.train(metrics, stop, shown)
                return run.finish(stop, make_video_env)
            except Exception as error:
                _leave(run, error, stop)
                raise
            finally:
                metrics.close()
    finally:
        run.judge.close()


def _leave(run: Run, error: Exception, stop: Stop) -> None:
    """Save what can be saved of a run that ends early, and name where it is."""
    if isinstance(error, DivergedError):
        path = run.folder / "diverged.pt"
        torch.save(error.batch.detach().clone().to_dict(), path)
        raise DivergedError(f"{error}; the batch is saved in {path}", error.batch) from error
    if stop():  # a worker killed by the same signal ends here too
        run.save("last")
        raise SystemExit(128 + stop.signal) from None


def film(make_video_env: Callable[[], EnvBase], policy: Any, path: Path, episodes: int) -> None:
    """Record episodes in an environment of their own."""
    env = make_video_env()
    try:
        record(env, policy, path, episodes)
    finally:
        env.close()


def _on_cpu(policy: Policy) -> TensorDictModuleBase:
    return policy.act if next(policy.parameters()).device.type == "cpu" else copy.deepcopy(policy).cpu().act

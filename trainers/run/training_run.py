"""One training run: its iterations, evaluations, running state and report."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import torch
from torchrl.envs import EnvBase

from trainers.algorithms.build import build_algorithm
from trainers.collector_config import cores
from trainers.config import Plan, frames_per_batch
from trainers.reports.plots import learning_curve
from trainers.rollout.collection import Rollouts
from trainers.rollout.collection import columns as collector_columns
from trainers.rollout.episode_statistics import EpisodeStatistics
from trainers.rollout.evaluation import EvalResult, Interrupted
from trainers.rollout.seeds import derive_seed
from trainers.rollout.video import record_video
from trainers.rollout.worker import MakeEnv
from trainers.run import checkpoint
from trainers.run.evaluator import Evaluator, on_cpu
from trainers.run.memories import MemoryFiles
from trainers.run.metrics import EVALUATION_NAMES, MetricsWriter
from trainers.run.progress import Progress
from trainers.run.saving import CheckpointWriter
from trainers.run.signals import StopSignal
from trainers.utils.atomic_io import atomic_path
from trainers.utils.checked_files import write_checked_json
from trainers.utils.lean_imports import import_compiler

TIMINGS = ("time/collect", "time/update", "time/evaluate", "time/total", "time/frames_per_s")
SCENE_SEEDS = 2**30  # added to an iteration: index of the seed of its drawn scenes


class TrainingRun:
    """One training run: the state that the steps of `fit` share.

    env: one world, for what is not simulated: specs, scenes and relabelling.
    counters: plain numbers that a resumed run continues from. row: of metrics.csv, for the latest iteration; {} before
    the first one. evaluated: whether the row is complete. consistent: whether no update is half done, so that the run
    can be saved.
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
        self.counters: dict[str, Any] = {"frames": 0, "iteration": 0, "evaluations": 0, "best": -1.0, "seconds": 0.0}
        self.start_time, self.earlier_seconds = time.perf_counter(), 0.0
        torch.manual_seed(plan.run.seed)
        self.evaluator = Evaluator(make_eval_env or make_env, plan.eval.worlds, plan.run.seed)
        self.env = self.evaluator.make_worlds(1)
        spec = self.env.observation_spec
        self.policy, self.algorithm = build_algorithm(plan, spec, self.env.action_unit, vocabulary, self.env.hindsight)
        self.widths = checkpoint.widths(spec, self.env.action_spec)
        self.statistics = EpisodeStatistics(self.env.reward_names)
        self.row: dict[str, float] = {}
        self.evaluated = self.consistent = True
        self.rollouts: Rollouts | None = None
        self.kept_frames: int | None = None  # of the last row of metrics.csv that a resumed run keeps
        self.resumed: dict[str, Any] = {}  # what the first batch after a resume depends on
        memories = MemoryFiles(folder / "checkpoints" / "memory", self.algorithm.memories)
        self.writer = CheckpointWriter(folder / "checkpoints", plan.checkpoint, memories)

    def close(self) -> None:
        """End the worlds of this process."""
        self.env.close()
        self.evaluator.close()

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of metrics.csv."""
        evaluation = (f"eval/{name}" for name in EVALUATION_NAMES)
        timings = (*TIMINGS, *collector_columns(self.plan.collector))
        return ("frames", *self.statistics.metrics, *self.algorithm.metrics, *evaluation, *timings)

    def resume(self, path: Path) -> None:
        """Continue from a checkpoint, bit for bit where it has the running state.

        Raises:
            CheckpointError: the checkpoint is damaged, or was trained with another config.
        """
        payload = checkpoint.load(path, to_train=True)
        checkpoint.check_fits(payload, self.vocabulary, self.widths)
        try:
            self.algorithm.load_state_dict(payload["algorithm"])
        except (KeyError, RuntimeError, ValueError) as error:
            text = str(error).splitlines()[-1].strip()
            raise checkpoint.CheckpointError(f"{path} was trained with another algo or policy: {text}") from None
        self.counters |= payload["counters"]
        self.earlier_seconds = self.counters["seconds"]
        self.resumed = {"rng": payload["rng"]}
        if "state" in payload:
            self.load_running_state(payload["state"])
        # The row of the checkpoint itself is written again: it may not have been, or without its evaluation.
        self.kept_frames = self.counters["frames"] - bool(self.row)

    def running_state(self) -> dict[str, Any]:
        """What the next iteration depends on beside networks, optimizers, counters and memories."""
        rollouts = self.resumed.get("rollouts") if self.rollouts is None else self.rollouts.state_dict()
        return {
            "row": dict(self.row),
            "evaluated": self.evaluated,
            "rollouts": rollouts,
            "statistics": self.statistics.state_dict(),
            "algorithm": self.algorithm.running_state(),
            "cuda_rng": torch.cuda.get_rng_state() if self.algorithm.device.type == "cuda" else None,
        }

    def load_running_state(self, state: dict[str, Any]) -> None:
        """Continue from `running_state` and the memory files. With other numbers of worlds, new episodes begin."""
        known = self.columns  # the checkpoint's collector may have had others
        self.row = {name: value for name, value in state["row"].items() if name in known}
        self.evaluated = state["evaluated"]
        self.writer.memories.load(state["memories"])
        rollouts = state["rollouts"]
        if rollouts is not None and len(rollouts["episodes"]["beginnings"]) == self.plan.collector.worlds:
            self.resumed["rollouts"] = rollouts
            self.statistics.load_state_dict(state["statistics"])
            self.algorithm.load_running_state(state["algorithm"])
        if state["cuda_rng"] is not None and self.algorithm.device.type == "cuda":
            torch.cuda.set_rng_state(state["cuda_rng"])

    def seconds(self) -> float:
        """Seconds of the run, including start-up and the time before a resume."""
        return self.earlier_seconds + time.perf_counter() - self.start_time

    def payload(self) -> dict[str, Any]:
        """What every checkpoint holds."""
        return {
            "config": self.config,
            "vocabulary": list(self.vocabulary),
            "widths": self.widths,
            "algorithm": self.algorithm.state_dict(),
            "counters": dict(self.counters),
            "rng": self.resumed.get("rng", torch.get_rng_state()),
        }

    def save_last(self) -> None:
        """Write checkpoints/last.pt, from which the run can go on bit for bit."""
        self.writer.save_last(self.payload(), self.running_state())

    def train(self, metrics: MetricsWriter, stop: StopSignal, progress: Progress) -> None:
        """Collect and update until total_frames are used.

        Raises:
            Interrupted: a signal asked to stop.
            DivergedError: a value is not finite.
            CollectionError: workers are lost.
        """
        if self.row:  # of a resumed run
            self.complete_row(metrics, stop)
        first, state = self.counters["iteration"], self.resumed.get("rollouts")
        seed = derive_seed(self.plan.run.seed, first)
        behaviour, horizon = self.algorithm.behaviour, self.plan.algo.horizon
        steps = self._frames_left(self.plan.schedule_frames) // self.plan.collector.worlds
        self.rollouts = Rollouts(self.make_env, behaviour, self.plan.collector, horizon, seed, first, state, steps)
        with closing(self.rollouts):
            import_compiler()  # while the workers build their worlds
            if self.resumed:
                torch.set_rng_state(self.resumed.pop("rng"))  # after the worlds were built, as it was saved
            while not self.frames_exhausted():
                self.iterate(self.rollouts, stop)
                self.complete_row(metrics, stop)
                progress.show(self.row, self.rollouts.status())
                if stop():
                    raise Interrupted
        if self.plan.schedule_frames > self.plan.run.total_frames:
            self.save_last()  # the schedule can go on from here

    def iterate(self, rollouts: Rollouts, stop: StopSignal) -> None:
        """One batch and one update; sets `row`, which is not complete if an evaluation is due."""
        start = time.perf_counter()
        rollouts.sync(self.algorithm.behaviour)
        batch = rollouts.next(stop)
        collected = time.perf_counter()
        self.consistent = False
        torch.set_num_threads(self.plan.run.update_threads or cores())  # the workers are idle during the update
        progress = self.counters["frames"] / self.plan.schedule_frames
        self.add_drawn_scenes()
        update_metrics = self.algorithm.update(batch, min(progress, 1.0))
        updated = time.perf_counter()
        torch.set_num_threads(1)
        self.counters["frames"] += batch.numel()
        self.counters["iteration"] += 1
        self.row = {"frames": self.counters["frames"], **self.statistics.measure(batch), **update_metrics}
        times = (collected - start, updated - collected, 0.0, 0.0, batch.numel() / (updated - start))
        self.row |= dict(zip(TIMINGS, times, strict=True)) | rollouts.measures()
        self.evaluated, self.consistent = False, True

    def complete_row(self, metrics: MetricsWriter, stop: StopSignal) -> None:
        """Evaluate if it is due, save a checkpoint if one is, and write the row.

        Raises:
            Interrupted: a signal asked to stop the evaluation. The row is written without it; a resumed run
                evaluates first and writes the row again.
        """
        start = time.perf_counter()
        try:
            result = self.evaluate_if_due(stop) if not self.evaluated else None
        except Interrupted:
            metrics.write(self.row)
            raise
        if not self.evaluated:
            self.counters["seconds"] = self.seconds()
            self.row |= {"time/evaluate": time.perf_counter() - start, "time/total": self.counters["seconds"]}
            self.evaluated = True
        if result is not None and result.success_at_end >= self.counters["best"]:  # of equal results the later one
            self.counters["best"] = result.success_at_end
            self.writer.save_best(self.payload())
        if result is not None or self.writer.due():
            self.save_last()
        metrics.write(self.row)

    def add_drawn_scenes(self) -> None:
        """Give the algorithm generated, unsimulated scenes to learn grounding from; they use no frames."""
        if self.algorithm.scenes_per_update:
            seed = derive_seed(self.plan.run.seed, SCENE_SEEDS + self.counters["iteration"])
            self.algorithm.add_scenes(self.env.draw_scenes(self.algorithm.scenes_per_update, seed))

    def frames_exhausted(self) -> bool:
        """Whether another batch would exceed total_frames. The last one of the schedule is shortened to fit."""
        batch = min(frames_per_batch(self.plan), self._frames_left(self.plan.schedule_frames))
        return not 0 < batch <= self._frames_left(self.plan.run.total_frames)

    def _frames_left(self, most: int) -> int:
        """Frames of whole steps of all worlds, until there are as many as `most`."""
        worlds = self.plan.collector.worlds
        return max(0, most - self.counters["frames"]) // worlds * worlds

    def evaluate_if_due(self, stop: StopSignal) -> EvalResult | None:
        """Evaluate once every eval.interval frames and after the last batch of the schedule, and fill in the row."""
        frames, interval = self.counters["frames"], self.plan.eval.interval
        same_interval = frames // interval == (frames - frames_per_batch(self.plan)) // interval
        if same_interval and self._frames_left(self.plan.schedule_frames):
            return None
        index = self.counters["evaluations"] + 1
        result = self.evaluator.evaluate(self.policy, self.plan.eval.interval_episodes, index, stop)
        self.counters["evaluations"] = index
        values = {name: getattr(result, name) for name in EVALUATION_NAMES}
        self.row |= {f"eval/{name}": math.nan if value is None else value for name, value in values.items()}
        return result

    def finish(
        self,
        stop: StopSignal,
        make_video_env: Callable[[], EnvBase] | None,
        on_result: Callable[[dict[str, Any]], None] | None = None,
    ) -> dict[str, Any]:
        """Evaluate the last policy on eval.episodes episodes; write eval.json, the learning curve and the video.

        Args:
            stop: a signal asked to stop.
            make_video_env: builds an environment of one world that renders. None for no video.
            on_result: given the result before anything is written, so that a full disk does not lose it.

        Returns:
            The values of eval.json.
        """
        result = self.evaluator.evaluate(self.policy, self.plan.eval.episodes, 0, stop).as_dict()
        frames, seconds = self.counters["frames"], self.seconds()
        result |= {"frames": frames, "wall_s": seconds, "frames_per_s": frames / max(seconds, 1e-9)}
        result["seed"] = self.plan.run.seed
        if on_result is not None:
            on_result(result)
        write_checked_json(self.folder / "eval.json", result)
        learning_curve(self.folder / "metrics.csv", self.folder / "learning_curve.png")
        if make_video_env is not None and self.plan.eval.video_episodes:
            with closing(make_video_env()) as env, atomic_path(self.folder / "evaluation.mp4") as video:
                record_video(env, on_cpu(self.policy), video, self.plan.eval.video_episodes)
        return result

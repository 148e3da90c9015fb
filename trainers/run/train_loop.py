"""The training loop: collect a batch, update the networks, evaluate now and then, and write the report at the end.

`fit` runs it. `TrainingRun.train` repeats `TrainingRun.iterate`, one iteration, and `TrainingRun.complete_rows`, which
takes the results of evaluations.
"""

from __future__ import annotations

import copy
import math
import shlex
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, cast

import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase

from core.errors import Interrupted
from core.platform_tuning import import_compiler
from core.stored_config import places_of
from core.system import StopSignal, cores
from trainers.algorithms.algorithm import DivergedError, build_algorithm
from trainers.collect.rollouts import CollectionError, EpisodeStatistics, Rollouts, collector_columns
from trainers.collect.worker import MakeEnv, derive_seed
from trainers.config import TrainingConfig, frames_per_batch, uses_processes
from trainers.environment import readers_of
from trainers.evaluation.evaluation import EvalResult
from trainers.run import checkpoint
from trainers.run.checkpoint import start_from
from trainers.run.evaluator import Evaluator, VideoTask
from trainers.run.metrics import EVALUATION_NAMES, MetricsWriter
from trainers.run.progress import Progress
from trainers.run.requirements import check_sizes
from trainers.run.saving import CheckpointWriter, MemoryFiles
from trainers.utils.files import WriteError, write_checked_json

# evaluation_wait: seconds spent waiting for evaluations. evaluated: seconds of the run until the row's evaluation was
# known.
TIMINGS = ("time/collect", "time/update", "time/evaluation_wait", "time/evaluated", "time/total", "time/frames_per_s")
MOST_PENDING = 2  # evaluations: with fewer, training waits for those of early policies, whose episodes are long
SCENE_SEEDS = 2**30  # added to an iteration: index of the seed of its drawn scenes


def fit(
    training: TrainingConfig,
    make_env: MakeEnv,
    folder: Path,
    config: dict[str, Any],
    vocabulary: list[str],
    resume: Path | None = None,
    init: Path | None = None,
    make_video_env: Callable[[], EnvBase] | None = None,
    progress: Progress | None = None,
    make_eval_env: MakeEnv | None = None,
    on_result: Callable[[dict[str, Any]], None] | None = None,
) -> dict[str, Any]:
    """Train a policy and write its report.

    Args:
        training: the validated parameters.
        make_env: `make_env(worlds, seed)` builds the environment; picklable, also called in worker processes.
        folder: of the run; created if missing.
        config: the composed config as plain values, saved in checkpoints.
        vocabulary: the tokenizer's words.
        resume: a checkpoint file to continue from.
        init: a checkpoint file whose policy a new run begins with.
        make_video_env: builds an environment of one world that renders. None for no video.
        progress: where the rows of metrics.csv are shown; None: nowhere.
        make_eval_env: like `make_env`, for evaluations; by default `make_env`.
        on_result: given the values of eval.json before any file of the report is written.

    Returns:
        The values of eval.json.

    Raises:
        SystemExit: after a signal, with status 128 + signal; "last" is saved and the workers have ended.
        DivergedError: a loss, reward or observation is not finite; the batch is saved.
        CollectionError: more worker processes were lost than collector.restarts; "last" is saved.
        CheckpointError: a checkpoint cannot be resumed, begun with or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    run = TrainingRun(training, make_env, folder, config=config, vocabulary=vocabulary, make_eval_env=make_eval_env)
    with closing(run), progress or Progress(training.run.total_frames, shown=False) as shown:
        _begin(run, shown, resume, init)
        metrics = MetricsWriter(folder, run.columns, training.run.logger, run.kept_frames, run.kept_rows)
        with closing(metrics), StopSignal() as stop:
            try:
                run.train(metrics, stop, shown)
                return write_report(run, metrics, stop, shown, make_video_env, on_result)
            except Exception as error:
                _write_waiting_rows(run, metrics)
                _save_after_error(run, error, stop)
                raise


class TrainingRun:
    """One training run: the state that the steps of `fit` share.

    Args:
        training: its settings.
        make_env: builds the environment of collection.
        folder: of the run.
        config: the composed config as plain values, saved in checkpoints.
        vocabulary: the tokenizer's words.
        make_eval_env: builds the environment of evaluations; None for `make_env`.

    Attributes:
        env: one world, for specs, drawn scenes and relabelling.
        counters: plain numbers that a resumed run continues from.
        rows: of metrics.csv, those of the latest iterations that are not written yet.
        pending: the checkpoints to evaluate for these rows, the oldest of which is being evaluated.
        consistent: whether no update is half done, so that the run can be saved.
    """

    def __init__(
        self,
        training: TrainingConfig,
        make_env: MakeEnv,
        folder: Path,
        *,
        config: dict[str, Any],
        vocabulary: list[str],
        make_eval_env: MakeEnv | None = None,
    ) -> None:
        self.training, self.make_env, self.folder = training, make_env, folder
        self.budget, self.update_threads = FrameBudget(training), training.run.update_threads or cores()
        self.config, self.vocabulary = config, vocabulary
        self.counters: dict[str, Any] = {"frames": 0, "iteration": 0, "evaluations": 0, "best": -1.0, "seconds": 0.0}
        self.start_time, self.earlier_seconds = time.perf_counter(), 0.0
        torch.manual_seed(training.run.seed)
        make_eval_env = make_eval_env or make_env
        self.env = make_eval_env(1, derive_seed(training.run.seed, 0, evaluation=True))
        spec, relabel = self.env.observation_spec, self.env.hindsight
        self.policy, self.algorithm = build_algorithm(
            training, spec, self.env.action_unit, vocabulary, relabel, readers_of(self.env)
        )
        beside = training.eval.overlap and uses_processes(training.collector)
        self.evaluator = Evaluator(
            make_eval_env, self.policy, worlds=training.eval.worlds, seed=training.run.seed, beside=beside
        )
        self.widths = checkpoint.widths(spec, self.env.action_spec)
        self.statistics = EpisodeStatistics(self.env.reward_names)
        self.rows: list[dict[str, float]] = []
        self.pending: list[dict[str, Any]] = []
        self.consistent = True
        self.rollouts: Rollouts | None = None
        self.kept_frames: int | None = None  # of the last row of metrics.csv that a resumed run keeps
        self.kept_rows = 0  # how many rows it keeps: one for each iteration before
        self.resumed: dict[str, Any] = {}  # what the first batch after a resume depends on
        memories = MemoryFiles(folder / "checkpoints" / "memory", self.algorithm.memories)
        self.writer = CheckpointWriter(folder / "checkpoints", training.checkpoint, memories)

        step = cast(EnvBase, self.env).fake_tensordict()
        check_sizes(training, folder, step, self.payload(), self.algorithm.memories)

    def close(self) -> None:
        """End the worlds of this process."""
        self.env.close()
        self.evaluator.close()

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of metrics.csv."""
        evaluation = (f"eval/{name}" for name in EVALUATION_NAMES)
        timings = (*TIMINGS, *collector_columns(self.training.collector))
        return ("frames", *self.statistics.metrics, *self.algorithm.metrics, *evaluation, *timings)

    def resume(self, path: Path) -> None:
        """Continue from a checkpoint, bit for bit where it has the running state.

        Raises:
            CheckpointError: the checkpoint is damaged, of an earlier version, or was trained with another config.
        """
        payload = checkpoint.load(path, to_train=True, given=None)
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
        # Rows that the checkpoint holds are written again: they may have been written without their evaluation.
        self.kept_frames = int(self.rows[0]["frames"]) - 1 if self.rows else self.counters["frames"]
        self.kept_rows = self.counters["iteration"] - len(self.rows)

    def running_state(self) -> dict[str, Any]:
        """Return the state on which the next iteration depends beside networks, optimizers, counters and memories."""
        rollouts = self.resumed.get("rollouts") if self.rollouts is None else self.rollouts.state_dict()
        return {
            "rows": [dict(row) for row in self.rows],
            "pending": self.pending,
            "rollouts": rollouts,
            "statistics": self.statistics.state_dict(),
            "algorithm": self.algorithm.running_state(),
            "cuda_rng": torch.cuda.get_rng_state() if self.algorithm.device.type == "cuda" else None,
        }

    def load_running_state(self, state: dict[str, Any]) -> None:
        """Continue from `running_state` and the memory files. With other numbers of worlds, new episodes begin."""
        known = self.columns  # the checkpoint's collector may have had others
        self.rows = [{name: value for name, value in row.items() if name in known} for row in state["rows"]]
        self.pending = state["pending"]
        self.writer.memories.load(state["memories"])
        rollouts = state["rollouts"]
        if rollouts is not None and len(rollouts["episodes"]["beginnings"]) == self.training.collector.worlds:
            self.resumed["rollouts"] = rollouts
            self.statistics.load_state_dict(state["statistics"])
            self.algorithm.load_running_state(state["algorithm"])
        if state["cuda_rng"] is not None and self.algorithm.device.type == "cuda":
            torch.cuda.set_rng_state(state["cuda_rng"])

    def seconds(self) -> float:
        """Return seconds of the run, including start-up and the time before a resume."""
        return self.earlier_seconds + time.perf_counter() - self.start_time

    def payload(self) -> dict[str, Any]:
        """Return the content of every checkpoint."""
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

        Raises Interrupted: a signal asked to stop. Other exceptions are those of `fit`.
        """
        if self.pending:  # of a resumed run
            self.request_evaluation()
        if self.rows:
            self.complete_rows(metrics, stop, progress)
        progress.say(f"building {self.training.collector.worlds} worlds")
        first, state = self.counters["iteration"], self.resumed.get("rollouts")
        seed = derive_seed(self.training.run.seed, first)
        behaviour, horizon = self.algorithm.behaviour, self.training.algo.horizon
        steps = self.budget.left_of_schedule(self.counters["frames"]) // self.training.collector.worlds
        self.rollouts = Rollouts(
            self.make_env,
            behaviour,
            self.training.collector,
            horizon=horizon,
            seed=seed,
            iteration=first,
            state=state,
            steps=steps,
        )
        with closing(self.rollouts):
            import_compiler()  # while the workers build their worlds
            if self.resumed:
                torch.set_rng_state(self.resumed.pop("rng"))  # after the worlds were built, as it was saved
            if self.training.collector.name == "ray" and not self.counters["iteration"]:
                self.save_last()  # Ray can end this process at any time
            while not self.budget.exhausted(self.counters["frames"]):
                self.iterate(self.rollouts, stop)
                progress.show(self.rows[-1], self.rollouts.status())
                self.complete_rows(metrics, stop, progress)
                if stop():
                    raise Interrupted
        if self.pending:
            self.complete_rows(metrics, stop, progress, wait=True)
        self.save_last()

    def iterate(self, rollouts: Rollouts, stop: StopSignal) -> None:
        """One batch and one update; adds a row, which is not complete if an evaluation is due."""
        start = time.perf_counter()
        rollouts.sync(self.algorithm.behaviour)
        batch = rollouts.next(stop)
        collected = time.perf_counter()
        self.consistent = False
        torch.set_num_threads(self.update_threads)  # the workers are idle during the update
        progress = self.counters["frames"] / self.budget.schedule
        self.add_drawn_scenes()
        update_metrics = self.algorithm.update(batch, min(progress, 1.0))
        updated = time.perf_counter()
        torch.set_num_threads(1)
        self.counters["frames"] += batch.numel()
        self.counters["iteration"] += 1
        self.counters["seconds"] = self.seconds()
        row = {"frames": self.counters["frames"], **self.statistics.measure(batch), **update_metrics}
        row |= {"time/collect": collected - start, "time/update": updated - collected, "time/evaluation_wait": 0.0}
        row |= {"time/frames_per_s": batch.numel() / (updated - start), "time/total": self.counters["seconds"]}
        self.rows.append(row | rollouts.measures())
        self.consistent = True

    def complete_rows(self, metrics: MetricsWriter, stop: StopSignal, progress: Progress, wait: bool = False) -> None:
        """Request an evaluation if one is due, take the results of those that are done, and write the complete rows.

        wait: for all results. Otherwise the oldest is waited for when more than `MOST_PENDING` are pending.

        Raises Interrupted: a signal asked to stop.
        """
        start = time.perf_counter()
        if self.evaluation_due():
            self.counters["evaluations"] += 1
            self.pending.append(copy.deepcopy(self.payload()))
            if len(self.pending) == 1:
                self.request_evaluation()
        taken = self.take_evaluations(0 if wait else MOST_PENDING, stop, progress)
        self.counters["seconds"] = self.seconds()
        self.rows[-1]["time/evaluation_wait"] += time.perf_counter() - start
        self.rows[-1]["time/total"] = self.counters["seconds"]
        if taken or self.writer.due():
            self.save_last()
        last = self.counters["frames"] if self.schedule_ended() else math.inf  # which waits for the final evaluation
        waiting = min([last, *(payload["counters"]["frames"] for payload in self.pending)])
        self.write_rows(metrics, sum(row["frames"] < waiting for row in self.rows))

    def write_rows(self, metrics: MetricsWriter, count: int) -> None:
        """Write the first `count` rows, which are complete."""
        for row in self.rows[:count]:
            metrics.write(row)
        del self.rows[:count]

    def add_drawn_scenes(self) -> None:
        """Give the algorithm generated, unsimulated scenes to learn grounding from; they use no frames."""
        if self.algorithm.scenes_per_update:
            seed = derive_seed(self.training.run.seed, SCENE_SEEDS + self.counters["iteration"])
            self.algorithm.add_scenes(self.env.draw_scenes(self.algorithm.scenes_per_update, seed))

    def schedule_ended(self) -> bool:
        """Return whether all frames of the schedule are used. The last row then waits for the final evaluation."""
        return not self.budget.left_of_schedule(self.counters["frames"])

    def evaluation_due(self) -> bool:
        """Return whether to request the evaluation of the last row."""
        frames = self.counters["frames"]
        requested = any(payload["counters"]["frames"] == frames for payload in self.pending)  # in a resumed run
        known = "time/evaluated" in self.rows[-1]
        return self.budget.evaluation_due(frames) and not requested and not known

    def request_evaluation(self) -> None:
        """Ask for the evaluation of the oldest pending checkpoint's policy."""
        weights, index = self.pending[0]["algorithm"]["policy"], self.pending[0]["counters"]["evaluations"]
        self.evaluator.request(weights, self.training.eval.interval_episodes, index)

    def take_evaluations(self, most: int, stop: StopSignal, progress: Progress) -> bool:
        """Put the evaluations that are done into their rows, and wait until at most `most` are pending.

        Returns whether any was done. Raises Interrupted.
        """
        before = len(self.pending)
        while self.pending and (result := self.evaluator.result(len(self.pending) > most, stop)) is not None:
            payload = self.pending.pop(0)
            self.enter_evaluation(result, payload["counters"]["frames"], progress)
            self.save_if_best(result, payload)
            if self.pending:
                self.request_evaluation()
        return len(self.pending) < before

    def enter_evaluation(self, result: EvalResult, frames: int, progress: Progress) -> None:
        """Put an evaluation into the row of these frames, and show it."""
        row = next(row for row in self.rows if row["frames"] == frames)
        values = {name: getattr(result, name) for name in EVALUATION_NAMES}
        row |= {f"eval/{name}": math.nan if value is None else value for name, value in values.items()}
        row["time/evaluated"] = self.seconds()
        progress.show_evaluation(row)

    def save_if_best(self, result: EvalResult, payload: dict[str, Any]) -> None:
        """Write best.pt unless an earlier evaluation was better. payload: of the policy that was evaluated."""
        if result.success_at_end >= self.counters["best"]:
            self.counters["best"] = payload["counters"]["best"] = result.success_at_end
            self.writer.save_best(payload)

    def finish(self, result: EvalResult, metrics: MetricsWriter) -> None:
        """Save what the final evaluation, which was entered, completes: the last row of the schedule."""
        self.save_if_best(result, self.payload())
        self.write_rows(metrics, len(self.rows))
        self.save_last()


class FrameBudget:
    """The frames of a run: until its end, which may be early, and until the end of its schedule.

    All worlds step together, so only multiples of their number are used.
    """

    def __init__(self, training: TrainingConfig) -> None:
        self.total, self.schedule = training.run.total_frames, training.schedule_frames
        self.worlds, self.batch = training.collector.worlds, frames_per_batch(training)
        self.interval = training.eval.interval

    def left_of_schedule(self, frames: int) -> int:
        """Return frames of whole steps of all worlds until the end of the schedule. frames: used so far."""
        return self._left(self.schedule, frames)

    def exhausted(self, frames: int) -> bool:
        """Return whether another batch would exceed total_frames. The last one of the schedule is shortened to fit."""
        batch = min(self.batch, self.left_of_schedule(frames))
        return not 0 < batch <= self._left(self.total, frames)

    def evaluation_due(self, frames: int) -> bool:
        """Return whether to evaluate now: once every eval.interval frames, but not just before the final evaluation."""
        before = frames - self.batch
        return frames // self.interval > before // self.interval and self.left_of_schedule(frames) > 0

    def _left(self, most: int, frames: int) -> int:
        return max(0, most - frames) // self.worlds * self.worlds


def write_report(
    run: TrainingRun,
    metrics: MetricsWriter,
    stop: StopSignal,
    progress: Progress,
    make_video_env: Callable[[], EnvBase] | None,
    on_result: Callable[[dict[str, Any]], None] | None = None,
) -> dict[str, Any]:
    """Evaluate the last policy on eval.episodes episodes, and write the report into the run's folder.

    This evaluation is also that of the last row of a schedule that has ended.

    Args:
        run: that has ended.
        metrics: where the last row is written.
        stop: a signal asked to stop.
        progress: where the evaluation is shown.
        make_video_env: builds an environment of one world that renders. None for no video.
        on_result: given the result before anything is written, so that a full disk does not lose it.

    Returns:
        The values of eval.json.
    """
    from trainers.reports.plots import learning_curve  # matplotlib is slow to import

    config, video = run.training.eval, None
    if make_video_env is not None and config.video_episodes:
        video = VideoTask(make_video_env, run.folder / "evaluation.mp4", config.video_episodes)
        run.evaluator.request_video(run.policy.state_dict(), video)
    evaluation = run.evaluator.evaluate(run.policy, config.episodes, 0, stop)
    frames, seconds = run.counters["frames"], run.seconds()
    result = evaluation.as_dict() | {"frames": frames, "wall_s": seconds, "frames_per_s": frames / max(seconds, 1e-9)}
    result["seed"] = run.training.run.seed
    if run.rows:
        run.enter_evaluation(evaluation, frames, progress)
    if on_result is not None:
        on_result(result)
    if run.rows:
        run.finish(evaluation, metrics)
    write_checked_json(run.folder / "eval.json", result)
    learning_curve(run.folder / "metrics.csv", run.folder / "learning_curve.png", run.config, config)
    if video is not None:
        run.evaluator.finish_video()
    return result


def _begin(run: TrainingRun, shown: Progress, resume: Path | None, init: Path | None) -> None:
    if resume is not None:
        run.resume(resume)
        shown.resume(run.counters["frames"])
    elif init is not None:
        start_from(init, run.policy, run.vocabulary, run.widths)


def _write_waiting_rows(run: TrainingRun, metrics: MetricsWriter) -> None:
    """Write the rows that wait for an evaluation without it. A resumed run writes them again."""
    with suppress(WriteError):  # the error that ends the run is the one to report
        for row in run.rows:
            metrics.write(row)


def _save_after_error(run: TrainingRun, error: Exception, stop: StopSignal) -> None:
    """Save the values that are not finite, and "last" if no update is half done. Raises SystemExit after a signal."""
    if isinstance(error, DivergedError):
        path = _save_diverged(run.folder, error.batch)
        raise DivergedError(f"{error}; the batch is saved in {path}", error.batch) from error
    if stop() and run.consistent:
        run.save_last()
    elif run.consistent and run.counters["iteration"]:
        with suppress(Exception):  # the first error is the one to report
            run.save_last()
            if isinstance(error, CollectionError):
                error.args = (f"{error}; the run is saved, and goes on with: {resume_command(run)}",)
    if stop():
        with suppress(OSError):  # a terminal that is gone
            print(_last_line(run), flush=True)
        raise SystemExit(128 + stop.signal) from None
    frame = getattr(error.__cause__ or error.__context__, "frame", None)
    if isinstance(error, CollectionError) and frame is not None:
        path = _save_diverged(run.folder, frame)
        error.args = (f"{error}; what the step was given is saved in {path}",)


def resume_command(run: TrainingRun) -> str:
    """Return the shell command that goes on with the run from its last checkpoint."""
    if not run.config:  # of a program of the user's, with an environment of its own
        return "the same command"
    return shlex.join(["python", "train.py", f"resume={run.folder}", *places_of(run.config)])


def _last_line(run: TrainingRun) -> str:
    """Return what is saved of a run that a signal stopped."""
    last = run.folder / "checkpoints" / "last.pt"
    if not last.is_file():
        return "stopped before the first checkpoint: nothing is saved"
    saved = f"{run.counters['frames']} frames are" if run.consistent else "the frames up to the last checkpoint are"
    return f"stopped: {saved} saved in {last}; go on with: {resume_command(run)}"


def _save_diverged(folder: Path, frames: TensorDictBase) -> Path:
    path = folder / "diverged.pt"
    torch.save(frames.detach().clone().to_dict(), path)
    return path

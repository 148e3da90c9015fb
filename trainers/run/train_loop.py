"""The training loop: collect, update, evaluate and report, until all frames are used or a signal asks to stop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase

from trainers.algorithms.algorithm import DivergedError
from trainers.config import Plan
from trainers.rollout.worker import MakeEnv
from trainers.rollout.worker_pool import CollectionError
from trainers.run.final_report import write_report
from trainers.run.initial_policy import start_from
from trainers.run.metrics import MetricsWriter
from trainers.run.progress import Progress
from trainers.run.signals import StopSignal
from trainers.run.training_run import TrainingRun
from trainers.utils.atomic_io import WriteError


def fit(
    plan: Plan,
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
        plan: the validated parameters.
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
    run = TrainingRun(plan, make_env, folder, config, vocabulary, make_eval_env)
    with closing(run), progress or Progress(plan.run.total_frames, shown=False) as shown:
        _begin(run, shown, resume, init)
        metrics = MetricsWriter(folder, run.columns, plan.run.logger, run.kept_frames)
        with closing(metrics), StopSignal() as stop:
            try:
                run.train(metrics, stop, shown)
                return write_report(run, metrics, stop, shown, make_video_env, on_result)
            except Exception as error:
                _write_waiting_rows(run, metrics)
                _save_after_error(run, error, stop)
                raise


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
                error.args = (f"{error}; the run is saved, and resume={run.folder} goes on",)
    if stop():
        raise SystemExit(128 + stop.signal) from None
    frame = getattr(error.__cause__ or error.__context__, "frame", None)
    if isinstance(error, CollectionError) and frame is not None:
        path = _save_diverged(run.folder, frame)
        error.args = (f"{error}; what the step was given is saved in {path}",)


def _save_diverged(folder: Path, frames: TensorDictBase) -> Path:
    path = folder / "diverged.pt"
    torch.save(frames.detach().clone().to_dict(), path)
    return path

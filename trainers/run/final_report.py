"""The report at the end of a run: eval.json, the learning curve and a video."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from torchrl.envs import EnvBase

from trainers.reports.plots import learning_curve
from trainers.run.evaluation_process import VideoTask
from trainers.run.metrics import MetricsWriter
from trainers.run.progress import Progress
from trainers.run.signals import StopSignal
from trainers.run.training_run import TrainingRun
from trainers.utils.checked_files import write_checked_json


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
    config, video = run.plan.eval, None
    if make_video_env is not None and config.video_episodes:
        video = VideoTask(make_video_env, run.folder / "evaluation.mp4", config.video_episodes)
        run.evaluator.request_video(run.policy.state_dict(), video)
    evaluation = run.evaluator.evaluate(run.policy, config.episodes, 0, stop)
    frames, seconds = run.counters["frames"], run.seconds()
    result = evaluation.as_dict() | {"frames": frames, "wall_s": seconds, "frames_per_s": frames / max(seconds, 1e-9)}
    result["seed"] = run.plan.run.seed
    if run.rows:
        run.enter_evaluation(evaluation, frames, progress)
    if on_result is not None:
        on_result(result)
    if run.rows:
        run.finish(evaluation, metrics)
    write_checked_json(run.folder / "eval.json", result)
    learning_curve(run.folder / "metrics.csv", run.folder / "learning_curve.png")
    if video is not None:
        run.evaluator.finish_video()
    return result

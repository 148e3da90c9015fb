"""python train.py -m as a person uses it: interrupted, resumed, with jobs that fail. Tiny real runs."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import pytest

import train
from tests.helpers.processes import left_over, start_train
from tools.forked import call
from trainers.run import checkpoint
from trainers.run.metrics import read_metrics

pytestmark = pytest.mark.slow
ROOT = Path(train.__file__).parent
EVAL_INTERVAL = 256  # frames
TINY = [
    "task=reach",
    "task.max_steps=8",
    "collector.worlds=4",
    "algo.horizon=16",
    "algo.minibatch=16",
    f"eval.interval={EVAL_INTERVAL}",
    "eval.episodes=4",
    "eval.interval_episodes=2",
    "eval.worlds=2",
    "eval.video_episodes=0",
    "logger=[]",
]
LONG = "1000000"


def start(*arguments: str) -> subprocess.Popen:
    return start_train(*arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def wait_for(condition, process, seconds=240):
    deadline = time.monotonic() + seconds
    while not condition() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    assert condition(), process.communicate(timeout=5)[0] if process.poll() is not None else "still waiting"


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A sweep in which one job failed and one finished beside the first, until Ctrl-C came."""
    folder = tmp_path_factory.mktemp("with space, [and more]") / "sweep"
    process = start("-m", f"total_frames={LONG},0,128", *TINY, f"hydra.sweep.dir={folder}")
    try:
        half_way = [("0_*", "checkpoints/last.pt"), ("1_*", "error.txt"), ("2_*", "eval.json")]
        wait_for(lambda: all(list(folder.glob(f"{job}/{name}")) for job, name in half_way), process)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: every process hears it
        said, _ = process.communicate(timeout=60)
        left = left_over(process.pid, 15)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    return folder, process.returncode, said, left


def measured(row: dict[str, float]) -> dict[str, float]:
    """The values of a row of metrics.csv, without the timings."""
    return {name: value for name, value in row.items() if not name.startswith("time/") and not math.isnan(value)}


def job(folder: Path, number: int) -> Path:
    return next(folder.glob(f"{number}_*"))


def test_folders_of_a_sweep_are_named_by_their_options(stopped):
    folder, *_ = stopped
    assert job(folder, 0).name == "0_kuka-step-reach-ppo-s0"


def test_ctrl_c_saves_every_job_ends_all_processes_and_prints_how_to_resume(stopped):
    folder, code, said, left = stopped
    assert code == 130, said
    assert left == []
    assert "Traceback" not in said
    assert f"python train.py -m 'sweep.resume={folder}'" in said
    assert not (job(folder, 0) / "error.txt").exists()
    saved = checkpoint.load(job(folder, 0) / "checkpoints" / "last.pt")
    assert saved["counters"]["frames"] == read_metrics(job(folder, 0) / "metrics.csv")[-1]["frames"]


def test_jobs_run_two_at_a_time_and_one_that_fails_leaves_its_error(stopped):
    folder, _, said, _ = stopped
    assert (job(folder, 1) / "error.txt").read_text() == "total_frames=0 is out of range: it must be in [1, 1e+12]\n"
    assert json.loads((job(folder, 2) / "eval.json").read_text())["frames"] == 128
    assert "failed: total_frames=0 is out of range" in said


def test_jobs_print_a_line_at_each_evaluation_with_their_name_before_it(stopped):
    _, _, said, _ = stopped
    assert "[2_kuka-step-reach-ppo-s0] 128 of 128 frames" in said
    assert "\r" not in said


def test_a_resumed_sweep_runs_only_missing_jobs(stopped):
    folder, *_ = stopped
    halted, finished = job(folder, 0), job(folder, 2)
    untouched = [path.stat().st_mtime_ns for path in (finished / "eval.json", finished / "checkpoints" / "last.pt")]
    before = read_metrics(halted / "metrics.csv")
    shorten(halted, int(before[-1]["frames"]) + 256)
    process = start("-m", f"sweep.resume={folder}")
    said, _ = process.communicate(timeout=240)
    assert process.returncode == 1, said  # job 1 fails again
    after = read_metrics(halted / "metrics.csv")
    # An evaluation that Ctrl-C interrupts is made again, and completes the last row.
    interrupted = before[-1]["frames"] % EVAL_INTERVAL == 0 and math.isnan(before[-1]["eval/success_at_end"])
    whole = len(before) - interrupted
    assert str(after[:whole]) == str(before[:whole])
    assert measured(before[-1]).items() <= measured(after[len(before) - 1]).items()
    assert after[-1]["frames"] == before[-1]["frames"] + 256
    assert json.loads((halted / "eval.json").read_text())["frames"] == after[-1]["frames"]
    paths = (finished / "eval.json", finished / "checkpoints" / "last.pt")
    assert [path.stat().st_mtime_ns for path in paths] == untouched
    table = [line for line in said.splitlines() if line.startswith("total_frames=")]
    assert [line.split()[0] for line in table] == [f"total_frames={frames}" for frames in (LONG, 0, 128)]
    assert "failed: total_frames=0 is out of range" in table[1]
    assert {"report.html", "report.md", "success.png"} <= {path.name for path in folder.iterdir()}
    assert len(list(folder.glob("*/job.json"))) == 3


def shorten(run: Path, frames: int) -> None:
    """Make a checkpoint one of a run that has almost come to its end."""
    import torch

    path = run / "checkpoints" / "last.pt"
    saved = torch.load(path, weights_only=True)
    saved["config"]["total_frames"] = frames
    torch.save(saved, path)


@pytest.mark.parametrize("jobs", [1, 3])
def test_ctrl_c_saves_a_job_that_is_alone(jobs, tmp_path):
    """A worker of joblib that has no job must not end: joblib kills all the others then."""
    folder = tmp_path / "sweep"
    process = start("-m", f"total_frames={LONG}", f"sweep.jobs={jobs}", *TINY, f"hydra.sweep.dir={folder}")
    wait_for(lambda: list(folder.glob("0_*/checkpoints/last.pt")), process)
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert f"sweep.resume={folder}" in said
    assert not list(job(folder, 0).glob("error.txt"))
    assert {file.name for file in folder.iterdir() if file.is_file()} <= {"sweep.yaml", "multirun.yaml", ".lock"}


def test_ctrl_c_at_the_start_of_a_sweep_begins_no_job(tmp_path):
    folder = tmp_path / "sweep"
    process = start("-m", f"total_frames={LONG}", "seed=0,1", *TINY, f"hydra.sweep.dir={folder}")
    assert process.stdout.readline() == f"sweep in {folder}\n"
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "Traceback" not in said
    assert not list(folder.glob("*/checkpoints"))


def test_jobs_end_when_the_sweep_is_killed(tmp_path):
    process = start("-m", "seed=0,1", f"total_frames={LONG}", *TINY, f"hydra.sweep.dir={tmp_path}")
    try:
        wait_for(lambda: len(list(tmp_path.glob("*/job.json"))) == 2, process)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
        assert left_over(process.pid, 15) == []
    finally:
        for _ in left_over(process.pid, 15):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-m", "sweep.resume=/nowhere"], "sweep.resume=/nowhere is not the directory of a sweep"),
        (["-m", "seed=0,1", "sweep.jobs=0"], "sweep.jobs=0 is out of range"),
        (["-m", "seed=0,1", "resume=outputs/there"], "a sweep is resumed with sweep.resume=<sweep dir>"),
        (["-m", "scenario=1,6"], "scenario=6 is not known"),
    ],
)
def test_a_sweep_that_cannot_start_is_refused_in_one_line(words, message, tmp_path):
    done = call(partial(train.cli, [*words, f"hydra.sweep.dir={tmp_path}/sweep"]), ROOT)
    assert done.code == 1
    (line,) = (done.out + done.err).splitlines()
    assert message in line
    assert not (tmp_path / "sweep").exists()

"""The jobs of a sweep as tasks of Ray, with a program that does what its seed says in the place of train.py."""

from __future__ import annotations

import pytest

from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.ray_cases import left_over
from trainers.cluster import ray_sweep
from trainers.cluster.ray_sweep import NodeJob, RaySweep, pack, run_jobs, unpack
from trainers.config import SweepConfig

PROGRAM = """
import os, signal, sys, time
from pathlib import Path
words = dict(word.split("=", 1) for word in sys.argv[1:])
place = Path(words["hydra.run.dir"])
starts = Path(__file__).with_name("starts-" + words["seed"])
with open(starts, "a") as file:
    file.write("started ")
if words["seed"] == "1" and starts.read_text().count("started") == 1:
    os.kill(os.getppid(), signal.SIGKILL)  # as if the node died: the program must end with it
    time.sleep(60)
if words["seed"] == "2":
    sys.exit("error: seed=2 is never right")
(place / "checkpoints").mkdir(exist_ok=True)
(place / "eval.json").write_text(words["collector.workers"])
with open(starts, "a") as file:
    file.write("ended ")
"""


def jobs_of(folder, seeds):
    (folder / "program.py").write_text(PROGRAM)
    config = compose(["sweep.retries=1"])
    return [
        NodeJob(config, [f"seed={seed}"], folder / "sweep" / f"{seed}_x", share=1, program=folder / "program.py")
        for seed in seeds
    ]


@pytest.mark.slow
def test_lost_and_failed_jobs_are_started_again_and_stop_no_other_job(ray, tmp_path, capsys):
    jobs = jobs_of(tmp_path, (0, 1, 2))
    RaySweep(ray, SweepConfig(resume=None, jobs=2, cpus=1, gpus=0, retries=1)).run(jobs)
    starts = [(tmp_path / f"starts-{seed}").read_text().split() for seed in (0, 1, 2)]
    assert starts == [["started", "ended"], ["started", "started", "ended"], ["started", "started"]]
    assert [(job.place / "eval.json").exists() for job in jobs] == [True, True, False]
    assert (jobs[0].place / "eval.json").read_text() == "1"  # its share of the cores
    assert (jobs[2].place / "error.txt").read_text() == "seed=2 is never right\n"
    told = capsys.readouterr().out
    assert "[1_x] the job was lost: " in told
    assert "; it is started again (1 of at most 1 times)" in told
    assert "[2_x] failed: seed=2 is never right" in told
    assert left_over(str(tmp_path / "program.py")) == []


@pytest.mark.slow
def test_the_results_of_a_node_that_does_not_see_the_folder_come_back(ray, tmp_path, monkeypatch):
    monkeypatch.setattr(ray_sweep, "TOKEN", ".elsewhere")
    (job,) = jobs_of(tmp_path, (0,))
    RaySweep(ray, SweepConfig(resume=None, jobs=2, cpus=1, gpus=0, retries=0)).run([job])
    assert (job.place / "eval.json").read_text() == "1"


@pytest.mark.slow
def test_a_job_that_fits_no_node_is_told_at_once(ray, tmp_path):
    (job,) = jobs_of(tmp_path, (0,))
    job.config.sweep.cpus = 3
    with pytest.raises(ConfigError, match=r"sweep\.cpus=3 is more than any node of the Ray cluster has: 2"):
        run_jobs(None, [job])
    assert not (tmp_path / "starts-0").exists()


def test_a_folder_is_packed_without_links_and_locks(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    (one / "checkpoints").mkdir(parents=True)
    (one / "checkpoints" / "last.pt").write_bytes(b"weights")
    (one / ".lock").touch()
    (one / "link").symlink_to("/etc/passwd")
    other.mkdir()
    unpack(pack(one), other)
    assert [path.relative_to(other).as_posix() for path in other.rglob("*")] == ["checkpoints", "checkpoints/last.pt"]
    assert (other / "checkpoints" / "last.pt").read_bytes() == b"weights"

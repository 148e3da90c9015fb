"""One job of a sweep: its folder, its cores and its error message."""

from __future__ import annotations

import json

import pytest

from trainers.sweeps.job import core_share, failure_message, find_job_folder, with_advice

TRACEBACK = "Traceback (most recent call last):\n  x\nKeyError: 'a'"


def test_a_job_is_identified_by_its_overrides_not_by_its_number(tmp_path):
    for name, overrides in (("0_a", ["seed=0"]), ("1_a", ["seed=1", "robot=kuka"])):
        (tmp_path / name).mkdir()
        (tmp_path / name / "job.json").write_text(json.dumps({"overrides": overrides}))
    assert find_job_folder(tmp_path / "7_a", ["robot=kuka", "seed=1"]) == tmp_path / "1_a"
    assert find_job_folder(tmp_path / "7_a", ["seed=2"]) == tmp_path / "7_a"
    assert find_job_folder(tmp_path / "1_a", ["seed=2"]) == tmp_path / "1_a-2"


@pytest.mark.slow
@pytest.mark.parametrize(("cores", "jobs", "workers"), [(2, 2, 1), (2, 1, 2), (8, 2, 4), (1, 2, 1), (6, 2, 2)])
def test_a_job_uses_its_share_of_the_cores(cores, jobs, workers, monkeypatch):
    from core.overrides import compose

    monkeypatch.setattr("trainers.config.cores", lambda: cores)
    monkeypatch.setattr("trainers.sweeps.job.cores", lambda: cores)
    assert core_share(compose([f"sweep.jobs={jobs}"])) == [f"collector.workers={workers}"]
    assert core_share(compose([f"sweep.jobs={jobs}", "collector.workers=4"])) == []
    given = ["collector.workers=4", "update_threads=0"]
    assert core_share(compose([f"sweep.jobs={jobs}", *given])) == [f"update_threads={max(1, cores // jobs)}"]


@pytest.mark.parametrize(
    ("code", "errors", "text"),
    [
        (1, "a warning\nerror: algo.lr=-1 is out of range\n", "algo.lr=-1 is out of range"),
        (1, f"a warning\n{TRACEBACK}\n", TRACEBACK),
        (-9, "", "the process was ended by SIGKILL"),
        (-11, "free(): invalid pointer\n", "free(): invalid pointer\nthe process was ended by SIGSEGV"),
        (3, "", "the process ended with exit status 3"),
    ],
)
def test_a_failure_message_is_the_error_line_or_else_the_whole_output(code, errors, text):
    assert failure_message(code, errors) == text


def test_a_job_with_a_damaged_checkpoint_is_told_how_to_begin_anew(tmp_path):
    folder = tmp_path / "checkpoints"
    folder.mkdir()
    (folder / "last.pt").write_bytes(b"PK")
    message = f"{folder / 'last.pt'} is damaged: File is not a zip file"
    assert with_advice(message, tmp_path) == f"{message}; remove {folder}, and the job begins anew"
    assert with_advice("the disk is full", tmp_path) == "the disk is full"

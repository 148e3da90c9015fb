"""`python -m benchmarks.reproduce` over a few rows of a small project: runs, kills, checks and stale results."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from trainers.evaluation.evaluation import wilson

ROOT = Path(__file__).resolve().parents[2]
ROWS = """
root: ..
pages: [page.md]
matrices: [grid]
summary: results.json
kinds:
  printed: {steps: ["python task.py {words} {seed}"], read: printed}
  slow:
    steps: ["python task.py slow {seed} {folder}", "python task.py 0.5 {seed}"]
    resume: python task.py resumed {seed} {folder}
    resumable: "*.started"
    read: printed
rows:
  - {id: plain/good, label: good, kind: printed, words: "0.9", seeds: [0, 1], bar: 0.85, readme: well}
  - {id: plain/share, label: a share, of: plain/good, figure: right, total: tried}
  - {id: plain/slow, label: slow, kind: slow, seeds: [3]}
  - {id: "grid/{x}-{y}", kind: printed, words: "{x}", grid: {x: [0.1, 0.2], y: [left, right]}}
"""
TASK = """
import json, pathlib, sys, time
import helper
words = sys.argv[1:]
if words[0] in ("slow", "resumed"):
    pathlib.Path(words[2], "now.started").touch()
    print(words[0], flush=True)
    time.sleep(60 if words[0] == "slow" else 0)
else:
    success = helper.SHARE * float(words[0]) - 0.1 * int(words[1]) * (int(words[1]) == 1)
    print(json.dumps({"success_at_end": success, "ci95": [0.5, 1.0], "right": 30, "tried": 40}))
"""
PAGE = "# Page\n<!-- rows: plain -->\n<!-- end of rows -->\ntext\n<!-- rows: grid -->\n<!-- end of rows -->\n"


@pytest.fixture
def project(tmp_path):
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "benchmarks" / "rows.yaml").write_text(ROWS)
    (tmp_path / "task.py").write_text(TASK)
    (tmp_path / "helper.py").write_text("SHARE = 1.0\n")
    (tmp_path / "page.md").write_text(PAGE)
    return tmp_path


def command(project, *words):
    return [sys.executable, "-m", "benchmarks.reproduce", "--file", str(project / "benchmarks" / "rows.yaml"), *words]


def reproduce(project, *words, code=0):
    done = subprocess.run(command(project, *words), capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def stored(project, name):
    return json.loads((project / "benchmarks" / "results" / name).read_text())


def test_what_is_missing_is_run_once_and_written_into_the_page(project):
    assert "2 of 2 runs are missing" in reproduce(project, "--rows", "plain/good")
    before = stored(project, "plain/good/0.json")
    assert before["figures"] == {"success_at_end": 0.9, "ci95": [0.5, 1.0], "right": 30, "tried": 40}
    assert before["commands"] == ["python task.py 0.9 0"]
    assert {"commit", "date", "machine", "seconds", "code"} <= set(before)
    page = (project / "page.md").read_text()
    assert "| good | 0.800 (0.500-1.000), 0.900 | 0.85, missed |" in page
    low, high = wilson(30, 40)
    assert f"| a share | 0.750 ({low:.3f}-{high:.3f}), 0.750 |" in page
    assert "| slow | not run |" in page
    assert "| | left | right |\n|---|---|---|\n| 0.1 | - | - |" in page
    assert "0 of 2 runs are missing" in reproduce(project, "--rows", "plain/good")
    assert stored(project, "plain/good/0.json") == before
    assert not (project / "outputs" / "reproduce" / "plain" / "good" / "0").exists()


@pytest.mark.slow
def test_a_killed_run_goes_on_by_its_own_resume(project):
    process = subprocess.Popen(command(project, "--rows", "plain/slow"), cwd=ROOT, stdout=subprocess.DEVNULL)
    started = project / "outputs" / "reproduce" / "plain" / "slow" / "3" / "now.started"
    while not started.exists():
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (project / "benchmarks" / "results" / "plain" / "slow" / "3.json").exists()
    assert "plain/slow 3: 0.5" in reproduce(project, "--rows", "plain/slow")
    assert stored(project, "plain/slow/3.json")["seconds"] < 30


@pytest.mark.slow
def test_joblib_runs_several_at_a_time_with_the_same_result(project):
    reproduce(project, "--rows", "grid/*", "--launcher", "joblib", "--jobs", "2")
    assert [
        stored(project, f"grid/{name}/0.json")["figures"]["success_at_end"] for name in ("0.1-left", "0.2-right")
    ] == [
        0.1,
        0.2,
    ]
    assert "| 0.2 | 0.200 | 0.200 |" in (project / "page.md").read_text()


def test_the_check_fails_for_a_changed_figure(project):
    reproduce(project, "--rows", "plain/good", "--seeds", "0")
    reproduce(project, "--check")
    page = project / "page.md"
    page.write_text(page.read_text().replace("0.900 (0.500", "0.950 (0.500"))
    said = reproduce(project, "--check", code=1)
    assert "page.md, line 5: '| good | 0.950 (0.500-1.000)" in said
    assert "not what the store generates" in said
    reproduce(project, "--write")
    reproduce(project, "--check")
    (project / "benchmarks" / "results" / "plain" / "good" / "0.json").unlink()
    assert "page.md" in reproduce(project, "--check", code=1)


def test_a_changed_file_makes_a_result_stale_until_it_is_run_again(project):
    reproduce(project, "--rows", "plain/good", "--seeds", "0")
    assert reproduce(project, "--stale").strip() == ""
    (project / "helper.py").write_text("SHARE = 0.500\n")  # of another size: Python compiles it anew
    assert "plain/good 0: changed since unknown: helper.py" in reproduce(project, "--stale")
    reproduce(project, "--check")  # the marks are those of the last writing
    reproduce(project, "--write")
    assert "unknown †" in (project / "page.md").read_text()
    reproduce(project, "--rows", "plain/good", "--seeds", "0", "--again")
    assert stored(project, "plain/good/0.json")["figures"]["success_at_end"] == 0.45
    assert "†" not in (project / "page.md").read_text()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("kind: slow,", "kind: fast,", "rows.plain/slow.kind=fast is not a kind"),
        ("id: plain/slow", "id: plain/good", "has the row plain/good twice"),
        ("seeds: [3]", "seeds: []", "rows.plain/slow.seeds=[] must be 1 to 100 numbers"),
        ("bar: 0.85", "bra: 0.85", "rows.plain/good.bra is not a known key; did you mean 'bar'?"),
        ("of: plain/good", "of: plain/god", "rows.plain/share.of=plain/god is not a row above it"),
        ("root: ..", "roots: ..", "rows.yaml must have the keys root, pages"),
    ],
)
def test_a_bad_row_is_refused_with_one_sentence(project, old, new, sentence):
    rows = project / "benchmarks" / "rows.yaml"
    rows.write_text(rows.read_text().replace(old, new))
    said = reproduce(project, "--list", code=1)
    assert sentence in said
    assert len(said.splitlines()) == 1


def test_a_run_that_fails_or_exceeds_its_budget_has_no_result(project):
    rows = project / "benchmarks" / "rows.yaml"
    rows.write_text(
        rows.read_text().replace('words: "0.9"', "words: nine").replace("seeds: [3]", "seeds: [3], budget: 1")
    )
    said = reproduce(project, "--rows", "plain/*", code=1)
    assert "plain/good with seed 0: 'python task.py nine 0' ended with exit code 1: ValueError" in said
    assert "plain/slow with seed 3 took longer than its budget of 1 s" in said
    assert "3 runs have no result" in said
    assert not (project / "benchmarks" / "results" / "plain").exists()


def test_the_pages_show_what_the_store_has():
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.reproduce", "--check"], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr

"""`python -m benchmarks.reproduce` over a few rows of a small project: runs, kills, checks and stale results."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from trainers.evaluation.evaluation import wilson

ROOT = Path(__file__).resolve().parents[2]
ROWS = """
root: ..
pages: [page.md]
matrices: [grid, field]
compared: [field]
summary: results.json
kinds:
  printed: {steps: ["python task.py {words} {seed}"], read: printed, probe: ["python task.py {words} {seed} short"]}
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
  - {id: "field/{place}-{algo}", kind: printed, words: "{algo}", seeds: [0, 1],
     grid: {place: [near, far], algo: [a, b]}}
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
    print(json.dumps({"success_at_end": success, "ci95": [0.5, 1.0], "right": 30, "tried": 40, "seconds": time.time()}))
"""
PAGE = "# Page\n<!-- rows: plain -->\n<!-- end of rows -->\ntext\n<!-- rows: grid -->\n<!-- end of rows -->\n"
PAGE += "<!-- comparison: field -->\n<!-- end of rows -->\n"
LIBRARY = """
import numpy as np


def aggregate_iqm(scores):
    ordered = np.sort(scores, axis=None)
    return ordered[len(ordered) // 4 : len(ordered) - len(ordered) // 4].mean()


def get_interval_estimates(scores, func, reps):
    values = {name: func(*given) if isinstance(given, tuple) else func(given) for name, given in scores.items()}
    return values, {name: np.array([np.ravel(each) - 0.01, np.ravel(each) + 0.02]) for name, each in values.items()}
"""


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


def test_a_figure_that_no_run_has_is_not_reached(project):
    rows = project / "benchmarks" / "rows.yaml"
    other = "  - {id: plain/seconds, label: seconds to 0.95, of: plain/good, figure: seconds.to, interval: ''}\n"
    rows.write_text(ROWS.replace("  - {id: plain/slow", other + "  - {id: plain/slow"))
    reproduce(project, "--rows", "plain/good")
    page = (project / "page.md").read_text()
    assert "| seconds to 0.95 | not reached |" in page
    assert "| slow | not run |" in page


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


@pytest.fixture
def change(project):
    """Gives a function that changes a file of the project and commits it."""

    def commit(name, text):
        (project / name).write_text(text)
        identity = ["-c", "user.name=someone", "-c", "user.email=someone@example.org"]
        for words in (["add", "--all"], [*identity, "commit", "--quiet", "--message", name]):
            subprocess.run(["git", *words], cwd=project, check=True)

    subprocess.run(["git", "init", "--quiet"], cwd=project, check=True)
    commit(".gitignore", "outputs/\n__pycache__/\n")
    return commit


def same_bits(project, *words, code=0):
    rows = str(project / "benchmarks" / "rows.yaml")
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.same_bits", *words, "--file", rows], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_change_without_effect_keeps_the_results_of_all_runs_of_a_group(project, change):
    reproduce(project, "--rows", "plain/good")
    before = stored(project, "plain/good/1.json")
    change("helper.py", "SHARE = 1.0  # of the words\n")
    assert "plain/good 1: changed" in reproduce(project, "--stale")
    assert "plain/good 0, for 2 runs: the same 5 numbers" in same_bits(project, "HEAD~1")
    assert reproduce(project, "--stale").strip() == ""
    after = stored(project, "plain/good/1.json")
    assert {key: after[key] for key in ("figures", "commit", "seconds")} == {
        key: before[key] for key in ("figures", "commit", "seconds")
    }
    assert [note["compared"] for note in after["kept"]] == ["plain/good 0"]
    assert not list((project / ".git" / "worktrees").glob("*"))


@pytest.mark.slow
def test_no_worktree_is_left_by_a_comparison_that_is_stopped(project, change):
    reproduce(project, "--rows", "plain/good", "--seeds", "0")
    begun = project / "outputs" / "begun"
    change("helper.py", f"import pathlib, time\npathlib.Path({str(begun)!r}).touch()\ntime.sleep(60)\nSHARE = 1.0\n")
    words = [
        sys.executable,
        "-m",
        "benchmarks.same_bits",
        "HEAD~1",
        "--file",
        str(project / "benchmarks" / "rows.yaml"),
    ]
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        while not begun.exists() and process.poll() is None:
            time.sleep(0.05)
        assert len(list((project / ".git" / "worktrees").glob("*"))) == 2
        process.terminate()
        said, _ = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 128 + signal.SIGTERM, said
    assert "Traceback" not in said
    assert not list((project / ".git" / "worktrees").glob("*"))


@pytest.mark.slow
def test_a_change_with_an_effect_leaves_results_outdated(project, change):
    reproduce(project, "--rows", "plain/good")
    change("helper.py", "SHARE = 0.99999\n")
    said = same_bits(project, "HEAD~1", code=1)
    assert "plain/good 0, for 2 runs: differs in 1 of 5 numbers, first success_at_end 0.9 -> 0.89" in said
    assert "1 groups remain outdated" in said
    assert "plain/good 1: changed" in reproduce(project, "--stale")


def test_only_results_of_the_code_of_the_commit_are_compared(project, change):
    reproduce(project, "--rows", "plain/good", "--seeds", "0")
    change("helper.py", "SHARE = 0.5\n")
    change("helper.py", "SHARE = 0.50\n")
    assert "0 runs in 0 groups have changed since HEAD~1" in same_bits(project, "HEAD~1")
    assert "git has no tree of the commit nothing" in same_bits(project, "nothing", code=1)
    (project / "helper.py").write_text("SHARE = 0.25\n")
    assert "code differs from the last commit" in same_bits(project, "HEAD~1", code=1)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("kind: slow,", "kind: fast,", "rows.plain/slow.kind=fast is not a kind"),
        ("id: plain/slow", "id: plain/good", "has the row plain/good twice"),
        ("seeds: [3]", "seeds: []", "rows.plain/slow.seeds=[] must be 1 to 100 numbers"),
        ("bar: 0.85", "bra: 0.85", "rows.plain/good.bra is not a known key; did you mean 'bar'?"),
        ("of: plain/good", "of: plain/god", "rows.plain/share.of=plain/god is not a row above it"),
        ("root: ..", "roots: ..", "rows.yaml must have the keys root, pages"),
        ("compared: [field]", "compared: [plain]", "compared has plain, which must be a matrix"),
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


def store(project, name, *values):
    """Store a run of each seed as if it had been made."""
    folder = project / "benchmarks" / "results"
    (folder / "code").mkdir(parents=True, exist_ok=True)
    (folder / "code" / "none.txt").write_text("")
    (folder / name).mkdir(parents=True)
    about = {"commit": "abc", "date": "2026-01-01", "code": "none", "seconds": 1}
    for seed, value in enumerate(values):
        commands = [f"python task.py {name[-1]} {seed}"]
        result = about | {"commands": commands, "figures": {"success_at_end": value, "ci95": [0, 1]}}
        (folder / name / f"{seed}.json").write_text(json.dumps(result))


def library(folder, monkeypatch, content):
    """Put a module of this content in the place of rliable."""
    (folder / "rliable").mkdir(parents=True)
    for name in ("__init__", "library", "metrics"):
        (folder / "rliable" / f"{name}.py").write_text(content)
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)


def compared(project):
    """The cells of the page's comparison by the label of their line; its head under ""."""
    lines = (project / "page.md").read_text().partition("<!-- comparison: field -->\n")[2].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    return {"": rows[0], **{row[0]: row[1:] for row in rows[1:]}}


def test_columns_are_compared_on_lines_that_have_every_run(project, tmp_path, monkeypatch):
    library(tmp_path / "fake", monkeypatch, LIBRARY)
    reproduce(project, "--write")
    assert compared(project) == {"": ["0 of 2, 2 seeds"], "not run": []}
    store(project, "field/near-a", 0.75, 0.5)
    store(project, "field/near-b", 0.96, 0.75)
    store(project, "field/far-a", 0.25, 0.25)
    store(project, "field/far-b", 1.0)
    reproduce(project, "--write")
    found = compared(project)
    assert found[""] == ["1 of 2, 2 seeds", "a", "b"]
    assert found["interquartile mean (95 %)"] == ["0.625 (0.615-0.645)", "0.855 (0.845-0.875)"]
    assert found["runs above 0.5"][0] == "0.500 (0.490-0.520)"
    assert found["runs above 0.95"][1] == "0.500 (0.490-0.520)"
    assert found["better than a"] == ["", "0.875 (0.855-0.885)"]  # a tie counts half
    assert found["better than b"] == ["0.125 (0.115-0.145)", ""]


def test_columns_are_compared_by_the_seeds_that_all_rows_have(project, tmp_path, monkeypatch):
    library(tmp_path / "fake", monkeypatch, LIBRARY)
    rows = project / "benchmarks" / "rows.yaml"
    more = '  - {id: field/far-a, kind: printed, words: "a", seeds: [0, 1, 2]}\n'
    rows.write_text(ROWS.replace("place: [near, far]", "place: [near]") + more)
    store(project, "field/near-a", 0.75, 0.5)
    store(project, "field/near-b", 0.96, 0.75)
    rows.write_text(rows.read_text() + more.replace("-a", "-b").replace("[0, 1, 2]", "[0, 1]"))
    store(project, "field/far-a", 0.75, 0.5, 0.0)
    store(project, "field/far-b", 0.96, 0.75)
    reproduce(project, "--write")
    found = compared(project)
    assert found[""] == ["2 of 2, 2 seeds", "a", "b"]
    assert found["interquartile mean (95 %)"][0].startswith("0.625")


def test_a_comparison_is_computed_again_only_for_other_runs(project, tmp_path, monkeypatch):
    for name in ("near-a", "near-b"):
        store(project, f"field/{name}", 0.75, 0.5)
    with monkeypatch.context() as patched:
        library(tmp_path / "fake", patched, LIBRARY)
        reproduce(project, "--write")
    library(tmp_path / "none", monkeypatch, "raise ModuleNotFoundError('not here', name='rliable')")
    written = compared(project)
    reproduce(project, "--check")
    reproduce(project, "--write")
    assert compared(project) == written
    for name in ("far-a", "far-b"):
        store(project, f"field/{name}", 0.25, 1.0)
    said = reproduce(project, "--write", code=1)
    assert 'comparisons of algorithms need rliable, which is not installed: pip install -e ".[bench]"' in said
    assert len(said.splitlines()) == 1


@pytest.mark.slow
def test_the_comparison_is_that_of_rliable(project):
    metrics = pytest.importorskip("rliable.metrics")
    scores = {"a": np.array([[0.75, 0.9], [0.5, 0.96]]), "b": np.array([[0.75, 0.98], [0.9, 0.91]])}
    for column, values in scores.items():
        for line, runs in zip(("near", "far"), values.T, strict=True):
            store(project, f"field/{line}-{column}", *runs)
    reproduce(project, "--write")
    found = compared(project)
    means = [f"{metrics.aggregate_iqm(values):.3f}" for values in scores.values()]
    assert [cell.split()[0] for cell in found["interquartile mean (95 %)"]] == means
    better = metrics.probability_of_improvement(scores["b"], scores["a"])
    value, low, high = map(float, re.findall(r"[\d.]+", found["better than a"][1]))
    assert value == pytest.approx(better, abs=1e-3)
    assert 0 <= low < value < high <= 1
    before = compared(project)
    (project / "results.json").unlink()
    reproduce(project, "--write")
    assert compared(project) == before  # the resamples have a seed

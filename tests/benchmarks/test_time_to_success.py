"""`python -m benchmarks.time_to_success`: its tables, its refusals, and short runs of our learners."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import tools.peer_comparison  # noqa: F401
import trainers.run.metrics  # noqa: F401  # for the forks
from tests.helpers.programs import run_module

ROOT = Path(__file__).resolve().parents[2]
CURVES = {  # learner -> the curves of its seeds
    "ours-sac": [[[20.0, 400, 0.5], [40.0, 800, 0.96]], [[30.0, 400, 0.97]], [[24.0, 400, 0.9], [50.0, 800, 0.98]]],
    "sb3-sac": [[[90.0, 400, 0.92]], [[80.0, 400, 0.95]], [[70.0, 400, 0.94], [100.0, 900, 0.96]]],
    "sbx-ppo": [[], [[250.0, 90_000, 0.4]], []],
}


def time_to_success(*words, code=0):
    done = run_module("benchmarks.time_to_success", *words)
    assert done.code == code, done.err
    return done.out if code == 0 else done.err


def result(**changes):
    runs = [
        {"learner": learner, "seed": seed, "evaluations": curve, "seconds": 300.0, "busy": 0.9}
        for learner, curves in CURVES.items()
        for seed, curve in enumerate(curves)
    ]
    about = {"env": "PandaReach-v3", "budget": 300.0, "episodes": 200, "settings": {"sb3-sac": '{"batch_size": 256}'}}
    return about | {"runs": runs} | changes


def tables_of(tmp_path, content):
    path = tmp_path / "result.txt"
    path.write_text(f"| a table |\n{json.dumps(content)}\n")
    return time_to_success("--recorded", str(path)).splitlines()


def test_recorded_curves_give_when_each_rate_was_first_reached(tmp_path):
    lines = tables_of(tmp_path, result())
    assert "| ours-sac | 0 | 40 s (800) | 40 s (800) | not reached | 0.960 | 90% |" in lines
    assert "| ours-sac | 2 | 24 s (400) | 50 s (800) | 50 s (800) | 0.980 | 90% |" in lines
    assert "| sbx-ppo | 0 | not reached | not reached | not reached | - | 90% |" in lines
    assert '* sb3-sac: `{"batch_size": 256}`' in lines


def test_medians_count_what_is_not_reached_as_later_than_all(tmp_path):
    lines = tables_of(tmp_path, result())
    assert "| ours-sac | 30 s | 40 s | 50 s |" in lines
    assert "| sb3-sac | 80 s | 100 s | not reached |" in lines
    assert "| sbx-ppo | not reached | not reached | not reached |" in lines


def test_our_best_is_divided_by_the_peers_best_or_by_the_budget_where_none_reaches_the_rate(tmp_path):
    lines = tables_of(tmp_path, result())
    assert "| our best / the peers' best | 0.38 | 0.40 | <= 0.17 |" in lines


def test_without_one_side_there_is_no_ratio(tmp_path):
    for side in ("ours", "sb"):
        runs = [run for run in result()["runs"] if run["learner"].startswith(side)]
        assert "| our best / the peers' best | - | - | - |" in tables_of(tmp_path, result(runs=runs))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--seeds", "0;1"], "--seeds 0;1 must be numbers"),
        (["--env", "PandaReach"], "--env PandaReach is none of"),
        (["--env", "PandaReach-v3", "--learners", "ours-sacc"], "--learners ours-sacc is none of"),
        (["--env", "PandaReach-v3", "--budget", "0"], "must be greater than 0"),
        (["scenario"], "'scenario' is no override"),
        (["--recorded", "none.txt"], "none.txt cannot be read"),
        (["--recorded", "pyproject.toml"], "the last line of pyproject.toml is not what --json prints"),
    ],
)
def test_bad_input_is_refused_in_one_line(words, said):
    text = time_to_success(*words, code=1)
    assert said in text
    assert len(text.splitlines()) == 1


@pytest.mark.parametrize("package", ["stable_baselines3", "sbx", "panda_gym"])
def test_a_missing_package_is_named_with_what_installs_it(tmp_path, package):
    hidden = "".join(f"sys.modules[{package!r}] = None\n")
    others = [name for name in ("stable_baselines3", "sbx", "panda_gym") if name != package]
    found = f"for name in {others}: sys.modules.setdefault(name, importlib.util.module_from_spec(spec(name, None)))\n"
    head = "import importlib.util, sys\nfrom importlib.machinery import ModuleSpec as spec\n"
    (tmp_path / "sitecustomize.py").write_text(head + hidden + found)
    words = ["-m", "benchmarks.time_to_success", "--env", "PandaReach-v3", "--learners", "sbx-sac"]
    without = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, cwd=ROOT, env=without)
    assert done.returncode == 1
    text = done.stderr
    assert f"sbx-sac in PandaReach-v3 needs {package}, which is not installed" in text
    assert 'pip install -e ".[bench]"' in text
    assert len(text.splitlines()) == 1


@pytest.mark.slow
def test_our_learners_have_curves_in_an_environment_with_words_and_one_with_goals():
    for env, commands in (("Deixis/NLReach-v0", "train.py"), ("Deixis/Reach-v0", "examples/goal_env.py")):
        words = ["--env", env, "--learners", "ours-ppo", "--frames", "256", "--episodes", "2", "--json"]
        shorter = ["collector.worlds=16", "algo.horizon=16", "algo.grounding_scenes=16", "eval.worlds=2"]
        found = json.loads(time_to_success(*words, *shorter).splitlines()[-1])
        (run,) = found["runs"]
        ((seconds, frames, success),) = run["evaluations"]
        assert 0 < seconds < run["seconds"]
        assert frames == 256
        assert 0 <= success <= 1
        assert found["settings"]["ours-ppo"].startswith(commands)
        assert found["ours_over_best_peer"] == {"90": None, "95": None, "97": None}


@pytest.mark.slow
def test_a_run_ends_with_its_budget_of_seconds():
    words = ["--env", "Deixis/NLReach-v0", "--learners", "ours-ppo", "--budget", "0.1", "--json"]
    found = json.loads(time_to_success(*words).splitlines()[-1])
    assert found["runs"][0]["evaluations"] == []
    assert found["seconds"] == {"ours-ppo": {"90": None, "95": None, "97": None}}


@pytest.mark.slow
def test_a_training_alone_has_its_seconds_and_their_parts():
    words = ["total_frames=256", "collector.worlds=16", "algo.horizon=16", "algo.minibatch=64"]
    words += ["eval.episodes=4", "eval.worlds=4", "eval.video_episodes=0"]
    head, _, row, _, parts, _, seconds = time_to_success(*words).splitlines()
    assert head.startswith("| seed | first 0.90 | first 0.95 | first 0.97 | whole command |")
    assert row.startswith("| 0 | not reached | not reached | not reached |")
    assert "collecting | updating" in parts
    cells = [float(cell.strip().removesuffix(" s")) for cell in seconds.split("|")[2:-1]]
    assert len(cells) == 5
    assert min(cells[:3]) > 0


@pytest.mark.slow
def test_a_failing_command_is_named():
    words = ["--env", "Deixis/NLReach-v0", "--learners", "ours-ppo", "algo.lr=-1"]
    assert "train.py" in time_to_success(*words, code=1).splitlines()[-1]

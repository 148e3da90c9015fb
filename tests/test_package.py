"""The wheel: built from a copy of the project, installed into a folder, and used in an empty one."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import deixis
from tests.helpers.own_package import OWN_OPTIONS, write_own_package
from trainers.export.policy_file import names

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
PACKAGES = ("conf", "core", "deixis", "demo", "envs", "human", "language", "trainers")
LEFT_OUT = shutil.ignore_patterns(
    ".git", "__pycache__", "outputs", "multirun", "build", "site", "*.egg-info", ".*_cache"
)
TINY = ["total_frames=256", "collector.workers=1", "collector.worlds=8", "algo.horizon=16", "algo.minibatch=64"]
TINY += ["eval.episodes=2", "eval.interval=128", "eval.interval_episodes=2", "eval.worlds=2", "eval.video_episodes=0"]
TINY += ["task.max_steps=8", "logger=[]"]
pytestmark = pytest.mark.slow


def pip(*arguments):
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel, and what the build said."""
    folder = tmp_path_factory.mktemp("built")
    shutil.copytree(ROOT, folder / "source", ignore=LEFT_OUT)
    said = pip("wheel", str(folder / "source"), "-v", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder))
    (wheel,) = folder.glob("*.whl")
    return wheel, said


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """The folder that the wheel is installed to; its dependencies are those of this interpreter."""
    target = tmp_path_factory.mktemp("installed")
    pip("install", "--no-deps", "--target", str(target), str(built[0]))
    return target


@pytest.fixture
def deixis_command(installed, monkeypatch, tmp_path):
    """Runs the console command in an empty folder."""
    monkeypatch.setenv("PYTHONPATH", str(installed))

    def run(*words):
        done = subprocess.run([str(installed / "bin" / "deixis"), *words], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_the_build_warns_of_no_missing_package(built):
    _, said = built
    assert "absent from the `packages`" not in said
    assert "Deprecat" not in said


def test_the_wheel_has_every_module_config_weight_and_policy_of_the_project(built):
    with zipfile.ZipFile(built[0]) as wheel:
        packed = set(wheel.namelist())
    wanted = {path.name for path in ROOT.glob("*.py")}
    for package in PACKAGES:
        files = (path for kind in ("*.py", "*.yaml", "*.npz", "py.typed") for path in (ROOT / package).rglob(kind))
        wanted |= {path.relative_to(ROOT).as_posix() for path in files}
        assert package == "conf" or f"{package}/py.typed" in packed  # conf holds YAML
    wanted |= {f"pretrained/{name}/{file}" for name in names() for file in ("policy.safetensors", "README.md")}
    assert wanted <= packed
    assert not {name for name in packed if name.startswith(("tests/", "benchmarks/", "docs/"))}


def test_the_latest_release_has_one_version_and_one_date():
    latest = re.search(r"^## (\d\S*) \((\S+)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert latest is not None
    assert latest[1] == deixis.__version__
    assert f"version: {latest[1]}\ndate-released: {latest[2]}\n" in citation


def test_the_version_is_declared_once(built):
    assert built[0].name.startswith(f"deixis-{deixis.__version__}-")
    assert "version" in PROJECT["dynamic"]


def test_the_command_prints_its_version(deixis_command):
    assert deixis_command("--version") == f"deixis {deixis.__version__}\n"


def test_the_command_parses_a_sentence(deixis_command):
    assert "object the red cube" in deixis_command("parse", "reach the red cube")


def test_the_command_evaluates_a_pretrained_policy_by_name(deixis_command, tmp_path):
    said = deixis_command("evaluate", "checkpoint=nl_reach_kuka", "episodes=4")
    assert re.search(r"^all +success_at_end (0\.75|1\.0)", said, re.MULTILINE), said
    assert (tmp_path / "outputs" / "evaluation_nl_reach_kuka_1.json").is_file()


def test_the_command_trains_into_the_current_folder(deixis_command, tmp_path, installed):
    before = {path for path in installed.rglob("*") if path.suffix != ".pyc"}
    said = deixis_command("train", *TINY)
    assert "256 frames" in said
    (run,) = (tmp_path / "outputs").iterdir()
    assert (run / "checkpoints" / "last.pt").is_file()
    assert deixis_command("report", str(run)).strip() == f"{run}/report.html"
    after = {path for path in installed.rglob("*") if path.suffix != ".pyc" and path.name != "__pycache__"}
    assert after <= before


def test_a_sweep_runs_from_the_wheel_with_options_and_classes_of_the_users_own(
    installed, deixis_command, monkeypatch, tmp_path
):
    own = write_own_package(tmp_path / "site")
    monkeypatch.setenv("PYTHONPATH", f"{installed}{os.pathsep}{own}")
    said = deixis_command("train", "-m", "seed=1", "sweep.jobs=1", *OWN_OPTIONS, *TINY, "collector.workers=2")
    assert "report: " in said
    assert len(list(tmp_path.glob("multirun/*/*/eval.json"))) == 1
    assert "object the red cube" in deixis_command("parse", "wave at the red cube")

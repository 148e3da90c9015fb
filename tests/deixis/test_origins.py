"""Another package with one of our names is refused in one sentence."""

import subprocess
import sys
from pathlib import Path

import pytest

from deixis.origins import ROOT, ForeignPackageError, check_origins


def in_folder(folder, *arguments):
    """A Python process that finds packages in `folder` before ours."""
    environment = {"PYTHONPATH": f"{folder}:{ROOT}"}
    return subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, cwd=folder)


@pytest.mark.parametrize("name", ["conf", "envs", "human", "language", "trainers"])
def test_a_package_of_the_same_name_fails_the_import_with_one_sentence(name, tmp_path):
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").touch()
    done = in_folder(tmp_path, "-c", "import deixis")
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert f"deixis needs its own '{name}' from {ROOT}, but Python finds another one first: {tmp_path / name};" in last


@pytest.mark.slow
def test_a_users_own_program_called_train_is_no_obstacle_to_the_import(tmp_path):
    (tmp_path / "train.py").write_text("import deixis\nprint(deixis.parse('reach the red cube'))\n")
    done = in_folder(tmp_path, "train.py")
    assert done.stdout == "reach the red cube\n", done.stderr


def test_the_command_refuses_to_run_a_program_that_is_not_its_own(tmp_path):
    (tmp_path / "train.py").write_text("print('another program')\n")
    done = in_folder(tmp_path, "-m", "deixis", "train")
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"error: deixis needs its own 'train' from {ROOT}")
    assert len(done.stderr.splitlines()) == 1


def test_a_missing_package_is_named():
    with pytest.raises(ForeignPackageError, match="needs its package 'gone'"):
        check_origins("gone")


def test_our_own_packages_pass():
    check_origins("conf", "envs", "human", "language", "trainers", "demo", "train", "evaluate", "play", "record")
    assert Path(__file__).is_relative_to(ROOT)

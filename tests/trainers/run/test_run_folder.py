"""The folder of a run: its lock, what killed processes leave, and links out of it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from core.errors import ConfigError
from trainers.run import run_folder
from trainers.run.run_folder import FolderLock, name_semaphores
from trainers.utils.files import atomic_file, write_text


def test_a_folder_has_one_run_at_a_time(tmp_path):
    running = r"a run is running in \S+/run already"
    with FolderLock(tmp_path / "run"), pytest.raises(ConfigError, match=running), FolderLock(tmp_path / "run"):
        pass
    with FolderLock(tmp_path / "run"):
        pass


def test_a_killed_process_keeps_no_lock_and_leaves_nothing(tmp_path):
    code = (
        "import os, sys; from pathlib import Path; from trainers.run.run_folder import FolderLock\n"
        "from trainers.utils.files import atomic_file\n"
        "FolderLock(Path(sys.argv[1])).__enter__()\n"
        "with atomic_file(Path(sys.argv[1]) / 'last.pt'): os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=os.getcwd()).returncode == -9
    (tmp_path / ".mine.tmp").touch()
    assert len(list(tmp_path.iterdir())) == 3
    with FolderLock(tmp_path):
        assert {path.name for path in tmp_path.iterdir()} == {".lock", ".mine.tmp"}


@pytest.mark.parametrize("name", ["checkpoints", "metrics.csv", ".lock", "checkpoints/last.pt"])
def test_a_link_out_of_the_folder_is_refused(tmp_path, name):
    (tmp_path / "others").mkdir()
    (tmp_path / "run" / name).parent.mkdir(parents=True)
    (tmp_path / "run" / name).symlink_to(tmp_path / "others")
    with pytest.raises(ConfigError, match=r"symbolic link"), FolderLock(tmp_path / "run"):
        pass
    assert list((tmp_path / "others").iterdir()) == []


def test_a_place_that_is_no_folder_is_refused(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(ConfigError, match="cannot be the folder of a run"), FolderLock(folder):
            pass


def test_temporary_names_cannot_be_predicted_and_are_created_new(tmp_path, monkeypatch):
    names = set()
    for _ in range(3):
        with atomic_file(tmp_path / "x"):
            names.add(next(path.name for path in tmp_path.iterdir() if path.name != "x"))
    assert len(names) == 3
    monkeypatch.setattr("trainers.utils.files.secrets.token_hex", lambda _: "0" * 16)
    (tmp_path / "others").write_text("precious")
    (tmp_path / f".x.{'0' * 16}.tmp").symlink_to(tmp_path / "others")
    with pytest.raises(ConfigError, match="x cannot be written: File exists"):
        write_text(tmp_path / "x", "mine")
    assert (tmp_path / "others").read_text() == "precious"


def test_semaphores_of_dead_processes_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(run_folder, "SEMAPHORES", tmp_path)
    names = ("sem.mp-deixis-999999999-abc", f"sem.mp-deixis-{os.getpid()}-abc", "sem.mp-other", "sem.mp-deixis-x-y")
    for name in names:
        (tmp_path / name).touch()
    config = run_folder.multiprocessing.current_process()._config
    monkeypatch.setitem(config, "semprefix", config["semprefix"])
    name_semaphores()
    assert {path.name for path in tmp_path.iterdir()} == set(names[1:])
    assert config["semprefix"] == f"/mp-deixis-{os.getpid()}"

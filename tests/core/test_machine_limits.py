"""Limits of the machine are looked at before the work, and named with what helps."""

from __future__ import annotations

import resource
import shutil
import threading
from collections import namedtuple
from pathlib import Path

import pytest

from core import machine_limits
from core.errors import ConfigError
from core.machine_limits import require_disk, require_files, require_shared_memory, require_threads

Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def files(monkeypatch):
    """Return the limits of open files, which the process can raise from 64 to 100."""
    limits = {"now": (64, 100)}
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits["now"])
    monkeypatch.setattr(resource, "setrlimit", lambda _, new: limits.update(now=new))
    return limits


def test_the_limit_of_open_files_is_raised_where_the_system_allows_it(files):
    require_files(90)
    assert files["now"] == (100, 100)
    with pytest.raises(ConfigError, match=r"^300 open files are needed, and 100 are allowed: raise the limit \(ulimit"):
        require_files(300)


def test_threads_that_cannot_be_started_are_counted(monkeypatch):
    start, before = threading.Thread.start, threading.active_count()

    def limited(thread):
        if threading.active_count() >= before + 3:
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", limited)
    with pytest.raises(ConfigError, match="8 threads and processes are needed, and 3 can be started"):
        require_threads(8)
    assert threading.active_count() == before
    require_threads(2)


def test_shared_memory_is_large_enough_and_can_be_written(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_limits, "SHARED_MEMORY", tmp_path)
    require_shared_memory(1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 2**18))
    with pytest.raises(ConfigError, match=r"need 3\.0 MiB of shared memory, and .* has 0\.2 free: give .*workers=1"):
        require_shared_memory(3 * 2**20)
    monkeypatch.setattr(machine_limits, "SHARED_MEMORY", Path("/proc/self"))
    with pytest.raises(ConfigError, match=r"^/proc/self cannot be used: "):
        require_shared_memory(1)


def test_a_disk_has_space_for_a_folder_that_is_not_made_yet(monkeypatch, tmp_path):
    require_disk(tmp_path / "new" / "run", 1000, "a run needs")
    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(0, 0, 2**20 * (place == tmp_path)))
    with pytest.raises(ConfigError, match=r"run: a run needs 5 MiB of free disk space, 1 are free; free some"):
        require_disk(tmp_path / "new" / "run", 5 * 2**20, "a run needs")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1024, 1024))
    with pytest.raises(ConfigError, match=r"files of up to 1 MiB, and 0\.0 are allowed: raise the limit \(ulimit -f\)"):
        require_disk(tmp_path, 2**20, "a run needs")


def test_a_run_is_refused_before_its_worlds_are_built(monkeypatch, tmp_path):
    import train
    from core.overrides import compose

    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 2**20))
    with pytest.raises(ConfigError, match="a run needs at least 128 MiB"):
        train.run(compose(["collector.workers=1"]), tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_run_is_refused_once_the_size_of_its_checkpoints_is_known(monkeypatch, tmp_path):
    from tests.helpers.short_training import train
    from trainers.run import requirements

    monkeypatch.setattr(requirements, "MOMENTS", 10**9)
    with pytest.raises(ConfigError, match="the checkpoints of this run need"):
        train(tmp_path)
    assert not (tmp_path / "checkpoints").exists()

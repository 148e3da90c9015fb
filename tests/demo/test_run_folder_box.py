"""The box of the page for a run folder: it takes runs, and tells nothing about other paths."""

from __future__ import annotations

import os
import shutil

import pytest

from core.schema import ConfigError
from demo.session_config import NOT_A_RUN, check_run
from trainers.export import policy_file

POLICY = policy_file.FOLDER / "nl_reach_kuka"


def broken(folder, name, content):
    """A copy of a policy with one file changed."""
    shutil.copytree(POLICY, folder / name)
    (folder / name / policy_file.NAME).write_bytes(content)


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paths")
    (folder / "file").write_text("secret")
    (folder / "empty").touch()
    (folder / "folder" / "checkpoints").mkdir(parents=True)
    (folder / "link").symlink_to("/etc/passwd")
    (folder / "loop").symlink_to(folder / "loop")
    os.mkfifo(folder / "fifo")
    whole = (POLICY / policy_file.NAME).read_bytes()
    broken(folder, "short", whole[:1000])
    broken(folder, "none", b"")
    broken(folder, "other", b"{}" * 500)
    return folder


def test_a_policy_is_taken():
    check_run(str(POLICY))
    check_run(str(POLICY / policy_file.NAME))


@pytest.mark.parametrize(
    "name", ["nothing", "file", "empty", "folder", "link", "loop", "fifo", "short", "none", "other", "file/x"]
)
def test_every_path_that_is_no_run_gets_the_same_answer(paths, name):
    with pytest.raises(ConfigError) as error:
        check_run(str(paths / name))
    assert str(error.value) == NOT_A_RUN


@pytest.mark.parametrize(
    "path", ["nul\0", "x" * 5000, "/dev/zero", "/proc/self/mem", "/root", "~root", "\ud800", "/", "."]
)
def test_no_path_gets_another_answer(path):
    with pytest.raises(ConfigError) as error:
        check_run(path)
    assert str(error.value) == NOT_A_RUN

"""Files and directories that appear complete or not at all."""

from __future__ import annotations

import json

import pytest

from core.errors import ConfigError
from trainers.utils.files import atomic_directory, atomic_file, write_json, write_text


def test_an_error_keeps_the_previous_file_and_leaves_no_temporary_one(tmp_path):
    path = tmp_path / "x"
    write_text(path, "old")
    with pytest.raises(ZeroDivisionError), atomic_file(path) as file:
        file.write(b"%d" % (1 // 0))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_json_is_written_and_replaced(tmp_path):
    write_json(tmp_path / "x.json", {"a": 1})
    write_json(tmp_path / "x.json", {"a": 2})
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": 2}


def test_a_directory_appears_when_it_is_complete(tmp_path):
    with atomic_directory(tmp_path / "d") as folder:
        (folder / "x").touch()
        assert not (tmp_path / "d").exists()
    assert (tmp_path / "d" / "x").exists()


def test_an_error_leaves_no_directory(tmp_path):
    with pytest.raises(RuntimeError), atomic_directory(tmp_path / "d"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_an_existing_directory_is_not_overwritten(tmp_path):
    with pytest.raises(ConfigError, match="exists already and is not overwritten"), atomic_directory(tmp_path):
        pass

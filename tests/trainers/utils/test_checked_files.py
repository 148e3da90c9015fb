"""Records with a checksum: no damage gives another value."""

from __future__ import annotations

import random

import pytest
import yaml

from core.safe_files import FileError
from trainers.utils.files import read_checked_json, read_checked_yaml, write_checked_json, write_checked_yaml

VALUES = {"success": 0.75, "ci95": [0.5, 0.9], "name": "kuka", "group": {"a": 1, "b": None}}


def write(path):
    if path.suffix == ".json":
        write_checked_json(path, VALUES)
    else:
        write_checked_yaml(path, yaml.safe_dump(VALUES))


def read(path):
    return read_checked_json(path) if path.suffix == ".json" else read_checked_yaml(path, 10_000)


@pytest.mark.parametrize("name", ["x.json", "x.yaml"])
def test_no_damage_gives_another_value(tmp_path, name):
    path, rng = tmp_path / name, random.Random(0)
    write(path)
    content = path.read_bytes()
    assert read(path) == VALUES
    for _ in range(300):
        damaged, place = bytearray(content), rng.randrange(len(content))
        end = rng.choice([place, place + 1, place + 1, place + 9, len(content)])
        damaged[place:end] = bytes([rng.randrange(256)] * rng.choice([0, 1]))
        path.write_bytes(bytes(damaged))
        try:
            found = read(path)
        except FileError:
            continue
        assert {key: found[key] for key in VALUES} == VALUES


@pytest.mark.parametrize("name", ["x.json", "x.yaml"])
def test_a_file_written_by_hand_needs_no_checksum(tmp_path, name):
    (tmp_path / name).write_text('{"a": 1}')
    assert read(tmp_path / name) == {"a": 1}
    write(tmp_path / name)
    (tmp_path / name).write_text((tmp_path / name).read_text().replace("kuka", "panda"))
    with pytest.raises(FileError, match="if you edited it, remove the sha256"):
        read(tmp_path / name)

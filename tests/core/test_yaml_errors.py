"""A YAML file that is none: one line that names the file, the line and what is wrong."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from core import composition
from core.errors import ConfigError
from core.safe_files import FileError, read_yaml

WRONG = {
    "a tab": (b"name: x\n\tbase: 1\n", 2),
    "an unclosed bracket": (b"name: [1, 2\n", 1),
    "a key given twice": (b"name: a\njoints: []\nname: b\n", 3),
    "an unclosed quote": (b'name: "abc\n', 1),
    "an alias of nothing": (b"name: *x\n", 1),
    "a tag": (b"name: !!python/object:os.system x\n", 1),
    "two values": (b"name: a: b\n", 1),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_file_of_a_person_is_named_with_the_line(case, tmp_path):
    content, line = WRONG[case]
    (tmp_path / "x.yaml").write_bytes(content)
    with pytest.raises(FileError) as caught:
        read_yaml(tmp_path / "x.yaml")
    assert "\n" not in str(caught.value)
    assert case == "a tag" or f"line {line}" in str(caught.value) or f"line {line + 1}" in str(caught.value)


def test_keys_may_be_the_same_in_different_groups(tmp_path):
    (tmp_path / "x.yaml").write_text("a: {x: 1, y: a}\nb: {x: 1, y: [x, x, {x: x}]}\nx: a\n")
    assert read_yaml(tmp_path / "x.yaml")["b"]["y"] == ["x", "x", {"x": "x"}]


@pytest.mark.slow
@pytest.mark.parametrize("case", [*WRONG, "not UTF-8"])
def test_a_file_of_conf_is_named_with_the_line(case, tmp_path, monkeypatch):
    from hydra.errors import HydraException  # noqa: F401  imported before the copy is on the path

    content, line = WRONG.get(case, (b"name: \xff\xfe\n", 0))
    folder = Path(shutil.copytree(composition.ROOT, tmp_path / "conf"))
    (folder / "robot" / "own.yaml").write_bytes(content)
    monkeypatch.setattr(composition, "ROOT", folder)
    composition._groups_on_disk.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == "conf"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    try:
        with pytest.raises(ConfigError) as caught:
            composition.compose_hydra(["robot=own"])
    finally:
        composition._groups_on_disk.cache_clear()
    message = str(caught.value)
    assert "\n" not in message
    assert str(folder / "robot" / "own.yaml") in message
    assert line == 0 or f"line {line}" in message or f"line {line + 1}" in message

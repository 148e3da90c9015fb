"""docs/pointing.md: its Python runs, and its table has every key."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

import human
from human import GestureConfig

DOCS = Path(human.__file__).parent.parent / "docs"
PAGE = (DOCS / "pointing.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("code", PYTHON, ids=range(len(PYTHON)))
def test_an_example_runs(code):
    exec(compile(code, "docs/pointing.md", "exec"), {"__name__": "example"})


def test_the_table_lists_every_key_of_a_gesture():
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE) == [field.name for field in fields(GestureConfig)]


def test_its_pictures_exist():
    for name in re.findall(r"!\[.*?\]\((.*?)\)", PAGE):
        assert (DOCS / name).is_file()

"""docs/architecture.md names files and functions that exist, and its pictures show its tables."""

import ast
from pathlib import Path

import pytest

from tools.architecture import PAGE, ROOT, Hop, pictures, places, svg

TEXT = PAGE.read_text("utf-8")


def defined(tree, names):
    """Whether a module defines the name, or the method of a class: `Class.method`."""
    found = tree
    for name in names.split("."):
        bodies = [
            node for node in found.body if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        ]
        found = next((node for node in bodies if node.name == name), None)
        if found is None:
            return False
    return True


@pytest.mark.parametrize("place", places(TEXT), ids=":".join)
def test_what_the_page_names_exists(place):
    file, function = place
    assert defined(ast.parse((ROOT / file).read_text("utf-8")), function), f"{file} has no {function}"


def test_the_page_has_both_roads():
    drawn = dict(pictures(TEXT))
    assert set(drawn) == {"architecture_sentence.svg", "architecture_training.svg"}
    training = drawn["architecture_training.svg"]
    assert training[0].file == "train.py"
    assert len({hop.file for hop in training}) <= 12


@pytest.mark.parametrize(("name", "hops"), list(pictures(TEXT)), ids=[name for name, _ in pictures(TEXT)])
def test_a_picture_shows_its_table(name, hops):
    assert (Path(PAGE).parent / name).read_text("utf-8") == svg(hops), "python -m tools.architecture draws it anew"


def test_a_name_that_is_gone_is_noticed():
    tree = ast.parse("class A:\n    def b(self): ...\n")
    assert defined(tree, "A.b")
    assert not defined(tree, "A.c")
    assert not defined(tree, "b")


def test_a_picture_has_a_lane_for_each_process():
    drawn = svg([Hop("main", "a.py", "f", "does <this>", "x"), Hop("worker", "b.py", "g", "that", "")])
    assert drawn.count("<rect") == 3  # the background and two boxes
    assert ">main<" in drawn
    assert ">worker<" in drawn
    assert "does &lt;this&gt;" in drawn

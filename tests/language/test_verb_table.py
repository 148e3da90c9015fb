"""The table of verbs: every verb is named there, and nowhere else."""

import ast
from pathlib import Path

import pytest

from language import Dialogue, Object, Plan, Scene
from language.lattice import forget_caches, teach
from language.remarks import naming
from language.verbs import DEVICE_VERBS, FURTHER, KNOWN, ROOM, VERBS

ROOT = Path(__file__).resolve().parents[2]
READERS = [*(ROOT / "language").glob("*.py"), *(ROOT / "demo").glob("*.py"), ROOT / "envs/tasks/shared/feasible.py"]
ALSO_WORDS = {
    "open",
    "turn",
    "switch",
    "push",
    "stack",
    "reach",
    "close",
    "sort",
    "swap",
    "empty",
    "build",
    "unstack",
}  # plain words


def named_in(path):
    """The strings of a module that are names of verbs, without docstrings."""
    tree = ast.parse(path.read_text("utf-8"))
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return {text for text in texts if text in KNOWN}


@pytest.mark.parametrize("path", READERS, ids=lambda path: path.stem)
def test_no_other_module_names_a_verb(path):
    if path.name != "verbs.py":
        assert named_in(path) - ALSO_WORDS == set()


def test_said_and_understood_verbs_are_different_entries():
    assert not VERBS.keys() & FURTHER.keys()
    assert all(verb.templates for verb in VERBS.values())
    assert all(not verb.templates and verb.words for verb in FURTHER.values())


def test_the_verbs_of_a_room_have_a_need_and_those_of_devices_a_noun():
    assert all(VERBS[name].need for name in ROOM)
    assert all(VERBS[name].noun == noun for name, noun in DEVICE_VERBS.items())


def test_a_taught_word_of_a_verb_is_understood():
    scene = Scene([Object("cube", "red", (0.5, 0.1, 0.025))])
    before = KNOWN["lift"].words
    teach("verb", "lift", "yoink")
    try:
        outcome = Dialogue().answer("yoink the red cube", scene)
    finally:
        object.__setattr__(KNOWN["lift"], "words", before)
        forget_caches()
    assert isinstance(outcome, Plan)
    assert [step.object for step in outcome.steps] == [0]


def test_a_taught_word_of_a_verb_is_no_exclamation_beside_a_command():
    assert not naming().search("yoink")
    before = KNOWN["lift"].words
    teach("verb", "lift", "yoink")
    try:
        assert naming().search("yoink")
    finally:
        object.__setattr__(KNOWN["lift"], "words", before)
        forget_caches()

"""Questions about things in many forms: each answer names exactly what the scene says."""

from __future__ import annotations

import re

import pytest

from language import Answer, Dialogue, Object, Scene, table
from language.verbs import ROOM
from language.world import WorldModel

_CUBES = ("yellow", "blue", "orange", "red", "gray")
_WHERE = {  # what is stated -> the cubes of which it is so
    "on the table": {"yellow", "orange", "gray"},
    "in the drawer": {"red"},
    "in the fridge": set(),
    "on top of another cube": {"blue"},
    "under another cube": {"orange"},
    "to the left of the gray cube": {"yellow"},  # not those left of the see-through gray cube, too
    "not in the drawer": {"yellow", "blue", "orange", "gray"},
}
_NAMING = (
    "which cubes are {}?",
    "what cubes are {}",
    "list the cubes {}",
    "name all cubes {}",
    "tell me which cubes are {}",
    "what cubes do we have {}",
    "which of the blocks are {} now",
)
_COUNTING = ("how many cubes are {}?", "count the cubes {}", "how many are {}")


@pytest.fixture
def world() -> WorldModel:
    """A room with a cube in an open drawer, one on top of another, and a see-through mark."""
    scene = Scene(
        [
            Object("cube", "yellow", (0.4, 0.1, 0.025)),
            Object("cube", "blue", (0.35, -0.15, 0.075)),
            Object("cube", "orange", (0.35, -0.15, 0.025)),
            Object("cube", "red", (0.43, -0.46, 0.038)),
            Object("cube", "gray", (0.45, -0.05, 0.025)),
            Object("cube", "gray", (0.45, 0.2, 0.025), role="target"),
            Object("drawer", "blue", (0.31, -0.46, 0.08)),
            Object("fridge", "red", (0.27, 0.46, 0.1)),
            Object("lever", "cyan", (0.6, -0.1, 0.06)),
        ]
    )
    bounds = (0.3, 0.5, -0.25, 0.25)
    return table(scene, inside={3: 6}, open={6}, bounds=bounds, flat_only=True, verbs=ROOM)


def _answer(world: WorldModel, asked: str) -> str:
    outcome = Dialogue().answer(asked, world)
    assert isinstance(outcome, Answer), (asked, outcome)
    return outcome.text


@pytest.mark.parametrize("stated", _WHERE)
def test_the_cubes_of_which_something_is_so_are_named_in_every_form(world: WorldModel, stated: str) -> None:
    for form in _NAMING:
        text = _answer(world, form.format(stated))
        subject = re.split(r" (?:is|are) (?!there)|, ", text)[0] if not _WHERE[stated] else text
        named = {cube for cube in _CUBES if f"{cube} cube" in subject}
        assert named >= _WHERE[stated], (form, text)
        assert _WHERE[stated] or re.match("Nothing|None|No", text), (form, text)


@pytest.mark.parametrize("stated", _WHERE)
def test_the_cubes_of_which_something_is_so_are_counted(world: WorldModel, stated: str) -> None:
    for form in _COUNTING:
        text, number = _answer(world, form.format(stated)), len(_WHERE[stated])
        assert f"({number})" in text if number else text.startswith(("None", "Nothing")), (form, text)


@pytest.mark.parametrize("stated", _WHERE)
def test_all_of_the_cubes_is_not_any_of_them(world: WorldModel, stated: str) -> None:
    for form in ("are all cubes {}?", "is every cube {}"):
        assert _answer(world, form.format(stated)).startswith("No"), (form, stated)
    assert _answer(world, f"are any cubes {stated}").startswith("Yes" if _WHERE[stated] else "No")


def test_all_things_of_a_kind_or_a_colour_are_listed(world: WorldModel) -> None:
    cubes = (
        "There are the yellow cube, the blue cube, the orange cube, the red cube in the blue drawer and the gray cube."
    )
    for asked in ("list all cubes", "what cubes are there?", "which blocks can you see", "name the cubes"):
        assert _answer(world, asked) == cubes
    assert _answer(world, "which containers are there") == "There are the blue drawer and the red fridge."
    assert _answer(world, "what blue things do you see") == "There are the blue cube and the blue drawer."
    assert _answer(world, "what levers do you have") == "There is the cyan lever."
    assert (
        _answer(world, "which cubes are red or blue")
        == "The blue cube and the red cube in the blue drawer are red or blue."
    )

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


@pytest.mark.parametrize(
    ("told", "forms"),
    [
        (
            "drawer",
            (
                "where is the {} cube?",
                "where exactly is the {} cube",
                "where did the {} block go",
                "in which place is the {} cube",
                "location of the {} cube?",
                "what about the {} cube, where is it",
                "do you know where the {} one is?",
                "tell me the position of the {} cube",
            ),
        ),
        (
            "in the blue drawer",
            ("do you see if the {} cube is in the drawer", "is the {} block in there, in the drawer?"),
        ),
    ],
)
def test_a_thing_is_told_where_it_is_and_not_moved(world: WorldModel, told: str, forms: tuple[str, ...]) -> None:
    for form in forms:
        assert told in _answer(world, form.format("red")), form


@pytest.mark.parametrize(("box", "is_open"), [("drawer", True), ("fridge", False)])
def test_containers_are_told_open_or_closed_and_what_is_in_them(world: WorldModel, box: str, is_open: bool) -> None:
    for form in (
        "is the {} open?",
        "do you see if the {} is open",
        "has the {} been opened",
        "did someone leave the {} open?",
    ):
        assert _answer(world, form.format(box)).startswith("Yes" if is_open else "No"), form
    for form in ("is the {} open or closed?", "open or closed, the {}?", "how is the {}", "what state is the {} in"):
        assert ("open" if is_open else "closed") in _answer(world, form.format(box)), form
    for form in ("what's in the {}?", "content of the {}?", "what can be found in the {}", "what does the {} contain"):
        assert ("red cube" if is_open else "Nothing") in _answer(world, form.format(box)), form


def test_one_of_two_is_chosen_by_where_it_is(world: WorldModel) -> None:
    for form in (
        "which is closer to the lever, the {} cube or the {} cube?",
        "is the {} or the {} cube closer to the lever?",
        "which one is nearer to the lever, {} or {}?",
        "which cube is closer to the lever: {} or {}?",
    ):
        for pair in (("gray", "yellow"), ("yellow", "gray")):
            assert _answer(world, form.format(*pair)).startswith("The gray cube"), (form, pair)
    for form in ("which is further left, {} or {}?", "which cube is more to the left, the {} one or the {} one?"):
        assert _answer(world, form.format("gray", "yellow")).startswith("The yellow cube"), form
    for form in ("which cube is closest to the lever?", "which of the cubes is the closest to the lever"):
        assert "gray cube" in _answer(world, form), form


def test_what_is_not_there_is_not_what_is_held(world: WorldModel) -> None:
    held = world.after(next(iter(Dialogue().answer("lift the gray cube", world).steps)))
    assert _answer(held, "do you have a purple block?").startswith("No")
    assert "gray cube" in _answer(held, "do you have something in your gripper?")

"""What is said of several things to each other: "side by side", "next to each other", "closest together"."""

import math

import pytest

from language import Dialogue, Object, Plan, Question, Scene, table

PLACES = {"red": (0.35, 0.2), "green": (0.4, 0.05), "blue": (0.36, -0.12), "pink": (0.46, -0.18), "gray": (0.45, 0.18)}


def world():
    return table(Scene([Object("cube", color, (*at, 0.025)) for color, at in PLACES.items()]))


def after(sentence):
    """Return the world after a sentence, and what it moved."""
    outcome = Dialogue().answer(sentence, world())
    assert isinstance(outcome, Plan), outcome
    return outcome.result, {outcome.result.things[step.object].color for step in outcome.steps}


def place(world, color):
    return next((thing.x, thing.y, thing.bottom) for thing in world.things if thing.color == color)


@pytest.mark.parametrize(
    "sentence",
    [
        "the red and the pink block, I want them side by side",
        "red and pink next to each other please",
        "please see to it that the red cube and the pink cube touch each other",
        "the red one and the pink one have to be neighbours",
        "my friend likes it when the red and the pink block stand together, so set them next to each other",
        "make the red and the pink cube touch",
    ],
)
def test_two_things_are_put_beside_each_other_by_moving_one(sentence):
    now, moved = after(sentence)
    assert len(moved) == 1
    assert moved < {"red", "pink"}
    assert math.dist(place(now, "red"), place(now, "pink")) < 0.12


@pytest.mark.parametrize(
    ("sentence", "pair"),
    [
        ("the two blocks on the right should be stacked", {"blue", "pink"}),
        ("stack the two cubes on the right", {"blue", "pink"}),
        ("those two on the right, stack them", {"blue", "pink"}),
        ("the two rightmost cubes should be on top of each other", {"blue", "pink"}),
        ("the two cubes that are closest together: put one on the other", {"red", "gray"}),
    ],
)
def test_two_things_that_are_named_by_where_they_are_are_stacked(sentence, pair):
    now, moved = after(sentence)
    one, other = (place(now, color) for color in pair)
    assert moved < pair
    assert (one[:2], one[2] != other[2]) == (other[:2], True)


@pytest.mark.parametrize(
    "sentence", ["can we have red and pink swapped round", "the red and the pink cube are swapped"]
)
def test_two_things_that_should_be_swapped_change_places(sentence):
    now, _ = after(sentence)
    assert [place(now, color)[:2] for color in ("red", "pink")] == [PLACES[color] for color in ("pink", "red")]


def test_things_come_apart_and_closer():
    before = math.dist(PLACES["blue"], PLACES["pink"])
    now, _ = after("move the blue and the pink cube away from each other")
    assert math.dist(place(now, "blue"), place(now, "pink")) > before
    now, _ = after("move the two cubes that are farthest apart closer to each other")
    assert math.dist(place(now, "red"), place(now, "pink")) < 0.15
    now, _ = after("put the red and the blue block one behind the other")
    assert abs(place(now, "red")[1] - place(now, "blue")[1]) < 0.05


def test_more_than_two_things_stand_in_a_row():
    now, moved = after("all cubes should be close together")
    rows = {round(place(now, color)[0], 3) for color in PLACES}
    assert len(rows) == 1
    assert len(moved) > 2


def test_the_rest_joins_two_that_are_side_by_side():
    dialogue = Dialogue()
    first = dialogue.answer("put the red cube and the green cube next to each other", world())
    rest = dialogue.answer("and the rest too", first.result)
    assert isinstance(rest, Question)
    assert {first.result.things[i].color for i in rest.candidates} == {"blue", "pink", "gray"}

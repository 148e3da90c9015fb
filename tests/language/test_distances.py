"""Lengths and directions: how far a thing is moved, and what is told where it cannot go as far as that."""

import math

import pytest

from language import Dialogue, Object, Plan, Refusal, Scene, table

SCENE = Scene([Object("cube", "cyan", (0.44, -0.05, 0.025)), Object("cube", "pink", (0.50, 0.17, 0.025))], "human")
WORLD = table(SCENE, bounds=(0.32, 0.56, -0.3, 0.3))


def moved(sentence, scene=SCENE):
    """How far the cyan cube goes along x and y, in metres, and the notes."""
    outcome = Dialogue().answer(sentence, table(scene, bounds=WORLD.bounds))
    assert isinstance(outcome, Plan), outcome
    place = outcome.steps[-1].place
    return place[0] - WORLD.things[0].x, place[1] - WORLD.things[0].y, outcome.notes


@pytest.mark.parametrize(
    ("sentence", "dx", "dy"),
    [
        ("move the cyan cube 5 cm closer to me", 0.05, 0.0),
        ("move the cyan cube 5 cm closer to you", -0.05, 0.0),
        ("move the cyan cube away from you by 6 cm", 0.06, 0.0),
        ("move the cyan cube 2 inches to the left", 0.0, -0.0508),
        ("move the cyan cube 5 cm closer to me and 4 cm to the right", 0.05, 0.04),
        ("cyan cube: 4 cm to the right and 5 cm away from you", 0.05, 0.04),
        ("move the cyan cube ten cm closer to you and then five cm to the left", -0.10, -0.05),
        ("shift the cyan cube over to the left about five centimetres", 0.0, -0.05),
        ("slide the cyan cube to the right by roughly 4 cm", 0.0, 0.04),
        ("can you move the cyan cube a little bit to the right, like four centimeters", 0.0, 0.04),
        ("move the cyan cube slightly to the left, 3 cm or so", 0.0, -0.03),
        ("move the cyan cube about an inch to the left", 0.0, -0.0254),
    ],
)
@pytest.mark.parametrize("viewpoint", ["human", "robot"])
def test_a_thing_moves_as_far_as_is_said(sentence, dx, dy, viewpoint):
    x, y, notes = moved(sentence, Scene(list(SCENE), viewpoint))
    side = dy if viewpoint == "human" else -dy  # the robot's left is opposite; "to me" and "to you" are not
    assert (x, y) == pytest.approx((dx, side), abs=0.006)
    assert not notes


def test_a_move_that_is_cut_short_is_told():
    x, y, notes = moved("move the cyan cube 15 cm closer to me")
    assert math.hypot(x, y) == pytest.approx(0.12, abs=0.006)
    assert any("12 cm, not 15" in note for note in notes)


def test_the_table_is_not_moved_and_nothing_else_instead():
    outcome = Dialogue().answer("put the table on top of the cubes", WORLD)
    assert isinstance(outcome, Refusal)
    assert "table" in outcome.text


@pytest.mark.parametrize(
    ("sentence", "gap"),
    [
        ("put the cyan cube 4 cm from the pink cube", 0.04),
        ("place the cyan cube at a distance of 6 cm from the pink one", 0.06),
        ("put the cyan cube next to the pink one with a gap of 3 cm", 0.03),
        ("set the cyan cube a hand's width away from the pink cube", 0.09),
    ],
)
def test_a_length_beside_a_thing_is_the_gap_between_the_two(sentence, gap):
    dx, dy, _ = moved(sentence)
    x, y = WORLD.things[0].x + dx - WORLD.things[1].x, WORLD.things[0].y + dy - WORLD.things[1].y
    assert math.hypot(x, y) - WORLD.things[0].width == pytest.approx(gap, abs=0.012)


@pytest.mark.parametrize(
    ("sentence", "distance"),
    [
        ("put the cyan cube to the left of the pink one, 7 cm center to center", 0.07),
        ("put the cyan cube 8 cm to the left of the pink one, measured from middle to middle", 0.08),
        ("put the cyan cube left of the pink one with a gap of 3 cm", 0.08),
        ("put the cyan cube left of the pink one, 3 cm apart", 0.08),
        ("put cyan to the left of pink, leaving 2 cm between them", 0.07),
        ("put the cyan cube next to the pink one at a distance of 4 cm", 0.09),
        ("put the cyan cube 5 cm from the pink one", 0.10),
    ],
)
def test_a_thing_stands_as_far_from_another_as_is_said(sentence, distance):
    x, y, _ = moved(sentence)
    at, other = (WORLD.things[0].x + x, WORLD.things[0].y + y), WORLD.things[1]
    assert math.dist(at, (other.x, other.y)) == pytest.approx(distance, abs=0.01)


def test_a_length_that_leaves_the_reach_is_refused_with_what_is_left_of_it():
    outcome = Dialogue().answer("move the cyan cube 90 cm away from you", WORLD)
    assert isinstance(outcome, Refusal)
    assert "my reach ends after 12 cm" in outcome.text.lower()

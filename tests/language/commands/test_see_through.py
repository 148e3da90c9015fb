"""See-through things in people's sentences: they mark places."""

import numpy as np
import pytest

from language import Dialogue, Object, Plan, Refusal, Scene, interpret

TABLE = Scene(
    [
        Object("cube", "red", (0.5, 0.15, 0.025)),
        Object("cube", "blue", (0.6, 0.0, 0.025)),
        Object("cube", "yellow", (0.6, -0.25, 0.025), role="target"),
        Object("cube", "orange", (0.4, 0.25, 0.025), role="target"),
    ]
)
MIDDLE = pytest.approx((0.5, 0.0))


@pytest.mark.parametrize(
    "place",
    [
        "between the see-through ones",
        "between the two transparent cubes",
        "between transparent ones",
        "in between both see through blocks",
        "between those two translucent things",
    ],
)
def test_a_place_between_see_through_things_is_their_middle(place):
    outcome = interpret(f"put the red cube {place}", TABLE)
    assert isinstance(outcome, Plan)
    assert outcome.steps[1].place == MIDDLE


def test_it_is_put_between_see_through_things_in_a_dialogue():
    dialogue = Dialogue()
    dialogue.answer("take the red cube", TABLE)
    outcome = dialogue.answer("put it between the two transparent cubes")
    assert [(step.verb, step.object) for step in outcome.steps] == [("pick_and_place", 0)]
    assert outcome.steps[0].place == MIDDLE


def test_a_see_through_thing_is_a_place_to_put_things_on():
    outcome = interpret("plz put the red cube on the yellow transparent one", TABLE)
    assert (outcome.steps[1].place, outcome.steps[1].goal) == ((0.6, -0.25), 2)


@pytest.mark.parametrize(
    "word", ["target", "goal", "target area", "target cube", "marked spot", "marker", "destination"]
)
@pytest.mark.parametrize("color", ["yellow", "orange"])
def test_a_target_is_a_see_through_thing(word, color):
    outcome = interpret(f"put the red cube on the {color} {word}", TABLE)
    place = {"yellow": ((0.6, -0.25), 2), "orange": ((0.4, 0.25), 3)}[color]
    assert (outcome.steps[1].place, outcome.steps[1].goal) == place


def test_a_target_without_a_colour_is_the_only_one():
    outcome = interpret("move the blue cube to the target", Scene(list(TABLE)[:3]))
    assert (outcome.steps[1].object, outcome.steps[1].place) == (1, (0.6, -0.25))


def test_a_thing_that_is_not_called_see_through_is_rather_solid():
    outcome = interpret("put the red cube on top of the other cube", TABLE)
    assert isinstance(outcome, Plan)
    assert outcome.steps[1].goal == 1


def test_a_see_through_thing_cannot_be_taken():
    outcome = interpret("pls take the orange see-through block", TABLE)
    assert isinstance(outcome, Refusal)
    assert "only marks a place" in outcome.text


@pytest.mark.parametrize(
    "command", ["put all cubes at", "sort every cube to", "gather both cubes at", "collect all cubes at"]
)
def test_of_several_things_brought_to_a_marked_place_the_others_go_beside_it(command):
    outcome = interpret(
        f"{command} the yellow target".replace("the yellow target", "the transparent yellow cube"), TABLE
    )
    assert isinstance(outcome, Plan)
    placed = {step.object: np.array(step.place) for step in outcome.steps if step.carries}
    assert set(placed) == {0, 1}
    assert all(step.goal in (None, 2) for step in outcome.steps)
    assert min(np.linalg.norm(place - (0.6, -0.25)) for place in placed.values()) == 0.0
    assert 0.06 < np.linalg.norm(placed[0] - placed[1]) < 0.13

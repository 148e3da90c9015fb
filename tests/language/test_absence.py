"""What shall be nowhere near a place: it is taken out, put on the table or moved to the other side."""

import pytest

from language import Dialogue, Object, Plan, Refusal, Scene, table
from language.verbs import ROOM

PLACES = {"red": (0.35, 0.15), "green": (0.44, 0.12), "blue": (0.36, -0.12), "pink": (0.45, -0.15)}


def world(inside=None, held=None, on=None):
    things = [Object("cube", color, (*at, 0.025)) for color, at in PLACES.items()]
    if on is not None:
        things[on] = Object("cube", "green", (*PLACES["red"], 0.075))
    for index in inside or ():
        things[index] = Object("cube", list(PLACES)[index], (0.46, -0.46, 0.03))
    room = Scene([*things, Object("drawer", "blue", (0.46, -0.46, 0.08))])
    return table(room, bounds=(0.3, 0.5, -0.2, 0.2), flat_only=True, verbs=ROOM, inside=inside or {}, held=held)


def steps(sentence, scene):
    outcome = Dialogue().answer(sentence, scene)
    assert isinstance(outcome, Plan), outcome
    return [(step.verb, step.object) for step in outcome.steps], outcome.result


@pytest.mark.parametrize(
    "sentence",
    [
        "there should be nothing in the drawer",
        "make sure nothing is left in the drawer",
        "no cube should be in the drawer",
        "i expect to find an empty drawer",
    ],
)
def test_what_is_in_a_container_that_should_hold_nothing_is_taken_out(sentence):
    done, after = steps(sentence, world(inside={0: 4}))
    assert ("take_out", 0) in done
    assert not after.contents(4)


@pytest.mark.parametrize("sentence", ["nothing should be on the red block", "no cube should stand on another"])
def test_what_stands_where_nothing_should_is_put_on_the_table(sentence):
    _, after = steps(sentence, world(on=1))
    assert after.above[0] is None


@pytest.mark.parametrize(
    ("sentence", "moved"),
    [
        ("see to it that no cube remains on the right half", {2, 3}),
        ("i want nothing on the left but the red cube", {1}),
    ],
)
def test_a_side_where_nothing_should_be_is_cleared_to_the_other_one(sentence, moved):
    done, _ = steps(sentence, world())
    assert {index for _, index in done} == moved


def test_a_gripper_that_should_be_empty_puts_down_what_it_holds():
    done, after = steps("your gripper should be empty again", world(held=0))
    assert after.held is None
    assert {index for _, index in done} == {0}


@pytest.mark.parametrize(
    ("sentence", "inside"),
    [
        ("the green block should be in the drawer and the red block should be on the table", {1: 4}),
        ("put the green cube in the drawer and the red one on the right", {1: 4}),
    ],
)
def test_what_fills_a_container_and_goes_elsewhere_is_taken_out_first(sentence, inside):
    done, after = steps(sentence, world(inside={0: 4}))
    assert done[:2] == [("open", 4), ("take_out", 0)]
    assert after.inside == inside


def test_what_fills_a_container_and_stays_there_is_told():
    outcome = Dialogue().answer("put the green cube in the drawer and touch the red one", world(inside={0: 4}))
    assert isinstance(outcome, Refusal)
    assert "full" in outcome.text


def test_no_before_a_command_is_no_absence():
    outcome = Dialogue().answer("no cube is red", world())
    assert not isinstance(outcome, Plan)


@pytest.mark.parametrize("sentence", ["turn on the fan", "turn the light on", "could you switch off the music"])
def test_a_device_that_is_not_here_is_not_taken_for_another_one(sentence):
    scene = table(Scene([Object("wheel", "red", (0.6, 0.0, 0.05)), Object("lever", "cyan", (0.6, 0.2, 0.05))]))
    outcome = Dialogue().answer(sentence, scene)
    assert isinstance(outcome, Refusal)
    assert sentence.split()[-1 if "light" not in sentence else 2] in outcome.text

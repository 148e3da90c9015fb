"""Where a thing goes, said in other orders of words than the plain ones: each way comes out as its plain sentence."""

import pytest

from language import Dialogue, Object, Plan, Scene, table
from language.normalise import normalised
from language.verbs import ROOM

SCENE = Scene(
    [
        Object("cube", "red", (0.36, 0.15, 0.025)),
        Object("cube", "blue", (0.45, -0.15, 0.025)),
        Object("cube", "green", (0.4, 0.0, 0.025)),
        Object("cube", "gray", (0.46, 0.12, 0.025), role="target"),
        Object("wheel", "green", (0.6, 0.05, 0.05)),
    ]
)


def world():
    return table(SCENE, bounds=(0.32, 0.48, -0.2, 0.2), flat_only=True, verbs=ROOM)


def done(sentence):
    """What is put where: the verb, the thing and the place of each step."""
    outcome = Dialogue().answer(sentence, world())
    assert isinstance(outcome, Plan), outcome
    return [
        (step.verb, step.object, step.place and tuple(round(each, 2) for each in step.place)) for step in outcome.steps
    ]


def words(sentence):
    return " ".join(token.text for token in normalised(sentence))


@pytest.mark.parametrize(
    ("sentence", "plain"),
    [
        ("put it in the corner that is far from you, on the right", "put it in far right corner of table"),
        ("put it in the left corner, the near one", "put it in near left corner of table"),
        ("put it in the table's near right corner", "put it in near right corner of table"),
        ("put it by the table edge on your side", "put it at near edge of table"),
        ("put it at the far end of the table, on the left", "put it at far left corner of table"),
        ("put it along the right edge", "put it at right edge of table"),
        ("push it inwards, towards you and also to the right", "push it towards you and to right"),
        ("push it both left and further away from you", "push it away from you and to left"),
        ("put it on the far side of the red one", "put it behind red one"),
        ("put it in front of the red cube, on the side facing you", "put it in front of red cube"),
        ("put it next to the red cube, on its left side", "put it to left of red cube"),
        ("from where you stand, put it behind red", "put it behind red"),
        ("put it near the, near the red cube", "put it near red cube"),
    ],
)
def test_places_are_said_in_one_order(sentence, plain):
    assert words(sentence) == plain


@pytest.mark.parametrize(
    "sentence",
    [
        "put it in the corner near the blue cube",
        "put it at the edge to the left of the blue cube",
        "put it in front of the red cube, away from you",
        "put it beside the red cube on the left side of the table",
        "move the left cube away from you",
        "put it at the left end of the table",
        "drag it from the edge, towards you",
    ],
)
def test_what_says_another_place_stays(sentence):
    assert words(sentence) == sentence.replace("the ", "").replace(",", " ,")


@pytest.mark.parametrize(
    ("sentence", "plain"),
    [
        ("the red cube is too far from the blue cube, bring it nearer", "move the red cube towards the blue cube"),
        ("green is too close to red. shift it away a bit", "move the green cube a bit away from the red cube"),
        ("the red cube is too far away from the blue one", "move the red cube towards the blue cube"),
        ("nudge red so it's a bit closer to you", "move the red cube a bit towards you"),
        ("make the distance between red and blue smaller", "move the red cube towards the blue cube"),
        ("I'd like the red one closer to the blue cube", "move the red cube closer to the blue cube"),
        ("I want the blue cube more to the left", "move the blue cube to the left"),
        ("I need the green cube at the table's right edge", "put the green cube at the right edge of the table"),
        ("behind the green cube, that's where red goes", "put the red cube behind the green cube"),
        ("near right corner, the blue cube", "put the blue cube in the near right corner"),
        ("the blue cube's place is next to the green cube", "put the blue cube next to the green cube"),
        ("take the blue cube to the far edge", "move the blue cube to the far edge of the table"),
        ("there is room between red and blue, put green there", "put the green cube between the red and blue cubes"),
        ("red goes to blue's side", "put the red cube next to the blue cube"),
        ("green should be two cm further left than it is now", "move the green cube two cm to the left"),
    ],
)
def test_wishes_and_reasons_come_out_as_commands(sentence, plain):
    assert done(sentence) == done(plain)


@pytest.mark.parametrize(
    ("sentence", "things"),
    [
        ("put the red cube next to the green cube and then the blue cube in the near right corner", [0, 1]),
        ("red beside green, then blue on red", [0]),
    ],
)
def test_each_of_two_things_has_its_own_place(sentence, things):
    assert [thing for verb, thing, _ in done(sentence) if verb == "pick_and_place"] == things


@pytest.mark.parametrize(
    "sentence",
    [
        "is the red cube in the corner that is far away on the left?",
        "if the red cube is too close to the blue cube, move it away",
        "the red cube is never too close to the blue cube, do not move it away",
        "where is the table's left edge?",
    ],
)
def test_questions_and_conditions_move_nothing(sentence):
    assert not isinstance(Dialogue().answer(sentence, world()), Plan)

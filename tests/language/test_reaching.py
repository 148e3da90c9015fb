"""What people say where the arm only goes to things: names alone, places, directions, and talk about it."""

import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal, table

CYLINDER, PURPLE, PINK = range(3)
SCENE = Scene(
    [
        Object("cylinder", "blue", (0.54, 0.07, 0.025)),
        Object("cube", "purple", (0.49, 0.22, 0.025)),
        Object("cube", "pink", (0.45, -0.07, 0.025)),
    ],
    "human",
)
WORLD = table(SCENE, verbs=("reach",))


def said(*sentences, pointed=()):
    """Say sentences one after another, and return the outcome of the last one. pointed: at that one."""
    dialogue = Dialogue()
    for sentence in sentences[:-1]:
        dialogue.answer(sentence, WORLD)
    return dialogue.answer(sentences[-1], WORLD, pointed)


@pytest.mark.parametrize(
    ("sentences", "reached"),
    [
        (["the leftmost object"], [PINK]),
        (["pink one"], [PINK]),
        (["the middle one"], [CYLINDER]),
        (["second from the left"], [CYLINDER]),
        (["reach the pink cube", "no, I meant the cylinder"], [CYLINDER]),
        (["take the pink cube", "this one"], [PINK]),
        (["not the pink one, the purple one"], [PURPLE]),
        (["touch the cubes but not the pink one"], [PURPLE]),
        (["first the pink cube then the purple cube"], [PINK, PURPLE]),
        (["purple cube then the cylinder", "no, the other way round"], [CYLINDER, PURPLE]),
        (["touch all of them, one after the other"], [CYLINDER, PURPLE, PINK]),
        (["reach the pink cube", "touch all of them"], [CYLINDER, PURPLE, PINK]),
        (["touch everything", "do it again"], [CYLINDER, PURPLE, PINK]),
        (["back to the pink one"], [PINK]),
    ],
)
def test_things_that_are_named_are_reached(sentences, reached):
    outcome = said(*sentences, pointed=[PINK] if sentences[-1] == "this one" else ())
    assert isinstance(outcome, Plan)
    assert [(step.verb, step.object) for step in outcome.steps] == [("reach", each) for each in reached]


@pytest.mark.parametrize("sentence", ["go there", "that thing over there", "over here"])
def test_a_place_that_is_shown_is_the_thing_there(sentence):
    assert [step.object for step in said(sentence, pointed=[PURPLE]).steps] == [PURPLE]


@pytest.mark.parametrize("sentence", ["go up", "a bit to the right", "move your arm up", "move left 10 cm"])
def test_a_direction_is_refused_with_the_things_that_can_be_reached(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal)
    assert "the purple cube" in outcome.text
    assert all(each.startswith("reach ") for each in outcome.suggestions)


@pytest.mark.parametrize("sentence", ["pick it up", "put the pink cube on the purple one", "put it on the cylinder"])
def test_what_needs_a_grip_is_refused_as_not_done_here(sentence):
    outcome = said("reach the pink cube", sentence)
    assert isinstance(outcome, Refusal)
    assert "only reach" in outcome.text


@pytest.mark.parametrize("sentence", ["go back", "come back", "undo"])
def test_the_way_back_from_a_thing_is_to_the_rest_position(sentence):
    outcome = said("reach the pink cube", sentence)
    assert isinstance(outcome, Signal)
    assert outcome.control == "home"


@pytest.mark.parametrize(
    "sentence",
    ["hello", "yo", "what can you do?", "what is this thing for?", "how does this work", "can you pick things up?"],
)
def test_only_what_can_be_done_is_offered(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Answer)
    assert "reach the blue cylinder" in outcome.text
    assert "pick up the" not in outcome.text


@pytest.mark.parametrize("sentence", ["what is this?", "where am I pointing?"])
def test_a_question_about_what_is_shown_is_answered_by_its_name(sentence):
    assert said(sentence, pointed=[PURPLE]).text.startswith("The purple cube")


def test_a_name_for_two_things_is_asked_about():
    outcome = said("the cube")
    assert isinstance(outcome, Question)
    assert set(outcome.candidates) == {PURPLE, PINK}


def test_whether_there_is_a_kind_of_thing_is_answered_by_its_name():
    assert said("is there a ball on the table").text == "No: there is no ball here."


@pytest.mark.parametrize("sentence", ["did that work?", "did it really work"])
def test_whether_it_worked_is_a_question_and_moves_nothing(sentence):
    assert said("reach the pink cube", sentence).text == "Yes: I did this: reach the pink cube."


@pytest.mark.parametrize("sentence", ["why are some of them see through?", "what are the transparent ones for?"])
def test_what_see_through_things_are_for_is_told(sentence):
    assert said(sentence).text == "Nothing here is see-through."


def test_that_something_was_not_seen_is_no_command():
    assert (
        said("reach the pink cube", "did that work? i couldnt see from here").text
        == "Yes: I did this: reach the pink cube."
    )
    assert not isinstance(said("reach the pink cube", "i can not see it"), Plan)


def test_there_is_what_was_told_last():
    outcome = said("which one is closest to me?", "go there")
    assert isinstance(outcome, Plan)
    assert [step.object for step in outcome.steps] == [CYLINDER]


@pytest.mark.parametrize("sentence", ["now move to the left", "go left", "move left please"])
def test_the_arm_itself_goes_to_no_side(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal)
    assert "no direction" in outcome.text


def test_the_other_side_is_meant_after_a_correction():
    outcome = said("go to the thing on the far right", "sorry i meant the far left")
    assert [step.object for step in outcome.steps] == [PINK]

"""What people say that asks for nothing, and what they say about what has just happened."""

from dataclasses import replace

import pytest

from language import Answer, Dialogue, Plan, Question, Refusal, Signal
from tests.helpers.room_cases import BLUE, BUTTON, DRAWER, LEVER, RED, YELLOW, room


def after(*turns, world=None, ending=""):
    """The outcome of the last of some turns. ending: how far the plan of the first ones came."""
    dialogue, world = Dialogue(), world or room()
    for turn in turns[:-1]:
        dialogue.answer(turn, world)
        world = dialogue.world
    if ending:
        dialogue.ended(ending)
    return dialogue.answer(turns[-1], world)


@pytest.mark.parametrize(
    "said",
    [
        "thanks, youre pretty good at this!",
        "that was amazing",
        "I like how you do that",
        "what a clever robot you are",
        "how cute",
        "you look tired",
        "it works very well, doesn't it?",
    ],
)
def test_an_opinion_moves_nothing_also_with_something_in_the_gripper(said):
    assert isinstance(after("pick up the red cube", said), Answer)


@pytest.mark.parametrize("said", ["you dropped it", "oh no, it fell down", "nothing happened", "you did not do it"])
def test_what_is_told_of_a_plan_is_answered_with_what_is_so(said):
    outcome = after("put the red cube on the blue one", said)
    assert isinstance(outcome, Answer)
    assert outcome.text == (
        "I did this: put the red cube on the blue cube. Now the red cube is on top of the blue cube"
    )


@pytest.mark.parametrize(
    "said",
    [
        "you opened the wrong drawer last week",
        "they say the wheel used to turn more easily",
        "you nearly dropped it, you know",
        "could two cubes stand in the drawer side by side?",
    ],
)
def test_what_happened_long_ago_or_might_be_so_moves_nothing(said):
    assert isinstance(after("pick up the red cube", said), Answer)


@pytest.mark.parametrize("said", ["did you do it?", "did that work?", "have you managed to do it"])
def test_whether_a_plan_was_carried_out_is_told_as_it_is(said):
    turns = "open the drawer", said
    assert after(*turns).text.startswith("Yes")
    ending = "I did not open the drawer (out of time)"
    assert after(*turns, ending=ending).text.startswith(f"No: {ending}")


@pytest.mark.parametrize("said", ["why did that not work?", "what did you do?", "it did not work"])
def test_after_a_step_that_failed_the_answer_says_so(said):
    assert "wrong object" in after("pick up the red cube", said, ending="I did not pick it up (wrong object)").text


@pytest.mark.parametrize("said", ["you took the wrong one", "that was the wrong cube"])
def test_after_a_wrong_one_the_right_one_is_asked_for(said):
    assert isinstance(after("pick up the red cube", "what do you hold?", said), Question)


@pytest.mark.parametrize(
    "said", ["you should put it on the blue one", "I want it on the blue one", "it belongs on blue"]
)
def test_a_wish_is_no_opinion(said):
    outcome = after("pick up the red cube", said)
    assert isinstance(outcome, Plan)
    assert (outcome.steps[-1].object, outcome.steps[-1].goal) == (RED, BLUE)


# ---- Back to the beginning

MOVES = "put the red cube on the blue one", "put the yellow cube in the drawer"


@pytest.mark.parametrize(
    "said", ["put everything back to how it was in the beginning", "undo everything", "reset the table"]
)
def test_everything_goes_back_to_where_it_was_at_first(said):
    world = room()
    outcome = after(*MOVES, said, world=world)
    assert isinstance(outcome, Plan)
    assert outcome.result.open == world.open
    assert not outcome.result.inside
    for index in (RED, YELLOW, BLUE):
        assert outcome.result.things[index][2:4] == pytest.approx(world.things[index][2:4])


def test_a_thing_goes_back_to_where_it_was_at_first_not_before_it_moved_last():
    world = room()
    outcome = after(
        "put the red cube on the blue one", "put it on the yellow one", "put the red one back where it was at the start"
    )
    assert isinstance(outcome, Plan)
    assert outcome.steps[-1].place == pytest.approx(world.things[RED][2:4])


def test_things_that_changed_places_change_back_by_way_of_a_free_spot():
    world = room()
    outcome = after("swap the red cube and the blue cube", "put everything back as it was at first", world=world)
    assert isinstance(outcome, Plan)
    for index in (RED, BLUE):
        assert outcome.result.things[index][2:4] == pytest.approx(world.things[index][2:4])


def test_where_nothing_has_moved_nothing_goes_back():
    assert isinstance(after("put everything back to how it was in the beginning"), Answer)


# ---- Heights, corrections and going on


@pytest.mark.parametrize("held", [None, RED])
@pytest.mark.parametrize("said", ["a bit higher", "move it higher", "higher please"])
def test_no_height_can_be_said(said, held):
    assert isinstance(after("touch the blue cube", said, world=room(held=held)), Refusal)


@pytest.mark.parametrize(
    "said", ["no wait, the far left corner", "stop! the far left corner", "hold on, in the far left corner"]
)
def test_a_place_alone_corrects_where_the_thing_goes(said):
    world = room()
    dialogue = Dialogue()
    dialogue.answer("put the red cube in the near right corner", world)
    outcome = dialogue.answer(said, world)  # nothing has moved yet
    assert isinstance(outcome, Plan)
    assert outcome.steps[-1].object == RED
    assert outcome.steps[-1].place[0] > 0.42
    assert outcome.steps[-1].place[1] > 0.1


@pytest.mark.parametrize("said", ["ok keep going", "yes go ahead", "finish what you started", "go on with the plan"])
def test_what_was_stopped_goes_on(said):
    outcome = after("open the drawer and then press the button", "stop", said)
    assert isinstance(outcome, Signal)
    assert outcome.control == "continue"


# ---- Questions


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("whre is the red cube?", "red cube is on the table"),
        ("hwo many cubes are there", "three"),
        ("what's that gray thing over there?", "gray button"),
        ("what shape is the red one?", "cube"),
        ("how many square things do you see", "three"),
        ("are you a real robot or is this just a simulation?", "simulated"),
        ("did you close it again?", "No"),
        ("what does the red cube stand on?", "on the table"),
        ("is the red cube left or right of the yellow one?", "The red cube is left of the yellow cube"),
        ("is the drawer open or closed?", "The blue drawer is open"),
        ("what do you have in the drawer?", "Nothing is in the drawer"),
    ],
)
def test_a_question_is_answered_by_what_is_so(asked, words):
    assert words in after("open the drawer", asked).text


def test_the_top_of_a_tower_is_the_highest_thing():
    turns = "put the red cube on the blue one", "is the red cube at the top?"
    assert after(*turns).text.startswith("Yes")
    assert after(turns[0], "is blue at the top of the tower?").text.startswith("No")
    outcome = after(turns[0], "pick up the topmost cube")
    assert [step.object for step in outcome.steps] == [RED]


def test_what_would_look_nicer_is_a_wish():
    outcome = after("it would look nicer if the red cube stood on the blue one")
    assert [(step.verb, step.object, step.goal) for step in outcome.steps][-1] == ("stack", RED, BLUE)


def test_a_list_after_all_of_something_names_each_once():
    outcome = after("press all of these controls: button and lever", world=room(moved={}))
    assert [(step.verb, step.object) for step in outcome.steps] == [("press", BUTTON), ("switch", LEVER)]


def test_what_is_under_a_thing_is_named_as_such():
    outcome = after("put the red cube on the blue one", "what is under the red cube?")
    assert outcome.text == "The blue cube is under the red cube."


def test_what_a_gesture_shows_is_named_and_the_drawer_was_not_meant():
    world = replace(room(), open=frozenset({DRAWER}))
    assert "yellow cube" in Dialogue().answer("what is this thing here?", world, [YELLOW]).text

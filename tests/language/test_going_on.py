"""Turns that say only what is different: another side, another thing, the same once it is possible, or nothing."""

import math

import pytest

from language import Answer, Plan, Question, Signal
from tests.helpers.room_cases import (
    BLUE,
    BUTTON,
    CYAN,
    DRAWER,
    FRIDGE,
    ORANGE,
    RED,
    YELLOW,
    asked_steps,
    larger_room,
    outcome_of,
    room,
)


def put(turns, world=None):
    """The step of the last turn that puts something somewhere."""
    outcome = outcome_of(turns, world or larger_room())
    assert isinstance(outcome, Plan), outcome
    return [step for step in outcome.steps if step.carries][-1]


@pytest.mark.parametrize(
    ("turns", "thing"),
    [
        ("put the red cube left of the yellow one / and the blue one on the other side", BLUE),
        ("put the red cube left of the yellow one / now blue on the other side of yellow", BLUE),
        ("put the red cube left of the yellow one / put blue at the same distance on the other side", BLUE),
        ("put the red cube left of the yellow one / put it on the opposite side of the yellow cube", RED),
        ("put the red cube left of the yellow one / same with blue, right side", BLUE),
        ("put the red cube left of the yellow one / the same with blue but on the right of it", BLUE),
        ("put the red cube left of the yellow one / the same with blue, on the other side", BLUE),
    ],
)
def test_the_other_side_is_across_from_what_was_put_down_last(turns, thing):
    step, yellow = put(turns), larger_room().things[YELLOW]
    assert step.object == thing
    assert step.place[1] < yellow.y - 0.04
    assert abs(step.place[0] - yellow.x) < 0.06


def test_the_other_side_of_the_thing_that_moved_is_across_from_what_it_stands_beside():
    step = put("put the yellow cube right of the red one / now the orange one on the other side of yellow")
    assert step.object == ORANGE
    assert step.place[1] < larger_room().things[RED].y - 0.1


@pytest.mark.parametrize("turn", ["good, now you can do it", "now do it", "now try again", "OK then do it now please"])
def test_what_was_refused_is_done_when_it_has_become_possible(turn):
    world = room(inside={RED: DRAWER}, open=frozenset([DRAWER]))
    step = put(f"put the yellow cube in the drawer / then take the red one out of there / {turn}", world)
    assert (step.object, step.goal) == (YELLOW, DRAWER)


@pytest.mark.parametrize(
    "turn", ["not that one either", "no, not orange after all. another one", "hm, not the orange one after all"]
)
def test_what_was_used_is_taken_back_for_one_that_is_asked_for(turn):
    before = f"open the drawer / put the orange cube in it / {turn}"
    asked = outcome_of(before, larger_room())
    assert isinstance(asked, Question)
    assert set(asked.candidates) == {YELLOW, BLUE, RED, CYAN}
    outcome = outcome_of(f"{before} / cyan will do", larger_room())
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(ORANGE, None), (CYAN, DRAWER)]


def test_the_same_with_another_thing_and_another_container():
    outcome = outcome_of("put yellow in the fridge and close it / and the same with red and the drawer")
    assert [step.object for step in outcome.steps if step.object in (DRAWER, FRIDGE)] == [DRAWER, DRAWER]


@pytest.mark.parametrize(
    ("sentence", "goal"),
    [
        ("put red on the yellow, ehm, on the blue one", BLUE),
        ("put red on the yellow one... uh, on the blue one", BLUE),
        ("put red in the fridge, no, in the drawer", DRAWER),
        ("put red on the, um, the blue one", BLUE),
    ],
)
def test_a_phrase_that_is_said_anew_replaces_the_one_before(sentence, goal):
    assert put(sentence, room()).goal == goal


@pytest.mark.parametrize(
    "sentence",
    [
        "red on top of blue, or wait, leave it where it is",
        "put red on blue, no wait, leave it",
        "put red on blue, actually don't",
        "put red in the drawer. no, never mind",
    ],
)
def test_a_command_that_is_taken_back_is_not_carried_out(sentence):
    assert isinstance(outcome_of(sentence), Answer)


def test_what_is_left_open_or_put_down_is_not_taken_back():
    assert asked_steps(outcome_of("open the drawer and leave it open")) == [("open", DRAWER)]
    assert put("put the red cube on the blue one, but leave it there", room()).goal == BLUE


@pytest.mark.parametrize(
    ("turns", "names"),
    [
        ("I should now like to know which cubes remain on the table.", ["yellow", "red"]),
        ("Wonderful. Can you tell the class where the red cube is?", ["red cube"]),
        ("Could you tell my students which containers are closed?", ["drawer", "fridge"]),
        ("put red next to yellow / Which one of the two did you move last?", ["red"]),
        ("put red next to yellow / good. which one is it next to now?", ["yellow"]),
        ("put red on yellow / how many are still standing on their own?", ["one (1): the blue cube"]),
        ("put red on yellow / which cubes have nothing on top and nothing under them?", ["blue cube"]),
        ("give me the cube / which ones do you have?", ["yellow", "blue", "red"]),
    ],
)
def test_questions_of_a_conversation_are_answered(turns, names):
    outcome = outcome_of(turns)
    assert isinstance(outcome, Answer), outcome
    assert all(name in outcome.text for name in names), outcome.text


@pytest.mark.parametrize(
    "sentence",
    [
        "In that case I should like you to open the drawer, if it is no trouble.",
        "Very kind of you. Do open the drawer.",
    ],
)
def test_long_polite_forms_ask_for_the_same(sentence):
    assert asked_steps(outcome_of(sentence)) == [("open", DRAWER)]


def test_a_container_that_need_not_be_open_is_closed():
    world = room(open=frozenset([DRAWER]))
    for sentence in ("and that drawer doesn't need to be open, does it", "it doesn't have to stay open"):
        assert asked_steps(outcome_of(f"is the drawer open? / {sentence}", world)) == [("close", DRAWER)]


def test_a_reason_before_it_does_not_hide_that_the_arm_may_go_on():
    outcome = outcome_of("give me the red cube / stop / sorry, he had his fingers in there. you can go on")
    assert outcome.control == "continue"


def test_what_is_left_as_it_is_is_spoken_of():
    turns = "put blue on yellow / and red on top of yellow, or wait, leave it where it is / put it in the drawer"
    assert put(turns, room()).object == RED


def test_the_other_things_are_all_but_the_one_that_is_held():
    outcome = outcome_of("take the red cube / which of the others is nearest to the drawer?", room())
    assert outcome.about == (BLUE,)


def test_a_thing_on_nothing_that_was_spoken_of_is_asked_about_and_on_itself_refused():
    assert isinstance(outcome_of("put the yellow cube on it"), Question)
    assert "itself" in outcome_of("stack the red cube on itself").text


def test_how_much_nearer_something_is_is_told_after_a_comparison():
    outcome = outcome_of("which is nearer to the yellow cube, blue or red? / by how much roughly?")
    assert isinstance(outcome, Answer)
    assert "cm" in outcome.text


def test_what_was_taken_back_is_meant_after_all():
    step = put("take red / put it on the yellow, ehm, on the blue one / no, I did mean yellow, sorry", room())
    assert (step.object, step.goal) == (RED, YELLOW)


def test_what_is_left_out_of_a_question_is_not_among_what_there_is():
    text = outcome_of("are there any cubes apart from the red one?").text
    assert "yellow cube" in text
    assert "red cube" not in text
    assert "blue cube" in outcome_of("give me the red cube / what else is there to play with?").text


@pytest.mark.parametrize(
    ("turn", "goal"),
    [("on top", YELLOW), ("now on top of it please", YELLOW), ("behind", None), ("no, in front", None)],
)
def test_a_bare_relation_is_to_the_thing_that_the_last_one_was_put_beside(turn, goal):
    step, yellow = put(f"put the orange cube left of the yellow one / {turn}"), larger_room().things[YELLOW]
    assert (step.object, step.goal) == (ORANGE, goal)
    assert math.hypot(step.place[0] - yellow.x, step.place[1] - yellow.y) < 0.1


@pytest.mark.parametrize(
    ("first", "then"),
    [
        ("put the contents of the fridge on the table", "same for the drawer"),
        ("close the fridge but take the cube out first", "now the same thing with the drawer"),
    ],
)
def test_the_same_for_another_container_is_done_with_what_is_in_it(first, then):
    full = "put the red cube in the drawer / put the yellow cube in the fridge"
    assert put(f"{full} / {first} / {then}").object == RED


def test_another_pair_is_swapped_after_a_swap():
    outcome = outcome_of("swap the yellow and the orange cube / now red with the cyan one", larger_room())
    assert {object_ for _, object_ in asked_steps(outcome)} == {RED, CYAN}


@pytest.mark.parametrize(
    ("turns", "steps"),
    [
        ("can you pick things up? / show me with the orange one", [("lift", ORANGE)]),
        ("what does that gray button do? / try it", [("press", BUTTON)]),
        ("did you open the drawer? / please do", [("open", DRAWER)]),
        ("is the drawer open? / yes please do", [("open", DRAWER)]),
    ],
)
def test_what_a_question_was_about_is_done_when_the_person_says_so(turns, steps):
    assert asked_steps(outcome_of(turns, larger_room())) == steps


def test_what_is_in_a_closed_container_is_shown_by_opening_it():
    outcome = outcome_of("where is the red cube? / could you show me?", room(inside={RED: DRAWER}))
    assert asked_steps(outcome) == [("open", DRAWER)]


@pytest.mark.parametrize(
    "turn", ["put everything back like before", "ok enough, back to where it started", "put everything back as before"]
)
def test_what_goes_back_to_where_it_started_goes_to_where_it_was_at_first(turn):
    turns = f"put the orange cube left of the yellow one / now on top / {turn}"
    step, orange = put(turns), larger_room().things[ORANGE]
    assert (step.object, step.goal) == (ORANGE, None)
    assert math.dist(step.place[:2], (orange.x, orange.y)) < 0.005


def test_between_them_is_between_the_two_things_other_than_the_one_that_moves():
    world = larger_room()
    step = put("put orange between red and yellow / closer to the red one / put it back in between them", world)
    red, yellow = world.things[RED], world.things[YELLOW]
    middle = (red.x + yellow.x) / 2, (red.y + yellow.y) / 2
    assert math.dist(step.place[:2], middle) < 0.03


def test_what_stays_is_not_done_again_for_one_thing_more():
    turns = "put the yellow and the cyan cube on the right side / hm ok, red too then"
    assert {object_ for _, object_ in asked_steps(outcome_of(turns, larger_room()))} == {RED}


def test_a_place_that_was_better_is_gone_back_to():
    outcome = outcome_of("put the orange cube in the drawer / hmm no the first place was better", larger_room())
    assert isinstance(outcome, Signal)
    assert outcome.control == "undo"
    assert outcome.steps


def test_the_first_thing_that_was_asked_is_told_and_so_is_what_was_left_alone():
    turns = "put the orange cube on the red one / press the button"
    first = outcome_of(f"{turns} / what was the first thing i asked you to do?", larger_room())
    assert first.text == 'You said: "put the orange cube on the red one".'
    assert outcome_of(f"{turns} / did you leave the yellow one alone?", larger_room()).text.startswith("Yes: I have")
    assert outcome_of(f"{turns} / did you leave the orange one alone?", larger_room()).text.startswith("No, I moved")


@pytest.mark.parametrize("turn", ["no on the other side of it", "no, on the other side of it"])
def test_what_was_held_is_put_on_the_other_side_of_what_it_was_put_beside(turn):
    step = put(f"put that on the table next to the yellow one / {turn}", room(held=RED))
    assert step.object == RED
    assert step.place[1] < room().things[YELLOW].y - 0.04


def test_a_colour_that_was_wrong_is_replaced_where_it_was_said():
    step = put("put the thing you're holding on the blue cube / oops, not blue, I meant red", room(held=YELLOW))
    assert (step.object, step.goal) == (YELLOW, RED)


@pytest.mark.parametrize("turn", ["i'd like to have it", "give it to me", "take it out"])
def test_of_a_container_that_was_opened_what_is_in_it_is_meant(turn):
    outcome = outcome_of(f"open the drawer / {turn}", room(inside={RED: DRAWER}))
    assert (outcome.steps[0].verb, outcome.steps[0].object) == ("take_out", RED)


def test_it_is_what_is_in_the_container_that_it_is_taken_out_of():
    world = room(inside={YELLOW: FRIDGE}, open=frozenset([FRIDGE]))
    outcome = outcome_of("did you put the red one in the fridge? / take it out and put the red one in", world)
    assert (outcome.steps[0].verb, outcome.steps[0].object) == ("take_out", YELLOW)
    assert asked_steps(outcome)[-1] == ("put_in", RED)


def test_the_one_on_top_goes_on_what_was_put_down_last():
    step = put("put the red cube in the middle / ok leave it. and now the yellow one on top")
    assert (step.object, step.goal) == (YELLOW, RED)


def test_nothing_is_taken_out_of_a_container_that_has_nothing_in_it():
    outcome = outcome_of("open the fridge / if there is something inside take it out", larger_room())
    assert isinstance(outcome, Answer)
    assert "nothing" in outcome.text

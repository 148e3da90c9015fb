"""Conversations in a room: answers, corrections, what "it" and "the other one" mean, elliptic questions, small talk."""

import pytest

from language import Answer, Object, Plan, Question, Refusal, Scene, Signal, table
from language.verbs import ROOM
from tests.helpers.room_cases import outcome_of as outcome_in

NAMES = ("yellow", "blue", "red", "cyan", "drawer", "fridge", "wheel", "lever", "button", "hand")
YELLOW, BLUE, RED, CYAN, DRAWER, FRIDGE, WHEEL, LEVER, BUTTON, HAND = range(10)
OBJECTS = [
    Object("cube", "yellow", (0.34, 0.0, 0.025)),
    Object("cube", "blue", (0.44, -0.18, 0.025)),
    Object("cube", "red", (0.37, 0.18, 0.025)),
    Object("cube", "cyan", (0.46, 0.05, 0.025)),
    Object("drawer", "blue", (0.46, -0.46, 0.08)),
    Object("fridge", "red", (0.27, 0.46, 0.1)),
    Object("wheel", "red", (0.63, 0.03, 0.056), 0.07),
    Object("lever", "cyan", (0.62, -0.14, 0.066), 0.07),
    Object("button", "gray", (0.58, 0.18, 0.058), 0.07),
    Object("palm", "pink", (0.57, -0.45, 0.15)),
]


def room(**facts):
    fields = {"bounds": (0.32, 0.47, -0.21, 0.21), "flat_only": True, "verbs": ROOM, "moved": {LEVER: 1.0}}
    return table(Scene(OBJECTS), **{**fields, **facts})


def outcome_of(turns, world=None):
    return outcome_in(turns, world or room())


def steps(turns, world=None):
    outcome = outcome_of(turns, world)
    assert isinstance(outcome, Plan | Signal), outcome
    return [(step.verb, NAMES[step.object]) for step in outcome.steps]


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("put something in the drawer / hmm let me think... red I guess", [("lift", "red"), ("put_in", "red")]),
        ("move the blue cube / closer to the yellow one", [("lift", "blue"), ("pick_and_place", "blue")]),
        ("red cube / pick it up", [("lift", "red")]),
        ("open it / the cold one", [("open", "fridge")]),
        ("open it / not the fridge", [("open", "drawer")]),
    ],
)
def test_a_reply_fills_what_was_left_open(turns, expected):
    assert steps(turns, room(open=frozenset({DRAWER})) if "something" in turns else None) == expected


@pytest.mark.parametrize(
    ("turns", "last"),
    [
        ("pick up the red cube / nooo i said BLUE", ("lift", "blue")),
        ("pick up the cube on the left / I meant the one on the right", ("lift", "blue")),
        ("open the fridge / not the fridge, the drawer!", ("open", "drawer")),
        ("open the fridge / that's the fridge, I wanted the drawer", ("open", "drawer")),
        ("put the red cube on the blue one / sorry, I meant the yellow cube on the blue one", ("stack", "yellow")),
        ("put the red cube on the blue one / other way round please", ("stack", "blue")),
    ],
)
def test_a_correction_is_carried_out_if_need_be_after_undoing(turns, last):
    assert steps(turns)[-1] == last


@pytest.mark.parametrize(
    ("turns", "expected"),
    [
        ("open the drawer / now the other one", [("open", "fridge")]),
        ("open the drawer / close it and open the other", [("close", "drawer"), ("open", "fridge")]),
        ("touch blue / and the yellow too", [("reach", "yellow")]),
        ("turn the wheel / do that two more times", [("turn", "wheel")] * 2),
        ("put red on yellow / take it down and give it to me", [("lift", "red"), ("hand_over", "red")]),
        ("put red on blue / and now the same with yellow and cyan", [("lift", "yellow"), ("stack", "yellow")]),
    ],
)
def test_it_and_the_other_one_and_the_same_refer_to_what_was_spoken_of(turns, expected):
    assert steps(turns) == expected


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        ("what's in the drawer? / and in the fridge?", "yellow cube is in the red fridge"),
        ("is the drawer open? / and the fridge?", "No: the red fridge is closed"),
        ("which cubes aren't on the table?", "yellow cube is in the red fridge"),
        ("do the drawer and the fridge both have something inside", "No: nothing is in the blue drawer"),
        ("is the red cube left of the blue cube?", "Yes"),
        ("is blue nearer to you than red?", "No"),
        ("what color are the lever and the wheel?", "the red wheel is red"),
        ("lever - what color does it have", "The cyan lever is cyan"),
        ("put the red cube in the drawer / is it still in there?", "Yes: the red cube is in the blue drawer"),
        ("could the red cube go in the fridge?", "No: the red fridge is full"),
    ],
)
def test_a_question_states_something_of_its_subject(turns, words):
    outcome = outcome_of(turns, room(inside={YELLOW: FRIDGE}))
    assert isinstance(outcome, Answer), outcome
    assert words in outcome.text


@pytest.mark.parametrize(
    ("turns", "control"),
    [
        ("stop it right now you stupid machine", "stop"),
        ("turn the wheel / stop turning", "stop"),
        ("FREEZE don't move!!!", "stop"),
        ("go back to your start position", "home"),
        ("put red on blue / nah leave it like it was before", "undo"),
        ("put red on blue / wrong way!", "undo"),
        ("you're so slow", "faster"),
    ],
)
def test_signals_are_composed_of_phrases(turns, control):
    outcome = outcome_of(turns)
    assert isinstance(outcome, Signal), outcome
    assert outcome.control == control


@pytest.mark.parametrize(
    "turns", ["wow good job!!", "bye bye, see you tomorrow", "I'm bored", "hello, how are you today?"]
)
def test_small_talk_is_answered(turns):
    assert isinstance(outcome_of(turns), Answer)


def test_undo_turns_a_lever_back_and_says_that_a_button_stays_down():
    assert steps("flip the lever / undo") == [("switch", "lever")]
    outcome = outcome_of("press the button / undo")
    assert isinstance(outcome, Refusal)
    assert "button stays down" in outcome.text


def test_a_word_that_is_left_out_after_a_preposition_is_no_reason_to_act():
    world = room(held=YELLOW)
    assert isinstance(outcome_of("put it on the cyan one / and red on top of that", world), Refusal | Question)


# ---- What is asked since, what is pointed at, and where things were


def test_a_correction_after_a_question_takes_up_nothing_older():
    turns = "put the red cube in the drawer / close it / take the cube / no wait, the yellow one"
    assert steps(turns) == [("lift", "yellow")]


@pytest.mark.parametrize("said", ["that one", "this one", "this", "that one please", "yes, that one", "take this"])
def test_what_nobody_points_at_is_asked_about(said):
    assert isinstance(outcome_of(said), Question)
    assert isinstance(outcome_of(f"open it / {said}"), Question)


def test_the_answer_to_which_thing_is_meant_completes_the_sentence():
    assert steps("take this / the red cube") == [("lift", "red")]
    assert steps("put it in the drawer / the yellow one")[-1] == ("put_in", "yellow")


@pytest.mark.parametrize(
    ("turns", "goal"),
    [
        ("put the red cube on the blue one / take it off / put it back on", "blue"),
        ("put the red cube on the blue one / take it off and put it on the table / now back on again", "blue"),
        ("open the drawer / put the cyan cube in it / take it out / put it back", "drawer"),
    ],
)
def test_a_thing_goes_back_to_where_it_was_last(turns, goal):
    assert NAMES[outcome_of(turns).steps[-1].goal] == goal


def test_back_where_it_was_is_the_place_before_the_last_move():
    outcome = outcome_of("put the red cube in the fridge and close it / put it back where it was")
    assert outcome.steps[-1].place == OBJECTS[RED].position[:2]


def test_what_has_not_moved_is_where_it_was():
    outcome = outcome_of("put the red cube back where it was")
    assert isinstance(outcome, Refusal)
    assert outcome.reason == "already"


def test_a_small_move_is_undone():
    outcome = outcome_of("move the red cube a tiny bit to the left / undo")
    assert outcome.steps[-1].place == OBJECTS[RED].position[:2]

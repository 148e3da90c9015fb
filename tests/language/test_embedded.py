"""Questions that are asked within others, and what a conversation asks with few words."""

import pytest

from language import Answer, Plan, Refusal
from language.embedded import direct
from tests.helpers.room_cases import BLUE, RED, larger_room, outcome_of, room


@pytest.mark.parametrize(
    ("sentence", "asked"),
    [
        ("tell me whether the fridge is open", "is the fridge open"),
        ("could you check if the button is pressed", "is the button pressed"),
        ("do you know what you just did", "what did you do"),
        ("tell me why you can not do that", "why can you not do that"),
        ("any idea what the drawer contains", "what is in the drawer"),
        ("drawer closed?", "is drawer closed?"),
    ],
)
def test_a_question_within_another_is_asked_directly(sentence, asked):
    assert direct(sentence) == asked


@pytest.mark.parametrize(
    "sentence", ["check if it is open and close it", "see if you can reach it", "open the drawer?"]
)
def test_a_command_is_no_question(sentence):
    assert direct(sentence).rstrip(" ?") == sentence.rstrip("?")


@pytest.mark.parametrize(
    "asked", ["where's red", "where is the red one", "tell me where the red one is", "where is red?"]
)
def test_a_colour_alone_asks_for_the_cube(asked):
    outcome = outcome_of(asked, larger_room())
    assert isinstance(outcome, Answer)
    assert outcome.about == (RED,)


def test_what_was_refused_is_asked_about():
    full = room(inside={RED: 3}, open={3})
    told = [
        outcome_of(f"put the blue cube in the drawer / {why}", full).text
        for why in ("why not", "why can't you do that", "tell me why you can't put it in there")
    ]
    assert len({*told}) == 1
    assert "is full" in told[0]


@pytest.mark.parametrize(
    "wish", ["I want the red one", "I'd go for the red one", "use red for that", "red would be good"]
)
def test_a_wish_answers_a_question(wish):
    outcome = outcome_of(f"touch the cube / {wish}")
    assert isinstance(outcome, Plan)
    assert [(step.verb, step.object) for step in outcome.steps] == [("reach", RED)]


@pytest.mark.parametrize("noun", ["the cube", "I mean the cube", "not the drawer, the cube"])
def test_a_noun_keeps_the_colour_of_something(noun):
    assert [step.object for step in outcome_of(f"touch something blue / {noun}").steps] == [BLUE]


def test_what_is_in_the_drawer_is_in_it_already():
    outcome = outcome_of("put the red cube in the drawer", room(inside={RED: 3}, open={3}))
    assert isinstance(outcome, Refusal)
    assert outcome.reason == "already"


@pytest.mark.parametrize(
    "asked",
    ["should I take it out again?", "should it go in the fridge?", "could it go in the fridge, would that work?"],
)
def test_what_might_be_done_is_asked_and_not_done(asked):
    outcome = outcome_of(f"open the drawer / put the red cube in the drawer / {asked}")
    assert isinstance(outcome, Answer)
    assert "do it" in outcome.text

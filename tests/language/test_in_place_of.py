"""What is done again, undone, or done with another thing that takes the place of the first."""

import pytest

from language import Plan, Refusal, Signal
from tests.helpers.room_cases import (
    BLUE,
    DRAWER,
    FRIDGE,
    HAND,
    LEVER,
    RED,
    YELLOW,
    asked_steps,
    outcome_of,
    room,
)

STORED = "open the fridge and put the blue cube in it / "


@pytest.mark.parametrize(
    "turn",
    [
        "I meant the red one",
        "the red one instead",
        "make that red",
        "red would be better",
        "I'd have preferred the red one",
        "I would rather have had the red one in it",
        "put red in instead",
        "put the red one in there instead",
        "replace it with the red one",
        "swap it for the red one",
        "I'd rather have the red one in there",
    ],
)
def test_what_was_put_away_comes_out_for_what_is_preferred(turn):
    outcome = outcome_of(STORED + turn)
    assert isinstance(outcome, Plan)
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(BLUE, None), (RED, FRIDGE)]
    assert [step for step in outcome.steps if step.object == FRIDGE] == []  # it stays open


@pytest.mark.parametrize("turn", ["the red one too", "and red as well", "also the red one", "now red"])
def test_one_more_thing_takes_no_place(turn):
    assert isinstance(outcome_of(STORED + turn), Refusal)


@pytest.mark.parametrize("turn", ["swap it for the red one", "exchange it for red", "no, change that for the red cube"])
def test_what_was_given_is_put_back_for_another_thing(turn):
    outcome = outcome_of(f"give me the blue cube / {turn}")
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(BLUE, None), (RED, HAND)]


@pytest.mark.parametrize("turn", ["take it back", "okay, I have had enough, take it back"])
def test_what_lies_on_the_hand_is_taken_back_whatever_was_done_since(turn):
    outcome = outcome_of(f"give me the blue cube / open the drawer / {turn}")
    assert [step.object for step in outcome.steps if step.carries] == [BLUE]


def test_another_thing_goes_on_the_same_one_instead():
    outcome = outcome_of("stack blue on yellow / put red on it instead")
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(BLUE, None), (RED, YELLOW)]


def test_the_same_thing_goes_elsewhere_at_once():
    outcome = outcome_of("stack blue on yellow / put it on red instead")
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(BLUE, RED)]


@pytest.mark.parametrize("turn", ["redo", "redo it", "do it again after all", "undo the undo"])
def test_what_was_undone_is_done_again(turn):
    outcome = outcome_of(f"put red on yellow / undo / {turn}")
    assert isinstance(outcome, Plan)
    assert (outcome.steps[-1].object, outcome.steps[-1].goal) == (RED, YELLOW)


def test_again_after_undo_undoes_one_more():
    outcome = outcome_of("put red on yellow / open the drawer / undo / again")
    assert isinstance(outcome, Signal)
    assert outcome.control == "undo"
    assert RED in [step.object for step in outcome.steps]


@pytest.mark.parametrize("turn", ["better. undo the last one", "great, undo that last step", "nice. take that back"])
def test_praise_before_a_signal_changes_nothing(turn):
    assert outcome_of(f"put red on yellow / {turn}").control == "undo"


@pytest.mark.parametrize("turn", ["and three more times", "three more times", "do that three more times"])
def test_a_number_says_how_often_it_is_done_once_more(turn):
    assert [step.object for step in outcome_of(f"switch the lever / {turn}").steps] == [LEVER] * 3


@pytest.mark.parametrize(
    "turns",
    [
        "put the red cube in the drawer / close it / and where's the red one now? / open that again",
        "open both / close the fridge / which one's still open? / put the red one in",
    ],
)
def test_a_container_that_an_answer_names_is_spoken_of(turns):
    step = outcome_of(turns).steps[-1]
    assert DRAWER in (step.object, step.goal)


@pytest.mark.parametrize("turn", ["not so near, separate them a little", "move them further apart", "further apart"])
def test_two_things_go_apart(turn):
    start = outcome_of("put the blue cube near the yellow one").steps[-1].place
    step = outcome_of(f"put the blue cube near the yellow one / {turn}").steps[-1]
    yellow = room().things[YELLOW]
    off = [abs(x - yellow.x) + abs(y - yellow.y) for x, y in (start, step.place)]
    assert step.object == BLUE
    assert off[1] > off[0]
    assert asked_steps(outcome_of(f"put the blue cube near the yellow one / {turn}"))

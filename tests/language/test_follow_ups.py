"""Turns that go on from the ones before: both, again with another thing, too far, tags, what was done, what is held."""

import pytest

from language import Answer, Refusal, Signal
from tests.helpers.room_cases import (
    BLUE,
    DRAWER,
    FRIDGE,
    LEVER,
    NAMES,
    RED,
    YELLOW,
    asked_steps,
    larger_room,
    outcome_of,
    room,
)

STACKED = "put the blue cube on the yellow cube / "
MOVED = "move the yellow cube to the left / "


def moved(outcome):
    """The names of the things that are put somewhere, in order."""
    return [NAMES[step.object] for step in outcome.steps if step.carries]


def left_of(outcome):
    """How far the thing that is put last goes to the left from where it was at the start of the turns, in metres."""
    step = outcome.steps[-1]
    return step.place[1] - room().things[step.object].y


@pytest.mark.parametrize("them", ["move them to the left", "move both to the left", "take both over to the left"])
def test_both_are_the_two_things_of_the_last_turn(them):
    assert moved(outcome_of(STACKED + them)) == ["blue", "yellow"]


def test_it_is_not_put_beside_itself():
    last = outcome_of("put the red cube on the blue cube / put it beside it").steps[-1]
    assert last.object == RED
    assert abs(last.place[0] - 0.44) + abs(last.place[1] + 0.18) < 0.15


def test_the_same_again_is_done_with_another_thing():
    outcome = outcome_of("put the red cube down in front of the blue one / and again but with the yellow one")
    assert moved(outcome) == ["yellow"]


@pytest.mark.parametrize("reply", ["not so far", "too far, come back a little", "too much", "move it back a tiny bit"])
def test_what_went_too_far_comes_back_a_part_of_the_way(reply):
    assert 0.005 < left_of(outcome_of(MOVED + reply)) < left_of(outcome_of(MOVED.removesuffix(" / ")))


def test_what_was_said_corrects_the_side():
    assert left_of(outcome_of(MOVED + "I said right")) < 0.06


@pytest.mark.parametrize(
    "it", ["actually leave it next to the red one", "take it off and leave it next to the red one"]
)
def test_what_is_left_beside_something_goes_there(it):
    assert moved(outcome_of(STACKED + it))[-1] == "blue"


def test_what_is_let_go_is_put_down():
    assert moved(outcome_of("let it go", room(held=RED))) == ["red"]


def test_any_but_one_chooses_among_the_others():
    (step,) = outcome_of("pick up the cube / any except the yellow one").steps
    assert step.object in (BLUE, RED)


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("the red cube is in the drawer, right?", "No: the red cube is on the table"),
        ("you're not holding anything, are you?", "No: My gripper is empty"),
        ("isn't there a red cube somewhere?", "Yes: the red cube"),
        ("got anything in the fridge?", "No: nothing"),
        ("who has the red cube?", "The red cube is on the table"),
        ("how do I say that you should stop?", "Say 'stop'"),
        ("would another cube fit in the drawer?", "Yes, that can be done"),
        ("tell me when you are ready", "Yes, I am ready"),
        ("what happens next?", "Nothing"),
    ],
)
def test_a_question_without_a_question_word_is_answered(question, told):
    outcome = outcome_of(question)
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(told)


@pytest.mark.parametrize(
    ("turns", "told"),
    [
        ("press the button / have you pressed it yet?", "Yes"),
        ("press the button / have you moved the red cube?", "No"),
        ("press the button / open the drawer / what did you do? / and before that?", "I did this: press"),
        ("press the button / open the drawer / how many things have you done so far?", "I did 2 things"),
    ],
)
def test_what_was_done_is_told(turns, told):
    assert outcome_of(turns).text.startswith(told)


@pytest.mark.parametrize(("condition", "number"), [("if that worked", 1), ("if it didn't work", 0)])
def test_a_condition_may_be_whether_the_last_plan_was_carried_out(condition, number):
    assert len(getattr(outcome_of(f"press the button / {condition}, open the drawer"), "steps", ())) == number


def test_a_warning_with_what_may_happen_is_a_signal():
    outcome = outcome_of(STACKED + "careful, it's going to fall")
    assert isinstance(outcome, Signal)
    assert outcome.control == "slower"


@pytest.mark.parametrize(
    "what", ["put the thing you are holding down", "drop what you hold", "put what is in your hand on red"]
)
def test_an_empty_gripper_is_the_reason_that_is_given(what):
    outcome = outcome_of(what)
    assert isinstance(outcome, Refusal)
    assert "nothing is in my gripper" in outcome.text


def test_what_is_unstacked_is_not_what_is_held():
    assert moved(outcome_of(STACKED + "pick up the red cube / unstack it again")) == ["red", "blue"]


@pytest.mark.parametrize(
    ("turns", "taken"),
    [
        ("pick up the cube on the right / i meant on the left", "red"),
        ("pick up the right cube / no, the left", "red"),
        ("pick up the cube on the far left / sorry i meant the far right", "blue"),
    ],
)
def test_a_side_that_is_corrected_is_that_of_the_thing_which_was_named_by_it(turns, taken):
    last = outcome_of(turns).steps[-1]
    assert last.takes
    assert NAMES[last.object] == taken


def test_a_side_is_a_place_where_the_thing_was_not_named_by_it():
    assert moved(outcome_of("pick up the blue cube / i meant to the left")) == ["blue"]


@pytest.mark.parametrize("back", ["put both back", "please put both of them back to where they were", "put them back"])
def test_both_go_back_that_were_moved_in_two_turns(back):
    turns = "move the yellow cube to the right / and the red one towards the blue one / "
    assert sorted(moved(outcome_of(turns + back))) == ["red", "yellow"]


def test_both_back_means_no_device_where_nothing_was_moved():
    assert not getattr(outcome_of("put both back"), "steps", ())


@pytest.mark.parametrize("answer", ["the one that's closer to you", "the closer one", "the nearer one"])
def test_the_closer_one_answers_which_is_meant(answer):
    (step,) = outcome_of(f"pick up the cube / {answer}").steps
    assert step.object == YELLOW


@pytest.mark.parametrize(
    ("correction", "mover", "base"),
    [
        ("not the red one, the yellow one", "yellow", "blue"),
        ("not the blue one! the yellow one", "red", "yellow"),
        ("no, not blue but yellow", "red", "yellow"),
    ],
)
def test_what_it_shall_not_be_says_whether_the_thing_or_its_place_is_corrected(correction, mover, base):
    last = outcome_of(f"put the red cube on the blue one / {correction}").steps[-1]
    assert (NAMES[last.object], NAMES[last.goal]) == (mover, base)


@pytest.mark.parametrize(
    "said",
    [
        "wrong way round",
        "wrong way round, I wanted the blue one on the red one",
        "that's the wrong way around. blue on red",
    ],
)
def test_the_wrong_way_round_is_turned_round(said):
    last = outcome_of(f"put the red cube on the blue one / {said}").steps[-1]
    assert (NAMES[last.object], NAMES[last.goal]) == ("blue", "red")


@pytest.mark.parametrize("other", ["the other thing. the lever", "no, the lever", "not the button! the lever"])
def test_another_device_is_operated_instead(other):
    assert outcome_of(f"press the button / {other}").steps[-1].object == LEVER


@pytest.mark.parametrize(
    "instead",
    [
        "I was going to have you give it to me but just put it on the blue one",
        "I wanted it on the yellow one but put it on the blue one instead",
        "we were about to put it away, but now put it on the blue one",
    ],
)
def test_what_was_intended_at_first_is_not_done(instead):
    assert asked_steps(outcome_of(f"pick up the red cube / {instead}")) == [("stack", RED)]


@pytest.mark.parametrize(
    ("liked", "y"),
    [
        ("actually I liked it better on the right", (-0.25, -0.05)),
        ("I think id like it better on the left", (0.05, 0.25)),
        ("i'd prefer it in the middle", (-0.06, 0.06)),
    ],
)
def test_what_is_liked_better_somewhere_goes_there(liked, y):
    step = outcome_of(f"put the yellow cube next to the red one / {liked}").steps[-1]
    assert NAMES[step.object] == "yellow"
    assert y[0] <= step.place[1] <= y[1]


@pytest.mark.parametrize("before", ["it was better before", "I liked it better where it was"])
def test_what_was_better_before_is_undone(before):
    outcome = outcome_of(MOVED + before)
    assert isinstance(outcome, Signal)
    assert outcome.control == "undo"


@pytest.mark.parametrize(
    ("correction", "opened"),
    [
        ("no close it again, it was the fridge I wanted open", FRIDGE),
        ("it's the fridge I want you to open", FRIDGE),
        ("no, it was the fridge I wanted", FRIDGE),
    ],
)
def test_it_was_another_thing_that_was_wanted(correction, opened):
    assert asked_steps(outcome_of(f"open the drawer / {correction}"))[-1] == ("open", opened)


@pytest.mark.parametrize(
    ("first", "names"),
    [
        ("ok take the yellow one out first", ["yellow", "red"]),
        ("empty it first", ["yellow", "red"]),
        ("use the fridge then", ["red"]),
        ("then in the fridge", ["red"]),
    ],
)
def test_what_was_refused_is_done_after_what_is_said_to_come_first(first, names):
    world = room(inside={YELLOW: DRAWER}, open=frozenset([DRAWER]))
    outcome = outcome_of(f"put the red cube in the drawer / {first}", world)
    assert moved(outcome) == names


def test_a_thing_goes_beside_the_tower_on_which_it_cannot_go():
    outcome = outcome_of("put the blue cube on the red one / and yellow on blue / ok just next to it then")
    assert moved(outcome) == ["yellow"]


def test_the_same_with_a_pair_replaces_the_thing_and_the_container():
    turns = "put the blue cube in the drawer, then close it / same thing with yellow and the fridge"
    assert asked_steps(outcome_of(turns)) == [("open", FRIDGE), ("put_in", YELLOW), ("close", FRIDGE)]


def test_one_of_a_colour_is_of_the_kind_that_was_named():
    world = larger_room()
    outcome = outcome_of("rotate the blue cube / the cyan one", world)
    assert isinstance(outcome, Refusal)
    assert asked_steps(outcome_of("press the button / no, the cyan one", world))[-1] == ("switch", LEVER)


def test_an_answer_may_say_what_is_to_be_done_with_the_thing():
    assert asked_steps(outcome_of("the red thing / well obviously the cube, hand it to me")) == [("hand_over", RED)]


def test_the_opposite_corner_is_that_of_the_last_place():
    place = (
        outcome_of("put the red cube in the far left corner / and the blue one in the opposite corner").steps[-1].place
    )
    assert place[0] < 0.36
    assert place[1] < -0.15


@pytest.mark.parametrize("more", ["not far enough", "that's not far enough, go more left", "still not far enough"])
def test_what_is_not_far_enough_goes_further(more):
    assert left_of(outcome_of(MOVED + more)) > left_of(outcome_of(MOVED.removesuffix(" / "))) + 0.02


@pytest.mark.parametrize(
    "inside", ["take out whats in there", "get out whatever is inside", "take what is in the fridge out"]
)
def test_what_is_in_there_is_taken_out(inside):
    world = room(inside={YELLOW: FRIDGE})
    assert ("hand_over", YELLOW) in asked_steps(outcome_of(f"open the fridge / {inside} and give it to me", world))


@pytest.mark.parametrize(
    "back", ["take it back and put it where it was before", "thanks, now put it back where it was"]
)
def test_what_was_handed_over_goes_back_where_it_was(back):
    step = outcome_of(f"hand me the yellow cube / {back}").steps[-1]
    assert step.place[:2] == pytest.approx((0.34, 0.0), abs=0.01)


@pytest.mark.parametrize(
    ("turns", "told"),
    [
        ("put the red cube in the fridge / which one is in the fridge again?", "The red cube is in the red fridge"),
        ("pick up the red cube / is anything else here red?", "Yes: the red fridge"),
        ("pick up the red cube / what else is red?", "The red fridge"),
        ("put yellow on red / which cubes haven't you touched yet?", "The blue cube and the red cube"),
        ("put yellow on red / which ones have you moved so far?", "The yellow cube"),
        ("pick up the red cube / haha you look funny holding that", "All right"),
        ("hand me the red cube / my hand is getting tired", "All right"),
    ],
)
def test_what_is_asked_or_said_of_the_turns_before_is_answered(turns, told):
    outcome = outcome_of(turns)
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(told)


@pytest.mark.parametrize("rest", ["and the rest", "the others too", "the rest as well, please"])
def test_the_rest_are_all_others(rest):
    assert set(moved(outcome_of(f"move the blue cube to the left / {rest}"))) == {"yellow", "red"}


def test_two_more_things_go_to_the_same_side_and_not_on_one_another():
    outcome = outcome_of("put the blue cube on the left side / and the red and the yellow one")
    assert moved(outcome) == ["red", "yellow"]
    assert all(step.goal is None for step in outcome.steps)


def test_if_so_means_the_last_answer():
    inside = room(inside={RED: DRAWER}, open={DRAWER})
    assert asked_steps(outcome_of("is anything in the drawer? / if so, take it out", inside)) == [("take_out", RED)]
    outcome = outcome_of("is anything in the drawer? / if so, take it out")
    assert isinstance(outcome, Answer)
    assert "nothing is in the drawer" in outcome.text


@pytest.mark.parametrize("again", ["repeat for the blue one", "the same displacement with the blue cube"])
def test_a_move_is_repeated_with_another_thing_whatever_it_is_called(again):
    assert moved(outcome_of(MOVED + again)) == ["blue"]


def test_a_correction_changes_a_thing_in_all_that_was_done_with_it():
    outcome = outcome_of(
        "take the red cube and then put it in the drawer / no, I meant the blue one", room(open={DRAWER})
    )
    assert asked_steps(outcome)[-1] == ("put_in", BLUE)
    assert [step.object for step in outcome.steps if step.verb == "grasp"] == [BLUE]


def test_out_again_and_a_clause_that_is_taken_back():
    assert asked_steps(outcome_of("put the red cube in the drawer / no. out again."))[-1] == ("take_out", RED)
    outcome = outcome_of("pick up the red cube / now into the drawer with it. or no, give it to me")
    assert asked_steps(outcome)[-1] == ("hand_over", RED)


@pytest.mark.parametrize("them", ["between them", "right in the middle between them", "between those two"])
def test_two_things_that_were_moved_one_after_the_other_are_them(them):
    turns = "put the red cube in the far left corner / and the blue one in the near right corner / "
    outcome = outcome_of(f"{turns}and the yellow one {them}")
    assert outcome.steps[-1].object == YELLOW
    assert abs(outcome.steps[-1].place[1]) < 0.1


def test_the_other_one_is_that_of_two_commands_in_a_row():
    turns = "put the red cube in the fridge / put the blue cube in the drawer / where is the blue cube / "
    assert "red cube" in outcome_of(f"{turns}and the other one?", room(open=frozenset([DRAWER, FRIDGE]))).text


@pytest.mark.parametrize(
    "same", ["same thing with yellow and the fridge", "do the same for the yellow cube and the fridge"]
)
def test_the_same_is_done_with_another_thing_and_another_place(same):
    outcome = outcome_of(f"open the drawer, put red in, close it again / {same}")
    assert asked_steps(outcome) == [("open", FRIDGE), ("put_in", YELLOW), ("close", FRIDGE)]


def test_the_same_after_an_adjustment_is_what_was_done_before_it():
    outcome = outcome_of("put the blue cube next to the red one / a bit closer / same with the yellow one")
    last = outcome.steps[-1]
    assert last.object == YELLOW
    assert abs(last.place[0] - 0.37) + abs(last.place[1] - 0.18) < 0.15


@pytest.mark.parametrize("turn", ["no, the blue one should be on top", "the blue cube on top", "red at the bottom"])
def test_a_tower_is_turned_round_by_what_is_to_be_on_top(turn):
    outcome = outcome_of(f"stack red on blue / {turn}")
    assert [(step.object, step.goal) for step in outcome.steps if step.carries] == [(RED, None), (BLUE, RED)]


@pytest.mark.parametrize(
    ("asked", "begins"),
    [
        ("did you give me the blue cube?", "Yes"),
        ("did I have the blue one today?", "Yes"),
        ("did you give me the red one?", "No"),
        ("have you handed me the yellow cube?", "No"),
    ],
)
def test_what_was_given_is_told(asked, begins):
    assert outcome_of(f"give me the blue cube / {asked}").text.startswith(begins)


def test_things_of_two_questions_change_places():
    outcome = outcome_of(
        "what is in the drawer and what is in the fridge? / switch them around",
        room(inside={RED: DRAWER, BLUE: FRIDGE}, open=frozenset([DRAWER, FRIDGE])),
    )
    assert {(step.object, step.goal) for step in outcome.steps if step.carries and step.goal} == {
        (RED, FRIDGE),
        (BLUE, DRAWER),
    }


def test_a_tower_of_two_grows_no_higher():
    outcome = outcome_of("stack red on blue / make the tower higher")
    assert isinstance(outcome, Refusal)
    assert "on top of two" in outcome.text


@pytest.mark.parametrize("reason", ["so the butter doesn't melt", "its my turn", "so my friend can not see it"])
def test_a_reason_after_a_command_changes_nothing(reason):
    assert asked_steps(outcome_of(f"open the drawer, {reason}")) == [("open", DRAWER)]


@pytest.mark.parametrize("them", ["put them on top of each other", "stack them", "make a tower of them"])
def test_what_was_taken_out_is_stacked_without_the_containers(them):
    world = room(inside={RED: DRAWER, YELLOW: FRIDGE}, open=frozenset([DRAWER, FRIDGE]))
    outcome = outcome_of(f"take the red cube and the yellow cube out / {them}", world)
    assert {frozenset([s.object, s.goal]) for s in outcome.steps if s.carries and s.goal is not None} == {
        frozenset([RED, YELLOW])
    }


def test_both_are_the_things_of_two_commands_in_a_row():
    outcome = outcome_of("put red in the drawer / put blue in the fridge / and now both back on the table")
    assert set(moved(outcome)) == {"red", "blue"}


@pytest.mark.parametrize("farther", ["1 cm more", "another 1 cm", "and 1 cm further"])
def test_a_length_more_goes_on_to_the_same_side(farther):
    less = left_of(outcome_of("move the yellow cube 3 cm to the left"))
    assert left_of(outcome_of(f"move the yellow cube 3 cm to the left / {farther}")) == pytest.approx(
        less + 0.01, abs=5e-3
    )


def test_what_was_refused_is_done_once_there_is_room():
    turns = "give me the red cube / the yellow one too / take the red one back / now the yellow one"
    assert asked_steps(outcome_of(turns)) == [("hand_over", YELLOW)]


def test_another_thing_is_not_the_one_below_it():
    outcome = outcome_of("stack red on yellow / and another one on blue", larger_room())
    assert not {RED, YELLOW} & {step.object for step in outcome.steps}


@pytest.mark.parametrize("asked", ["the fridge is closed?", "so the red cube is in the drawer?"])
def test_a_statement_with_a_question_mark_asks(asked):
    assert isinstance(outcome_of(asked), Answer)


def test_two_things_are_not_lifted_at_once():
    assert "one thing at a time" in outcome_of("lift two cubes at the same time").text


def test_a_loose_thing_that_was_spoken_of_is_not_rotated():
    outcome = outcome_of("move the yellow cube to the left / rotate it a little")
    assert isinstance(outcome, Refusal)
    assert "yellow cube" in outcome.text


def test_a_common_thing_that_is_not_here_is_told_as_missing():
    assert "no lamp here" in outcome_of("and please the lamp make on").text


@pytest.mark.parametrize("turn", ["actually the drawer would be better", "no, the drawer", "I said the drawer"])
def test_another_container_takes_the_place_of_the_first_in_all_steps(turn):
    outcome = outcome_of(f"put the red cube in the fridge and shut it / {turn}")
    assert (RED, DRAWER) in [(step.object, step.goal) for step in outcome.steps if step.carries]
    assert asked_steps(outcome)[-1] == ("close", DRAWER)


def test_it_is_the_container_that_can_still_be_closed():
    assert asked_steps(outcome_of("open the drawer / open the fridge / close the fridge / ok close it")) == [
        ("close", DRAWER)
    ]


def test_things_in_two_containers_change_places_the_other_way_round():
    outcome = outcome_of("put red in the fridge / and the blue one in the drawer / oh sorry, it's the other way round")
    assert [(s.object, s.goal) for s in outcome.steps if s.carries and s.goal is not None][-2:] in (
        [(RED, DRAWER), (BLUE, FRIDGE)],
        [(BLUE, FRIDGE), (RED, DRAWER)],
    )


def test_a_bit_that_was_too_much_is_half_taken_back():
    assert 0.005 < left_of(outcome_of("move the yellow cube a bit to the left / not that much")) < 0.035


@pytest.mark.parametrize("words", ["build a tower", "can you build a tower?", "make me a nice tower please"])
def test_a_tower_of_whatever_is_one_of_two_things(words):
    assert [step.verb for step in outcome_of(words).steps if step.carries] == ["stack"]


def test_what_was_opened_or_closed_is_told():
    assert outcome_of("did you close the drawer?").text.startswith("No")
    assert outcome_of("open the drawer / did you open the drawer?").text.startswith("Yes")


def test_a_condition_after_but_is_weighed():
    assert asked_steps(outcome_of("open the drawer, but only if the fridge is closed")) == [("open", DRAWER)]


@pytest.mark.parametrize("asked", ["how many things can I put in the drawer?", "could the drawer take all cubes?"])
def test_how_much_a_container_takes_is_told(asked):
    assert "one thing" in outcome_of(asked).text

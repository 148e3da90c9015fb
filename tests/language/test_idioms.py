"""Idioms and roundabout wordings: what people say instead of the plain command, question or correction."""

import pytest

from language import Answer, Plan, Question, Refusal, Signal
from tests.helpers.room_cases import outcome_of
from tests.helpers.sets_room import FACTS, NAMES, done, named, room, said


def turns(*sentences):
    """The outcome of the last of some turns, and what its steps do with what and where, as words."""
    outcome = outcome_of(" / ".join(sentences), room(FACTS["A"]))
    return outcome, named(getattr(outcome, "steps", ()))


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        (
            "blue belongs in the drawer, so stow it and shut it afterwards",
            "B",
            ["put_in blue drawer", "close drawer"],
        ),
        ("I'd love to hold something yellow", "A", ["hand_over yellow hand"]),
        ("blue carries red", "A", ["stack red blue"]),
        ("yellow should ride piggyback on the gray cube", "A", ["stack yellow gray"]),
        ("turn the wheel, like a pirate", "A", ["turn wheel"]),
        ("take the red cube, then leave it", "A", ["lift red"]),
        ("my palm is out, I want blue in it", "A", ["hand_over blue hand"]),
        ("careful, put that down before you drop it", "D", ["pick_and_place red"]),
        ("push it two times, the button", "A", ["press button"]),
        ("somebody left the drawer hanging open, sort it", "B", ["close drawer"]),
        ("careful, don't let it fall on the floor, lay it in the drawer", "D", ["put_in red drawer"]),
        ("Wouldn't it be prettier with red standing on yellow?", "A", ["stack red yellow"]),
        ("no more stacks please", "S", ["pick_and_place blue"]),
    ],
)
def test_an_idiom_means_the_plain_command(sentence, state, steps):
    assert sorted(done(sentence, state)) == sorted(steps)


@pytest.mark.parametrize(
    "sentence", ["clear the middle", "make some room in the middle", "I need a bit of space in the centre"]
)
def test_a_region_that_is_cleared_keeps_nothing(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Plan)
    assert [NAMES[step.object] for step in outcome.steps] == ["yellow", "yellow"]
    assert not outcome.steps[-1].takes  # it does not stay in the gripper


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("When the button is up, push it; if it's down, pull the lever.", "A", ["press button"]),
        ("if the button is down, push it; if it's up, pull the lever", "A", ["switch lever"]),
        ("if the drawer is closed, open it; if it's open, close it", "A", ["open drawer"]),
        ("if the drawer is closed, open it; if it's open, close it", "B", ["close drawer"]),
        ("if the drawer is closed open it and if the drawer is open close it", "A", ["open drawer"]),
        ("open the drawer if it is closed, close it if it is open", "A", ["open drawer"]),
        ("open the drawer if it is closed, close it if it is open", "B", ["close drawer"]),
    ],
)
def test_of_two_conditions_that_exclude_each_other_one_counts(sentence, state, steps):
    assert done(sentence, state) == steps


def test_a_condition_of_what_an_earlier_step_changes_is_weighed_after_it():
    assert done("press the button; finally close the drawer if it is open", "B") == ["press button", "close drawer"]


@pytest.mark.parametrize(
    ("sentences", "steps"),
    [
        (
            ("open the fridge", "take orange", "put it in there and press the button"),
            ["put_in orange fridge", "press button"],
        ),
        (
            ("open the fridge", "take orange", "in there with it, and shut it"),
            ["put_in orange fridge", "close fridge"],
        ),
        (
            ("stack blue on cyan", "remove the blue cube and put orange there in its place"),
            ["lift orange", "stack orange cyan"],
        ),
        (
            ("put the blue cube in the drawer and close it", "no, the red one"),
            ["lift red", "put_in red drawer", "close drawer"],
        ),
        (
            ("open the fridge, put the red cube in it and close it", "I meant the yellow cube"),
            ["lift yellow", "put_in yellow fridge", "close fridge"],
        ),
        (("put blue in the drawer and close it", "no, the fridge"), ["put_in blue fridge", "close fridge"]),
        (("is the drawer open?", "if it is open, close it; if it is closed, open it"), ["open drawer"]),
        (("blue on red", "red was wrong, sorry, should've been yellow"), ["lift blue", "stack blue yellow"]),
        (
            ("red on gray", "put the yellow one there instead"),
            ["lift yellow", "stack yellow gray"],
        ),
    ],
)
def test_there_and_it_mean_what_was_said_before(sentences, steps):
    _, found = turns(*sentences)
    assert found[-len(steps) :] == steps


def test_a_place_that_was_asked_about_is_the_one_that_is_meant():
    outcome = said("is there a free place to the right of red? then put gray in it")
    assert isinstance(outcome, Plan)
    red = room(FACTS["A"]).things[NAMES.index("red")]
    assert outcome.steps[-1].verb == "pick_and_place"
    assert outcome.steps[-1].place[1] < red.y


@pytest.mark.parametrize(
    ("sentence", "state", "told"),
    [
        ("Did someone leave the fridge open again?", "BF", "Yes"),
        ("What sort of things may I ask of you?", "A", "Say, for example"),
        ("what colour is the leftmost cube from where you stand", "A", "red"),
        ("is the cyan cube free on top?", "S", "No"),
        ("is the blue cube free on top?", "S", "Yes"),
        ("which cube do you like best?", "A", "no favourite"),
        ("what is next to the gray cube?", "A", "cube"),
        ("is everything closed?", "A", "Yes"),
        ("is everything closed?", "B", "No"),
        ("is everything open now?", "B", "No"),
    ],
)
def test_a_roundabout_question_gets_its_answer(sentence, state, told):
    outcome = said(sentence, state)
    assert isinstance(outcome, Answer)
    assert told in outcome.text


@pytest.mark.parametrize(
    "sentence", ["put the red and the blue cube together in the drawer", "blue one metre to the left"]
)
def test_what_cannot_be_done_whole_is_not_done_in_part(sentence):
    assert isinstance(said(sentence), Refusal)


@pytest.mark.parametrize("more", ["another 5", "and another 5 cm", "5 cm more", "another five in the same direction"])
def test_a_length_alone_goes_on_in_the_same_direction(more):
    first, _ = turns("move the yellow cube 5 cm to the left")
    second, found = turns("move the yellow cube 5 cm to the left", more)
    assert found == ["lift yellow", "pick_and_place yellow"]
    assert second.steps[-1].place[1] - first.steps[-1].place[1] == pytest.approx(0.05, abs=0.015)


def test_a_length_alone_goes_on_towards_the_same_thing():
    _, found = turns("move the yellow cube 5 cm closer to the button", "and another 5")
    assert found == ["lift yellow", "pick_and_place yellow"]


@pytest.mark.parametrize("sentence", ["put the red cube on the hand", "lay the red one in the hand please"])
def test_the_hand_is_the_persons(sentence):
    assert done(sentence) == ["hand_over red hand"]


def test_something_else_is_asked_about():
    outcome, _ = turns("put the cyan cube on the gray one", "take it off and put something else there")
    assert isinstance(outcome, Question)


def test_nothing_is_done_where_nothing_shall_be_done():
    outcome = said("do absolutely nothing")
    assert isinstance(outcome, Signal)
    assert outcome.control == "stop"


def test_too_hectic_is_too_fast():
    outcome, _ = turns("slower", "that's still too hectic for me")
    assert isinstance(outcome, Signal)
    assert outcome.control == "slower"


def test_all_but_one_go_to_a_side():
    moved = {NAMES[step.object] for step in said("all but the red one over to the right").steps}
    assert moved == {"yellow", "blue", "orange", "cyan", "gray"}


def test_a_cube_is_given_to_the_empty_hand():
    assert said("my hand is so empty").steps[-1].verb == "hand_over"


@pytest.mark.parametrize("things", ["the cubes", "all the cubes", "the red and the blue cube", "everything"])
def test_several_things_are_put_on_the_left_side_not_a_step_to_the_left(things):
    placed = [step.place for step in turns(f"put {things} on the left")[0].steps if step.carries]
    assert len(placed) > 1
    assert all(y > 0.05 for _, y in placed)


@pytest.mark.parametrize(
    ("first", "answer", "corner"),
    [
        ("put the red cube in the corner", "the far left one", (0.47, 0.21)),
        ("put the red cube in a corner", "no, the one at the back on the left", (0.47, 0.21)),
        ("put the blue cube in the front left corner", "no, the back left one", (0.47, 0.21)),
    ],
)
def test_a_side_after_a_corner_names_another_corner(first, answer, corner):
    assert turns(first, answer)[0].steps[-1].place == pytest.approx(corner, abs=0.01)


def test_a_tower_that_is_not_there_is_not_seen():
    assert turns("is the tower still there?")[0].text == "No: there is no tower here."
    assert "The blue cube is on top of the cyan cube" in f"{said('where is the tower?', 'S').text}"


@pytest.mark.parametrize(
    ("sentence", "told"),
    [
        ("has someone pressed that button already", "No: the gray button is up"),
        ("yellow cube where is", "The yellow cube is on the table"),
        ("roughly how far apart are the red cube and the yellow cube", "The red cube is 19 cm from the yellow cube."),
        ("what is that pink thing", "That is your hand."),
        ("is anything lying on the pink hand", "No: nothing is on your hand."),
        ("is the hand empty", "Yes: nothing is in your hand."),
        ("what colour is my hand", "Your hand is pink."),
        ("status?", "I see the yellow cube"),
        ("ty", "You are welcome"),
    ],
)
def test_a_question_or_thanks_in_few_words_moves_nothing(sentence, told):
    assert said(sentence).text.startswith(told)


def test_a_question_about_others_is_never_carried_out():
    assert not isinstance(said("have they put the red cube in the drawer"), Plan)


@pytest.mark.parametrize("polite", ["please", "just", "could you", "okay now", "I want you to"])
def test_a_wording_means_the_same_behind_a_polite_word(polite):
    assert done(f"{polite} clear the middle") == done("clear the middle")


@pytest.mark.parametrize(
    "sentence", ["give me the cube in the fridge", "take out what is in the fridge", "hand me one from the fridge"]
)
def test_an_empty_container_is_called_empty(sentence):
    assert said(sentence).text == "nothing is in the red fridge"


def test_what_is_in_there_is_nothing_where_nothing_is():
    assert "nothing is in the red fridge" in turns("open the fridge", "whatever's in there take it out")[0].text
    assert "nothing is in the blue drawer" in turns("open the drawer", "take it out")[0].text


@pytest.mark.parametrize("more", ["a little further still please", "still a bit further", "a bit further"])
def test_further_still_goes_on_in_the_same_direction(more):
    before, after = (turns("move the red cube a bit to the right", *then)[0].steps[-1].place for then in ((), (more,)))
    assert after[0] == pytest.approx(before[0], abs=0.01)
    assert after[1] < before[1] - 0.02


def test_a_side_that_was_meant_replaces_the_side_that_was_said():
    assert turns("put the orange cube on the left side", "sorry i meant right")[0].steps[-1].place[1] < -0.05


def test_a_different_one_takes_the_place_of_any_one():
    assert turns("take a cube", "a different one please")[1] == ["pick_and_place yellow", "lift blue"]


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("the drawer is still shut, fix that", "A", ["open drawer"]),
        ("someone left the drawer open, can you sort that out", "B", ["close drawer"]),
        ("fridge door open please my hands are full", "A", ["open fridge"]),
        ("pick any cube you like and give it to me", "A", ["hand_over yellow hand"]),
        ("put the object you are holding onto the red cube", "G", ["stack yellow red"]),
    ],
)
def test_a_complaint_or_a_reason_asks_for_what_helps(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "axis", "sign"),
    [
        ("move the cyan cube to the front", 0, -1),
        ("move the yellow cube to the back", 0, 1),
        ("the red cube is too far right", 1, 1),
        ("The yellow cube is too far to the left for my taste.", 1, -1),
        ("move the red cube in the negative y direction", 1, -1),
        ("move the red cube as far left as possible", 1, 1),
    ],
)
def test_a_direction_or_a_complaint_about_a_place_moves_to_the_side_that_is_meant(sentence, axis, sign):
    step = said(sentence).steps[-1]
    thing = room(FACTS["A"]).things[step.object]
    assert sign * (step.place[axis] - (thing.x, thing.y)[axis]) > 0.005


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("lemme get that blue cube real quick", "A", ["hand_over blue hand"]),
        ("Empty whichever container holds the yellow cube.", "I", ["pick_and_place yellow"]),
        ("Cube red put inside of refrigerator and door close.", "F", ["put_in red fridge", "close fridge"]),
        ("Could the red cube go where the see-through one is drawn?", "A", ["pick_and_place red target"]),
        ("Make two towers of two: gray on orange, red on yellow.", "A", ["stack gray orange", "stack red yellow"]),
        ("It would look so much nicer if the orange cube sat on the gray one.", "A", ["stack orange gray"]),
        ("open the fridge, well actually just the drawer", "A", ["open drawer"]),
    ],
)
def test_a_roundabout_request_is_carried_out(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "state", "told"),
    [
        ("Where stands the yellow cube?", "A", "The yellow cube is on the table"),
        ("Report status of drawer and fridge.", "A", "No: the blue drawer is closed"),
        ("Of the cubes, how many are to the right of the yellow one?", "A", "There are three (3)"),
        ("Show me what's hidden in there, in the drawer.", "K", "The red cube is in the blue drawer"),
        ("How many containers are open at present?", "BF", "There are two (2)"),
        ("Do you understand Polish?", "A", "I understand English"),
    ],
)
def test_a_question_in_another_order_gets_its_answer(sentence, state, told):
    assert said(sentence, state).text.startswith(told)


def test_a_quarter_turn_is_no_present():
    assert isinstance(said("Give the yellow cube a quarter turn."), Refusal)


def test_what_looked_prettier_before_is_undone():
    outcome, _ = turns("put red on blue", "Hmm, it was prettier before.")
    assert isinstance(outcome, Signal)
    assert outcome.control == "undo"


def test_in_there_is_no_other_container_than_the_one_that_was_spoken_of():
    outcome, _ = turns("put the red cube in the fridge", "put blue in there too")
    assert isinstance(outcome, Refusal)
    assert "full" in outcome.text


def test_what_is_taken_out_is_moved_once():
    _, found = turns("put the orange in the drawer", "take it out again and stick the gray in instead")
    assert found == ["take_out orange drawer", "pick_and_place orange", "lift gray", "put_in gray drawer"]


def test_done_looking_asks_for_nothing():
    _, found = turns(
        "give me the gray cube", "Thanks, done looking at it. Put it back on the table next to the blue one."
    )
    assert found == ["lift gray", "pick_and_place gray"]


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("take the second one from the right", ["lift orange"]),
        ("pick up the third cube from the left", ["lift yellow"]),
        ("lift the red cube 10 cm", ["lift red"]),
        ("open drawer, blue in, close", ["open drawer", "put_in blue drawer", "close drawer"]),
    ],
)
def test_loose_cubes_are_counted_and_no_part_is_left_out(sentence, steps):
    assert done(sentence) == steps


def test_off_takes_the_upper_one():
    assert turns("put the red cube on the blue cube", "what is under the red cube", "take it off")[1] == ["lift red"]


def test_what_was_done_to_a_device_is_told():
    assert turns("turn the wheel", "did you turn the wheel")[0].text.startswith("Yes: the red wheel")


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("drawer's been left open, would you mind?", "B", ["close drawer"]),
        ("could do with somebody lifting that grey block", "A", ["lift gray"]),
        ("deposit payload in drawer", "D", ["put_in red drawer"]),
        ("put cube yellow up on cube red", "A", ["stack yellow red"]),
        ("button, push one time", "A", ["press button"]),
        ("whatever cube is lying closest to the drawer uh pick that up", "A", ["lift blue"]),
    ],
)
def test_a_hint_and_another_word_order_are_understood(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize("correction", ["no, the drawer", "no i said the drawer", "i meant the drawer"])
def test_a_container_after_a_container_that_was_not_named_takes_its_place(correction):
    outcome = outcome_of(f"put the grey cube in / {correction}", room(FACTS["F"]))
    assert named(outcome.steps)[-1] == "put_in gray drawer"


def test_there_is_the_container_that_something_was_taken_out_of():
    said_before = "Take the red cube out of the drawer and put it on the table"
    outcome = outcome_of(f"{said_before} / Put the blue one in there instead.", room(FACTS["I"]))
    assert named(outcome.steps) == ["lift blue", "put_in blue drawer"]


@pytest.mark.parametrize(
    ("sentence", "state", "told"),
    [
        ("what is in the fridge please", "K", "The yellow cube is in the red fridge"),
        ("gripper status?", "A", "My gripper is empty"),
        ("status fridge", "F", "The red fridge is open"),
        ("i uh i meant to ask is the fridge open or closed", "A", "The red fridge is closed"),
    ],
)
def test_a_polite_or_terse_question_gets_its_answer(sentence, state, told):
    assert said(sentence, state).text.startswith(told)


def test_stop_is_heard_behind_another_remark():
    outcome = said("my turn now stop!!")
    assert isinstance(outcome, Signal)
    assert outcome.control == "stop"


@pytest.mark.parametrize(
    "kept", ["keep the red cube where it is and", "leave the red cube alone and", "leave red there,"]
)
def test_what_shall_stay_is_none_of_the_others(kept):
    moved = {NAMES[step.object] for step in said(f"{kept} move the others to the right").steps}
    assert moved == {"yellow", "blue", "orange", "cyan", "gray"}


def test_cubes_are_put_in_the_order_of_their_names():
    steps = [step for step in said("put the cubes in order red yellow blue from left to right").steps if step.carries]
    assert [NAMES[step.object] for step in steps] == ["red", "yellow", "blue"]
    assert steps[0].place[1] > steps[1].place[1] > steps[2].place[1]


@pytest.mark.parametrize(("rank", "cube"), [("the first", "blue"), ("the second one", "gray"), ("number 2", "gray")])
def test_a_rank_is_that_of_the_question(rank, cube):
    first = "give me the cube next to the orange one"
    assert "the blue cube, the gray cube" in turns(first)[0].text
    assert turns(first, rank)[1] == [f"lift {cube}", f"hand_over {cube} hand"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("put yelow on red / ok nwo undo taht", "undo"),
        ("lift the gray cube / Hold it there for a moment.", "wait"),
        ("could you go a bit quicker from now on that would be nice", "faster"),
        ("Slower movements from here on, thank you.", "slower"),
    ],
)
def test_a_signal_is_known_with_swapped_letters_and_more_words(typed, meant):
    outcome = outcome_of(typed, room(FACTS["A"]))
    assert isinstance(outcome, Signal)
    assert outcome.control == meant


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("mvoe teh cyan cube abt 5 cm to teh rihgt", "A", ["pick_and_place cyan"]),
        ("put the red cube comma the small one comma in the drawer full stop", "B", ["put_in red drawer"]),
        ("Load red, close up.", "B", ["put_in red drawer", "close drawer"]),
        ("My daughter asks if you can give her the yellow block.", "A", ["hand_over yellow hand"]),
        ("If and only if the fridge is closed, open it.", "A", ["open fridge"]),
    ],
)
def test_typed_dictated_and_reported_commands_are_carried_out(sentence, state, steps):
    assert done(sentence, state)[-len(steps) :] == steps


def test_what_is_left_otherwise_is_no_command_taken_back():
    assert not isinstance(said("if the drawer's empty, pop the yellow cube in it; if not, leave it."), Signal)


@pytest.mark.parametrize(
    ("sentences", "told"),
    [
        ("press the button / is it down now question mark", "Yes: the gray button is down"),
        ("put red in the drawer / Ooh what's that inside?", "The red cube is in the blue drawer"),
        ("So what can this thing actually do?", "I can reach for things"),
        ("take the yellow cube / What is it that you hold at the moment?", "I hold the yellow cube"),
    ],
)
def test_an_unusual_question_gets_its_answer(sentences, told):
    assert outcome_of(sentences, room(FACTS["A"])).text.startswith(told)


def test_that_is_closed_which_something_was_taken_out_of():
    turns_of = "Close the fridge / Now get red out of the drawer onto the table and close that as well."
    assert named(outcome_of(turns_of, room(FACTS["I"])).steps)[-1] == "close drawer"


def test_what_comes_before_is_done_before():
    assert done("Turn the wheel, but before please press on the button.") == ["press button", "turn wheel"]


def test_do_so_agrees():
    assert turns("could the red one go on the blue one", "Lovely, then do so.")[1] == ["lift red", "stack red blue"]


def test_three_is_a_number_and_no_misspelt_word():
    assert not isinstance(said("touch three cubes"), Plan)


def test_a_thing_that_is_not_here_is_called_so():
    assert said("put the red cube next to the purple cube").text == "there is no purple cube here"


@pytest.mark.parametrize(
    ("sentence", "corner"),
    [
        ("put the red cube at the back on the left", (0.47, 0.21)),
        ("put the red cube at the front, on the left", (0.32, 0.21)),
        ("put the gray cube on the right at the front", (0.32, -0.21)),
    ],
)
def test_of_two_sides_none_is_left_out(sentence, corner):
    assert said(sentence).steps[-1].place == pytest.approx(corner, abs=0.03)


@pytest.mark.parametrize(
    ("first", "complaint", "axis", "sign"),
    [
        ("put red on the left", "that's too far left", 1, -1),
        ("put the gray cube at the front", "no that's too far right", 1, 1),
        ("put red at the front", "too close to you", 0, 1),
    ],
)
def test_a_complaint_about_what_was_moved_moves_it_to_the_other_side(first, complaint, axis, sign):
    before, after = (turns(*each)[0].steps[-1].place for each in ((first,), (first, complaint)))
    assert sign * (after[axis] - before[axis]) > 0.005


def test_far_left_is_the_left_side():
    assert said("move the gray cube to the far left").steps[-1].place[1] > 0.15

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

"""What visitors said beside a command, asked in one breath, and wanted of several things at once."""

import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal, board, table
from tests.helpers.room_cases import BLUE, BUTTON, CYAN, DRAWER, RED, YELLOW, asked_steps
from tests.helpers.room_cases import larger_room as room


@pytest.mark.parametrize(
    ("sentence", "verbs", "ids"),
    [
        ("press the button - i dare you", ["press"], [BUTTON]),
        ("take the red cube, if you can manage hehe", ["lift"], [RED]),
        ("right, back to work, open the drawer", ["open"], [DRAWER]),
        ("the red cube is mine and I'd like to have it", ["hand_over"], [RED]),
        ("my daughter would love it if you opened the drawer", ["open"], [DRAWER]),
    ],
)
def test_talk_about_people_and_the_occasion_changes_nothing(sentence, verbs, ids):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Plan)
    assert asked_steps(outcome) == list(zip(verbs, ids, strict=True))


@pytest.mark.parametrize(
    ("sentence", "control"),
    [
        ("ok back off a bit, you're blocking my view", "home"),
        ("stop! i can't watch this", "stop"),
        ("open the drawer. just kidding", "stop"),
    ],
)
def test_a_signal_is_given_with_its_reason(sentence, control):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Signal)
    assert outcome.control == control


def test_who_wants_to_be_entertained_is_told_what_can_be_done():
    said_last = Dialogue().answer("i'm a bit bored, show me something cool", room())
    assert isinstance(said_last, Answer)
    assert "open and close" in said_last.text


@pytest.mark.parametrize(
    ("sentence", "answers"),
    [
        (
            "where is the red cube, and is the drawer open?",
            ["The red cube is on the table", "drawer is closed"],
        ),
        ("how many cubes do you see, and is one of them yellow?", ["there are", "Yes: the yellow cube is yellow"]),
        ("is the red cube nearer to the button or to the yellow one?", ["To the", "cm from the red cube"]),
        ("did you break anything??", ["Not that I know"]),
        ("is anything broken?", ["Not that I know"]),
        ("are there any cubes here?", ["Yes: the "]),
        ("is the button on the right?", ["No: the gray button is on the table, on the left"]),
        ("the drawer is open right?", ["No: the blue drawer is closed"]),
        ("what's in the drawer and what's in the fridge?", ["in the drawer. ", "in the fridge"]),
    ],
)
def test_questions_are_answered_truly_each_of_several(sentence, answers):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Answer)
    assert [each for each in answers if each.lower() not in outcome.text.lower()] == []


@pytest.mark.parametrize("sentence", ["is the red cube dirty?", "are the cubes heavy?", "is anything wet?"])
def test_what_nobody_can_see_is_not_claimed(sentence):
    assert isinstance(Dialogue().answer(sentence, room()), Refusal)


def test_right_in_front_of_something_is_only_what_is_nearest():
    outcome = Dialogue().answer("which cube is right in front of the wheel?", room())
    assert isinstance(outcome, Answer)
    assert outcome.about == (CYAN,)


@pytest.mark.parametrize(
    "sentence",
    ["put the red and the yellow cube in the drawer", "both the red and the yellow cube should go in the drawer"],
)
def test_of_two_things_that_have_no_room_together_none_is_moved(sentence):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Refusal)
    assert "one thing at a time" in outcome.text


TOWERS = [("cube", "cyan", 1, 2, 0), ("cube", "cyan", 5, 3, 0), ("cube", "gray", 6, 0, 1), ("cube", "orange", 6, 0, 0)]


def test_the_top_one_is_that_of_the_tower_that_was_spoken_of():
    dialogue, world = Dialogue(), board(TOWERS)
    world = dialogue.answer("stack the cyan ones", world).result
    told = dialogue.answer("how high is that tower now?", world)
    assert told.text.startswith("It is 2 high: the cyan cube")
    outcome = dialogue.answer("too high for me, take the top one down again", world)
    assert isinstance(outcome, Plan)
    assert [world.things[step.object].color for step in outcome.steps] == ["cyan", "cyan"]


def test_of_several_that_go_on_a_cube_the_next_goes_on_the_one_before():
    outcome = Dialogue().answer("put both cyan cubes on the gray one", board(TOWERS))
    assert isinstance(outcome, Plan)
    assert sorted(thing.bottom for thing in outcome.result.things if thing.color == "cyan") == [2, 3]


THREE = table(Scene([Object("cube", c, (0.44, y, 0.025)) for c, y in (("cyan", 0.0), ("pink", 0.17), ("blue", -0.2))]))


def colors_from_below(world, index=1):
    return [world.things[i].color for i in world.column(world.things[index].x, world.things[index].y)]


def test_them_without_anything_spoken_of_are_all_and_the_order_of_a_tower_can_be_changed():
    dialogue = Dialogue()
    first = dialogue.answer("pile them all up with pink at the bottom", THREE)
    assert isinstance(first, Plan)
    assert colors_from_below(first.result)[0] == "pink"
    outcome = dialogue.answer("actually i want blue at the bottom", first.result)
    assert isinstance(outcome, Plan)
    assert colors_from_below(outcome.result)[0] == "blue"
    assert len(colors_from_below(outcome.result)) == 3


def test_what_would_happen_is_told_and_can_be_tried():
    dialogue = Dialogue()
    told = dialogue.answer("what happens if i press the button", room())
    assert told.text == "I would press the gray button. Say 'do it' if you want that"
    assert asked_steps(dialogue.answer("go on then, try it", room())) == [("press", BUTTON)]


def test_who_wants_all_in_a_drawer_is_told_that_one_fits():
    outcome = Dialogue().answer("let's clean up. all cubes that are lying around go in the drawer", room())
    assert isinstance(outcome, Question)
    assert outcome.text.startswith("One thing fits in the blue drawer. Do you mean")


@pytest.mark.parametrize(
    "sentence",
    [
        "ok now the red one goes on the blue one and the yellow one goes into the drawer",
        "the red one should go on the blue one, the yellow one should go in the drawer",
        "the red one goes on the blue one and the yellow one in the drawer",
    ],
)
def test_each_of_several_things_goes_where_it_belongs(sentence):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Plan)
    placed = [(step.object, step.goal) for step in outcome.steps if step.goal is not None]
    assert placed == [(RED, BLUE), (YELLOW, DRAWER)]


def test_what_lies_in_a_hand_has_nothing_under_it_but_is_told_to_lie_there():
    dialogue = Dialogue()
    world = dialogue.answer("put the red cube in my hand", room()).result
    told = dialogue.answer("whats underneath it?", world)
    assert told.text == "Nothing is underneath it: the red cube is in your hand."
    back = dialogue.answer("hmm no changed my mind, put it back where it was", world)
    assert isinstance(back, Plan)
    assert back.result.inside == {}


@pytest.mark.parametrize("before", ["my friend there snores zzz,", "is the drawer open?"])
def test_the_arm_goes_home_after_a_command_beside_chat_and_questions_as_it_says(before):
    dialogue = Dialogue()
    outcome = dialogue.answer(f"{before} put the red cube on the blue one and then go home", room())
    assert "after that I go back to my rest position" in outcome.notes
    assert dialogue.homeward

"""Commands as people write them for a robot: with handles, lengths, towers, several containers, and wishes."""

import math

import pytest

from language import Answer, Dialogue, Plan, Question, Refusal, Signal
from tests.helpers.room_cases import outcome_of
from tests.helpers.sets_room import FACTS, NAMES, done, room, said

TAKES = ("lift", "grasp", "take_out")
CUBES = ("yellow", "blue", "orange", "cyan", "red", "gray")


def apart(world, one, other):
    """Metres between the middles of two things."""
    first, second = (world.things[NAMES.index(name)] for name in (one, other))
    return math.dist((first.x, first.y), (second.x, second.y))


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("push the handle to close the drawer", "B", ["close drawer"]),
        ("grip the handle of the fridge and pull", "A", ["open fridge"]),
        ("the robot grabs the handle of the open drawer and slides it until it is fully closed", "B", ["close drawer"]),
        ("push in the drawer", "B", ["close drawer"]),
        ("shut all open things", "B", ["close drawer"]),
        ("open all closed doors", "B", ["open fridge"]),
        ("the open drawer ruins the picture", "B", ["close drawer"]),
        ("I'm done with the fridge, but I still need the drawer", "BF", ["close fridge"]),
        ("put the red cube in the closed one", "B", ["open fridge", "put_in red fridge"]),
        (
            "there should be one cube in the fridge and one in the drawer",
            "BF",
            ["put_in yellow fridge", "put_in blue drawer"],
        ),
        ("put the red cube into it", "B", ["put_in red drawer"]),
        ("leave the red one in but take out the yellow one", "I", ["take_out yellow fridge"]),
        ("take everything out", "C", ["pick_and_place blue"]),
        ("put the blue cube in the drawer instead of the red one", "I", ["pick_and_place red", "put_in blue drawer"]),
        ("free the red cube", "K", ["open drawer", "take_out red drawer"]),
        ("check whether the drawer is empty and if so put the red cube inside", "B", ["put_in red drawer"]),
    ],
)
def test_containers_are_opened_closed_filled_and_emptied(sentence, state, steps):
    found = done(sentence, state)
    assert [step for step in found if len(found) == 1 or not step.startswith("take_out") or step == steps[-1]] == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("take the lower cube", "S", ["pick_and_place blue", "grasp cyan"]),
        ("lift the upper block", "S", ["lift blue"]),
        ("put the bottom one on top", "S", ["pick_and_place blue", "stack cyan blue"]),
        ("swap the two stacked cubes", "S", ["pick_and_place blue", "stack cyan blue"]),
        ("break the tower", "S", ["pick_and_place blue"]),
        ("clear the cyan cube", "S", ["pick_and_place blue"]),
        ("craft a two high tower out of yellow and cyan", "A", ["stack cyan yellow"]),
        ("make a pile with the red one on the bottom", "A", ["stack yellow red"]),
    ],
)
def test_cubes_of_a_tower_are_told_by_their_height(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("turn the wheel a quarter turn", "A", ["turn wheel"]),
        ("turn the lever on and off", "A", ["switch lever", "switch lever"]),
        ("lever, wheel, button in that order", "A", ["switch lever", "turn wheel", "press button"]),
        ("touch the lever with the tip of your gripper", "A", ["reach lever"]),
        ("I just want the button down", "A", ["press button"]),
        ("if you could press the button that would be great", "A", ["press button"]),
        ("are you able to open the fridge", "A", ["open fridge"]),
        ("why don't you open the drawer?", "A", ["open drawer"]),
        ("how many times do I have to say it, SHUT THE FRIDGE", "F", ["close fridge"]),
        ("brilliant, chef's kiss! press the button", "A", ["press button"]),
        ("avoid the red cube and pick up the blue cube", "A", ["lift blue"]),
        ("uh no don't put it in the drawer put it in the fridge", "D", ["put_in red fridge"]),
        ("hand the person the cube that is left of the gray cube", "A", ["hand_over cyan hand"]),
        ("put what I hold on the table", "H", ["pick_and_place orange"]),
        ("return the red cube to the table", "D", ["pick_and_place red"]),
    ],
)
def test_words_around_a_command_do_not_change_it(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize("others", ["the others", "all the other blocks", "the rest"])
def test_a_cube_is_moved_away_from_several_others(others):
    world = room(FACTS["A"])
    outcome = Dialogue().answer(f"move the orange cube away from {others}", world)
    nearest = [min(apart(w, "orange", other) for other in CUBES if other != "orange") for w in (world, outcome.result)]
    assert nearest[1] > nearest[0]


@pytest.mark.parametrize(
    ("sentence", "low"),
    [("move the gray block to the other side of the table", 0.05), ("make the gray cube the leftmost", 0.2)],
)
def test_a_cube_goes_to_the_side_that_is_said(sentence, low):
    assert said(sentence).result.things[NAMES.index("gray")].y > low


@pytest.mark.parametrize(
    "sentence",
    [
        "put red, yellow and blue in a row, red on the left",
        "order the cubes red, yellow, blue from left to right",
        "arrange the blocks from left to right: red, yellow, blue",
    ],
)
def test_the_order_of_a_row_is_the_one_that_is_said(sentence):
    things = said(sentence).result.things
    ys = [things[NAMES.index(name)].y for name in ("red", "yellow", "blue")]
    assert ys == sorted(ys, reverse=True)


@pytest.mark.parametrize(
    "sentence", ["gather all the blocks in one spot", "put all the cubes in one place", "spread the cubes out"]
)
def test_all_cubes_are_moved_where_all_are_meant(sentence):
    moved = {step.object for step in said(sentence).steps}
    assert moved == {NAMES.index(name) for name in CUBES}


@pytest.mark.parametrize("sentence", ["move everything away from the edge", "take out all the cubes"])
def test_no_plan_puts_every_thing_where_it_stands(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal)
    assert "already" in outcome.text


@pytest.mark.parametrize("sentence", ["open your gripper", "let go", "release your grip please"])
def test_an_empty_gripper_lets_nothing_go(sentence):
    assert "nothing is in my gripper" in said(sentence).text.lower()
    assert done(sentence, "D") == ["pick_and_place red"]


@pytest.mark.parametrize("sentence", ["raise the arm", "move your arm out of the way"])
def test_an_arm_that_is_in_the_way_goes_home(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Signal)
    assert outcome.control == "home"


@pytest.mark.parametrize(
    ("sentence", "state", "words"),
    [
        ("how mny cubes are there", "A", ["six"]),
        ("what is left on the table?", "K", ["blue", "orange", "cyan", "gray"]),
        ("tell me about the drawer", "B", ["open"]),
        ("where's the yellow one hiding", "K", ["fridge"]),
        ("is my hand empty?", "H", ["no", "orange"]),
        ("tell me the colour of the leftmost cube", "A", ["red"]),
        ("what fits in the drawer", "B", ["one"]),
        ("is there anything at all left in the refrigerator?", "K", ["yes", "yellow"]),
        ("is the lever on or off", "A", ["on:"]),
        ("which one is the blue cube nearer to, yellow or red?", "A", ["yellow"]),
    ],
)
def test_questions_in_other_words_are_answered(sentence, state, words):
    outcome = said(sentence, state)
    assert isinstance(outcome, Answer), outcome
    assert all(word in outcome.text.lower() for word in words)


@pytest.mark.parametrize(
    ("turns", "words"),
    [
        ("where is the drawer? / and inside it?", ["nothing"]),
        (
            "put the red cube in the drawer / which cubes are left over?",
            ["yellow", "blue", "orange", "cyan", "gray"],
        ),
        ("move the gray cube to the left / how far did you move it", ["cm"]),
    ],
)
def test_questions_go_on_from_what_was_said_and_done(turns, words):
    outcome = outcome_of(turns, room(FACTS["A"]))
    assert isinstance(outcome, Answer), outcome
    assert all(word in outcome.text.lower() for word in words)


@pytest.mark.parametrize(
    ("turns", "verbs"),
    [
        ("put the red cube in the drawer / ok, and now the lever", ["switch"]),
        ("stack red on blue / I wanted it the other way around", ["pick_and_place", "stack"]),
    ],
)
def test_commands_go_on_from_what_was_done(turns, verbs):
    outcome = outcome_of(turns, room(FACTS["A"]))
    assert isinstance(outcome, Plan), outcome
    assert [step.verb for step in outcome.steps if step.verb != "lift"] == verbs


def test_a_third_cube_is_refused_on_a_tower_of_two():
    outcome = outcome_of("stack red on blue / put another one on top", room(FACTS["A"]))
    assert isinstance(outcome, Refusal)
    assert "on top of two" in outcome.text


@pytest.mark.parametrize("sentence", ["open the drawer and zorp the red cube", "press the button, zorp the red cube"])
def test_a_clause_whose_verb_is_unknown_is_not_left_out(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal)
    assert "zorp" in outcome.text


@pytest.mark.parametrize(
    ("sentence", "things"),
    [
        ("put one of the cubes in the drawer", CUBES),
        ("put a cube on the right into the drawer", ("blue", "orange", "gray")),
        ("put one of the two cubes on the right in the fridge", ("blue", "orange", "gray")),
        ("stack one of the cubes on the red cube", CUBES[:4]),
    ],
)
def test_one_of_several_things_is_any_of_those_that_fit(sentence, things):
    outcome = said(sentence)
    assert isinstance(outcome, Plan), outcome
    assert NAMES[outcome.steps[-1].object] in things


def test_a_move_is_repeated_with_the_thing_that_was_asked_for():
    before = outcome_of("move the cube to the left / the yellow one", room(FACTS["A"]))
    after = outcome_of("move the cube to the left / the yellow one / a bit more", room(FACTS["A"]))
    yellow = NAMES.index("yellow")
    assert isinstance(after, Plan), after
    assert after.result.things[yellow].y > before.result.things[yellow].y


@pytest.mark.parametrize("sentence", ["put the blue cube and the gray one on the red one", "stack all cubes"])
def test_a_tower_of_three_is_refused_as_too_high(sentence):
    outcome = said(sentence)
    assert isinstance(outcome, Refusal), outcome
    assert "is too high" in outcome.text


@pytest.mark.parametrize(
    ("turns", "state", "steps"),
    [
        ("which cubes are on the right? / give me one of them", "A", ["hand_over blue"]),
        (
            "touch red and blue / put those two cubes on the left side",
            "A",
            ["pick_and_place blue", "pick_and_place red"],
        ),
        ("put two cubes on the left / the red and the gray one", "A", ["pick_and_place red", "pick_and_place gray"]),
        ("put the blue and the gray cube on the left", "A", ["pick_and_place blue", "pick_and_place gray"]),
        ("make a second tower with orange and blue", "A", ["stack blue"]),
        ("pick up cyan / put it to the see-through cube / now the red one on top", "A", ["stack red"]),
        (
            "swap the cube in the drawer and the one in the fridge",
            "I",
            ["pick_and_place red", "put_in yellow", "put_in red"],
        ),
    ],
)
def test_some_of_what_was_spoken_of_is_meant(turns, state, steps):
    outcome = outcome_of(turns, room(FACTS[state]))
    assert isinstance(outcome, Plan), outcome
    assert [f"{step.verb} {NAMES[step.object]}" for step in outcome.steps if step.verb not in TAKES] == steps


def test_a_cube_goes_in_there_only_if_one_container_is_meant():
    outcome = said("put the blue cube in there", "BF")
    assert isinstance(outcome, Question)
    assert len(outcome.choices) == 2


def test_things_of_two_containers_are_put_next_to_each_other():
    world = said("put the red and the yellow cube next to each other on the table", "I").result
    assert apart(world, "red", "yellow") < 0.1


def test_one_more_is_another_thing_where_something_was_put_and_a_repetition_elsewhere():
    assert isinstance(outcome_of("put the gray cube on the left side / one more", room(FACTS["A"])), Question)
    again = outcome_of("touch the gray cube / one more", room(FACTS["A"]))
    assert [NAMES[step.object] for step in again.steps] == ["gray"]


def test_cubes_on_one_side_are_counted_as_they_are_chosen():
    assert "three (3)" in said("how many cubes are on the right side now").text

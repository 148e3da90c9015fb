"""What visitors said that was once done wrong, refused without help, or answered with what is not so."""

import math

import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal, board, table
from language.talk import name, said, where
from tests.helpers.room_cases import BUTTON, DRAWER, FRIDGE, OBJECTS, ORANGE, RED, WHEEL, YELLOW, asked_steps
from tests.helpers.room_cases import larger_room as room


def stacked():
    """The room with the orange cube on the yellow one."""
    x, y, z = OBJECTS[YELLOW].position
    return room(Object("cube", "orange", (x, y, z + 0.05)))


APART = [("red", (0.34, -0.2, 0.025)), ("green", (0.44, 0.0, 0.025))]


@pytest.mark.parametrize(
    ("sentence", "verbs", "ids"),
    [
        ("either open the drawer or the fridge, whichever you like", ["open"], [DRAWER]),
        ("open the drawer or the fridge", ["open"], [DRAWER]),
        ("the drawer gets the red cube", ["open", "put_in"], [DRAWER, RED]),
        ("leave the wheel alone and press the button", ["press"], [BUTTON]),
        ("you don't need to open the fridge, just press the button", ["press"], [BUTTON]),
        ("at least press one of the buttons", ["press"], [BUTTON]),
        ("the red wheel, turn it", ["turn"], [WHEEL]),
        ("the red thing you can turn, turn it", ["turn"], [WHEEL]),
        ("open the fridge... actually no, the drawer", ["open"], [DRAWER]),
        ("opn the drwer an put teh red cub in it", ["open", "put_in"], [DRAWER, RED]),
        ("cool down the yellow block", ["open", "put_in"], [FRIDGE, YELLOW]),
    ],
)
def test_what_is_asked_for_is_done_once_and_nothing_else(sentence, verbs, ids):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Plan)
    assert asked_steps(outcome) == list(zip(verbs, ids, strict=True))


def test_a_round_trip_has_both_ways():
    world = room()
    outcome = Dialogue().answer("put the red cube to the left of the orange one and then back to where it was", world)
    out, back = (step for step in outcome.steps if step.carries)
    assert out.object == back.object == RED
    assert out.place[1] > world.things[ORANGE].y  # the robot's left
    assert back.place == pytest.approx((world.things[RED].x, world.things[RED].y))


def test_the_side_of_a_thing_is_a_place_beside_it():
    world = room()
    outcome = Dialogue().answer("put the red cube on the orange cube's left", world)
    assert outcome.steps[-1].goal is None
    assert outcome.steps[-1].place[1] > world.things[ORANGE].y + world.things[ORANGE].width


def test_a_place_diagonally_behind_is_to_that_side():
    world = room()
    outcome = Dialogue().answer("put the cyan cube diagonally behind the yellow one to the right", world)
    assert outcome.steps[-1].place[1] < world.things[YELLOW].y - 0.02


def test_back_where_it_was_is_on_top_of_what_it_stood_on():
    dialogue, world = Dialogue(), stacked()
    outcome = dialogue.answer("put the orange cube next to the blue one", world)
    outcome = dialogue.answer("put it back", outcome.result)
    assert (outcome.steps[-1].object, outcome.steps[-1].goal) == (ORANGE, YELLOW)


def test_where_a_thing_was_is_where_it_stood_before_the_sentence():
    world = room()
    outcome = Dialogue().answer("put the yellow cube in the drawer and the cyan one where the yellow one was", world)
    assert outcome.steps[-1].place == pytest.approx((world.things[YELLOW].x, world.things[YELLOW].y))


@pytest.mark.parametrize("place", ["somewhere else", "aside", "to another place", "out of the way"])
def test_elsewhere_is_a_place_away_from_where_a_thing_stands(place):
    world = room()
    outcome = Dialogue().answer(f"move the red cube {place}", world)
    assert math.dist(outcome.steps[-1].place, (world.things[RED].x, world.things[RED].y)) > 0.09


@pytest.mark.parametrize(
    ("phrase", "thing"),
    [
        ("cube of the same colour as the fridge", RED),
        ("cube whose color matches the fridge", RED),
        ("left one of the red and the orange cube", RED),
    ],
)
def test_a_cube_is_named_by_another_thing_of_its_colour_or_by_its_side_among_several(phrase, thing):
    assert Dialogue().answer(f"pick up the {phrase}", room()).steps[-1].object == thing


@pytest.mark.parametrize("opening", ["excuse me", "pardon me", "sorry to bother you", "one question"])
def test_a_question_after_a_polite_opening_is_answered(opening):
    assert isinstance(Dialogue().answer(f"{opening}, is the red cube still on the table?", room()), Answer)


def test_only_what_has_a_lid_is_open_when_it_is_up():
    assert Dialogue().answer("is the lid of the fridge up?", room()).text.startswith("No")
    assert Dialogue().answer("is the red cube lifted?", room()).text.startswith("No: the red cube is on the table")


def test_a_step_is_not_lost_between_others_that_begin_alike():
    dialogue = Dialogue()
    opened = dialogue.answer("open the fridge and the drawer", room())
    outcome = dialogue.answer("touch the fridge, close the fridge, close the drawer", opened.result)
    assert [step.object for step in outcome.steps] == [FRIDGE, FRIDGE, DRAWER]


def test_a_deed_that_a_clause_of_time_tells_keeps_its_place():
    steps = Dialogue().answer("press the button after red is stacked on yellow", room()).steps
    assert [(step.object, step.goal) for step in steps[-2:]] == [(RED, YELLOW), (BUTTON, None)]


@pytest.mark.parametrize(
    "sentence", ["make two towers of two cubes", "build two stacks", "make two piles of two blocks each"]
)
def test_two_towers_are_built_where_two_are_asked_for(sentence):
    steps = [step for step in Dialogue().answer(sentence, room()).steps if step.goal is not None]
    assert len(steps) == 2
    assert len({index for step in steps for index in (step.object, step.goal)}) == 4


def test_a_button_that_stays_down_is_pressed_once_and_that_is_said():
    outcome = Dialogue().answer("push the button twice", room())
    assert "once" in outcome.notes[0]


def test_a_free_spot_beside_a_thing_touches_none():
    """At the corner of a cube the distance between the middles says nothing of that."""
    world = stacked()
    step = next(s for s in Dialogue().answer("take the yellow cube", world).steps if s.object == ORANGE and s.carries)
    for index, thing in enumerate(world.things):
        if index != ORANGE and world.is_on_ground(index) and world.is_loose(index):
            assert max(abs(thing.x - step.place[0]), abs(thing.y - step.place[1])) > thing.width


# ---- Talk


@pytest.mark.parametrize(
    ("said", "beginning"),
    [
        ("hello robot", "Hello"),
        ("good morning", "Hello"),
        ("hey there", "Hello"),
        ("bye", "Goodbye"),
        ("thanks a lot", "You are welcome"),
        ("thanks, bye", "You are welcome. Goodbye"),
    ],
)
def test_greetings_thanks_and_farewells_are_answered_in_kind(said, beginning):
    answer = Dialogue().answer(said, room())
    assert isinstance(answer, Answer)
    assert answer.text.startswith(beginning)


def test_what_is_in_front_of_the_robot_is_what_it_sees():
    assert "the yellow cube" in Dialogue().answer("whats in front of you", room()).text


@pytest.mark.parametrize("question", ["your left or mine?", "is that your left or my left?", "left as seen by whom?"])
def test_whose_left_is_meant_is_told(question):
    dialogue = Dialogue()
    dialogue.answer("put the red cube to the left", room())
    answer = dialogue.answer(question, dialogue.now)
    assert isinstance(answer, Answer)
    assert "Left and right are" in answer.text


@pytest.mark.parametrize(
    ("said", "control"),
    [("stpo", "stop"), ("wiat", "wait"), ("contineu", "continue"), ("actualy no, leave it", "stop"), ("undoo", "undo")],
)
def test_signals_are_understood_with_a_wrong_letter(said, control):
    dialogue = Dialogue()
    dialogue.answer("put the red cube on the yellow one", room())
    outcome = dialogue.answer(said, dialogue.now)
    assert isinstance(outcome, Signal)
    assert outcome.control == control


def test_a_command_that_is_taken_back_stops_what_is_being_done():
    dialogue = Dialogue()
    dialogue.answer("open the drawer", room())
    outcome = dialogue.answer("open the fridge, no stop", dialogue.now)
    assert isinstance(outcome, Signal)
    assert outcome.control == "stop"


@pytest.mark.parametrize("home", ["go home", "return to your starting position", "go back to where you started please"])
def test_home_may_follow_other_steps(home):
    dialogue = Dialogue()
    outcome = dialogue.answer(f"open the drawer and then {home}", room())
    assert asked_steps(outcome) == [("open", DRAWER)]
    assert "rest position" in outcome.notes[-1]
    assert dialogue.homeward
    dialogue.answer("what are you doing?", dialogue.now)
    assert dialogue.homeward
    dialogue.answer("close the drawer", dialogue.now)
    assert not dialogue.homeward


def gap(world, one, other):
    return abs(world.things[one].x - world.things[other].x) + abs(world.things[one].y - world.things[other].y)


@pytest.mark.parametrize("said", ["a bit further away", "move it farther away please"])
def test_closer_and_further_away_are_measured_from_what_a_thing_was_put_beside(said):
    dialogue = Dialogue()
    near = dialogue.answer("put the red cube to the right of the orange cube", room()).result
    outcome = dialogue.answer(said, near)
    assert gap(outcome.result, RED, ORANGE) > gap(near, RED, ORANGE)
    back = dialogue.answer("closer", outcome.result)
    assert gap(back.result, RED, ORANGE) < gap(outcome.result, RED, ORANGE)


def test_a_thing_that_cannot_come_closer_stays_and_that_is_said():
    dialogue = Dialogue()
    near = dialogue.answer("put the red cube to the right of the orange cube", room()).result
    outcome = dialogue.answer("a bit closer", near)
    assert isinstance(outcome, Refusal)
    assert "as close to the orange cube" in outcome.text


@pytest.mark.parametrize("sentence", ["geh zum rosa würfel", "beweg dich zum zylinder", "jdi na žlutou kostku"])
def test_other_languages_are_told_apart_from_words_that_are_not_known(sentence):
    assert Dialogue().answer(sentence, room()).reason == "language"


# ---- Boards

BLOCKS = [
    ("cube", "pink", 0, 0, 0),
    ("cube", "pink", 6, 1, 0),
    ("cube", "red", 5, 6, 0),
    ("cube", "green", 3, 4, 0),
    ("cube", "gray", 6, 0, 0),
]


def test_things_of_one_kind_have_names_that_say_which_and_are_understood():
    world = board(BLOCKS)
    for index in range(len(BLOCKS)):
        assert "height" not in name(world, index)
        outcome = Dialogue().answer(f"take {name(world, index)}", world)
        assert [step.object for step in outcome.steps] == [index]


def test_things_change_places_and_towers_are_built_on_boards_too():
    world = board(BLOCKS)
    swapped = Dialogue().answer("swap the red cube and the green cube", world).result
    assert [(swapped.things[i].x, swapped.things[i].y) for i in (2, 3)] == [(3, 4), (5, 6)]
    tower = Dialogue().answer("build a tower of three cubes", world).result
    assert sum(below is not None for below in tower.below) == 2


def test_a_move_by_cells_is_told_as_one():
    world = board(BLOCKS)
    outcome = Dialogue().answer("move the red cube two squares to the right", world)
    assert said(world, outcome.steps) == "put the red cube 2 cells to the right"


def test_a_move_by_cells_off_the_board_is_refused():
    """Rather than read as a place on the thing that is on that side."""
    outcome = Dialogue().answer("move the gray cube two squares to the left", board(BLOCKS, viewpoint="human"))
    assert isinstance(outcome, Refusal)
    assert "outside" in outcome.text


def test_a_double_letter_typed_once_is_likelier_than_another_letter():
    outcome = Dialogue().answer("put the yelow cube next to the green one", board([*BLOCKS, ("cube", "blue", 6, 0, 1)]))
    assert "no yellow cube" in outcome.message


def test_what_the_gripper_holds_hides_nothing_of_why_a_thing_is_not_found():
    outcome = Dialogue().answer("put the yellow cube on the red one", board(BLOCKS, held=3))
    assert isinstance(outcome, Refusal | Question)
    assert "no yellow cube" in outcome.message


@pytest.mark.parametrize(
    ("viewpoint", "first", "last"),
    [("human", "at the back, away from you", "at the front, near you"), ("robot", "near me", "away from me")],
)
def test_who_is_near_depends_on_whose_view_is_meant(viewpoint, first, last):
    """The robot stands at x = 0, and the person opposite it."""
    world = board(BLOCKS, viewpoint=viewpoint)
    assert first in where(world, 0)
    assert last in where(world, 1)


@pytest.mark.parametrize("viewpoint", ["human", "robot"])
def test_closer_to_me_is_away_from_the_robot_where_no_hand_is_held_out(viewpoint):
    scene = Scene([Object("cube", "gray", (0.44, 0.1, 0.025)), Object("cube", "green", (0.44, -0.1, 0.025))], viewpoint)
    step = Dialogue().answer("put the gray cube 5 cm closer to me", scene).steps[-1]
    assert step.place == pytest.approx((0.49, 0.1), abs=0.01)


def test_things_in_general_are_asked_about_and_certain_things_are_meant():
    world = room()
    assert isinstance(Dialogue().answer("can you stack cubes", world), Answer)
    assert not isinstance(Dialogue().answer("can you pick up the red cube", world), Answer)
    assert not isinstance(Dialogue().answer("can you stack the cubes", world), Answer)


def test_a_row_of_a_board_is_made_of_what_was_named():
    step = Dialogue().answer("line the pink cubes up", board(BLOCKS)).steps[-1]
    assert step.object in (0, 1)


@pytest.mark.parametrize("sentence", ["put the pink cube beside the other pink cube", "put the pink cubes together"])
def test_either_of_a_pair_may_go_to_the_other(sentence):
    outcome = Dialogue().answer(sentence, board(BLOCKS))
    assert isinstance(outcome, Plan)
    assert {step.object for step in outcome.steps} <= {0, 1}


# ---- What our own partners said


@pytest.mark.parametrize("said", ["put it on the floor", "drop the red cube on the ground"])
def test_nothing_is_put_below_the_table(said):
    dialogue = Dialogue()
    dialogue.answer("pick up the red cube", room())
    outcome = dialogue.answer(said, dialogue.now)
    assert isinstance(outcome, Refusal)
    assert "I put nothing on the" in outcome.text


@pytest.mark.parametrize(("said", "word"), [("open the wardrobe", "wardrobe"), ("open the oven", "oven")])
def test_what_is_not_here_is_not_taken_for_what_is(said, word):
    outcome = Dialogue().answer(said, room())
    assert isinstance(outcome, Refusal)
    assert word in outcome.text


@pytest.mark.parametrize(
    ("said", "control"),
    [
        ("you are really quick", None),
        ("wow, you are fast", None),
        ("you are too fast", "slower"),
        ("too quick", "slower"),
    ],
)
def test_quick_is_praise_and_too_quick_is_not(said, control):
    assert getattr(Dialogue().answer(said, room()), "control", None) == control


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("what is the lever for?", "switch"),
        ("what does the button do?", "press"),
        ("what is the drawer for?", "can be opened and closed"),
        ("what can i do with the red cube?", "pick up the red cube"),
        ("are you stuck?", "No: "),
        ("how high can you lift it?", "one height"),
    ],
)
def test_what_a_thing_is_for_is_told(question, answer):
    outcome = Dialogue().answer(question, room(Object("lever", "green", (0.6, -0.1, 0.03))))
    assert isinstance(outcome, Answer)
    assert answer in outcome.text


@pytest.mark.parametrize("said", ["none of these, the yellow one", "neither of those, the yellow one"])
def test_another_thing_may_be_named_after_a_question(said):
    dialogue, world = Dialogue(), room(Object("cube", "red", (0.36, -0.08, 0.025)))
    assert isinstance(dialogue.answer("pick up the red cube", world), Question)
    assert asked_steps(dialogue.answer(said, world)) == [("lift", YELLOW)]


def test_the_other_two_are_of_the_kind_that_was_spoken_of():
    kinds = ["sphere", "cube", "sphere", "cube", "sphere"]
    colors = ["red", "green", "blue", "yellow", "pink"]
    objects = [Object(k, c, (0.4, 0.1 * i, 0.025)) for i, (k, c) in enumerate(zip(kinds, colors, strict=True))]
    world = table(Scene(objects), verbs=("reach",))
    dialogue = Dialogue()
    dialogue.answer("touch the red ball", world)
    outcome = dialogue.answer("the other two as well", world)
    assert [step.object for step in outcome.steps] == [2, 4]


def test_a_word_that_may_be_several_is_no_signal():
    outcome = Dialogue().answer("go ther", room())
    assert getattr(outcome, "control", None) is None


@pytest.mark.parametrize("first", ["left of", "right of", "in front of", "next to"])
def test_the_other_side_is_across_from_what_a_thing_was_put_beside(first):
    dialogue, scene = Dialogue(), Scene([Object("cube", c, p) for c, p in APART])
    there = dialogue.answer(f"put the red cube {first} the green one", scene).result
    here = dialogue.answer("no, on the other side", there).result
    one, other = (
        (world.things[0].x - world.things[1].x, world.things[0].y - world.things[1].y) for world in (there, here)
    )
    assert one[0] * other[0] + one[1] * other[1] < 0


@pytest.mark.parametrize(
    "first", ["put the red cube on the yellow one", "open the fridge", "put the white cube on the red one"]
)
def test_there_is_no_other_side_where_no_side_was_said(first):
    dialogue = Dialogue()
    dialogue.answer(first, room())
    outcome = dialogue.answer("no, on the other side", dialogue.now)
    assert isinstance(outcome, Refusal)
    assert "other way round" in outcome.text


def test_a_side_that_was_not_free_has_another_side():
    dialogue, crowded = Dialogue(), Scene([Object("cube", c, p) for c, p in [*APART, ("blue", (0.44, 0.065, 0.025))]])
    blocked = [("pink", (0.44 + 0.05 * i, 0.13, 0.025)) for i in (-1, 0, 1)]
    crowded = Scene([*crowded, *(Object("cube", c, p) for c, p in blocked)])
    dialogue.answer("put the red cube to the left of the green one", crowded)
    outcome = dialogue.answer("no, on the other side", dialogue.now)
    assert outcome.steps[-1].place[1] < 0


def test_them_are_all_things_of_the_last_plan():
    dialogue = Dialogue()
    dialogue.answer("put the red cube in the drawer and the yellow one in the fridge", room())
    outcome = dialogue.answer("close them", dialogue.now)
    assert {step.object for step in outcome.steps} == {DRAWER, FRIDGE}


@pytest.mark.parametrize(
    ("said", "step"),
    [
        ("take the cube of colour orange", ("lift", ORANGE)),
        ("press the button or open the drawer, whichever you prefer", ("press", BUTTON)),
        ("make sure the button is down", ("press", BUTTON)),
        ("take a cube that is neither red nor orange nor cyan nor blue", ("lift", YELLOW)),
    ],
)
def test_colours_choices_and_states_that_are_wanted(said, step):
    outcome = Dialogue().answer(said, room())
    assert isinstance(outcome, Plan)
    assert asked_steps(outcome)[0] == step


@pytest.mark.parametrize(
    ("question", "parts"),
    [
        ("which things can you open?", ["the blue drawer", "the red fridge"]),
        ("what can you press?", ["button"]),
        ("can you lift two cubes at once?", ["No: ", "one thing"]),
        ("what all can you see here?", ["I see", "drawer"]),
    ],
)
def test_what_can_be_done_with_which_things_is_told(question, parts):
    outcome = Dialogue().answer(question, room())
    assert isinstance(outcome, Answer)
    assert all(part in outcome.text for part in parts)


def test_otherwise_nothing_is_done():
    outcome = Dialogue().answer("if the drawer is open, close it, otherwise leave it alone", room())
    assert isinstance(outcome, Answer)
    assert "I do nothing" in outcome.text


def test_a_bit_more_is_the_same_again():
    dialogue = Dialogue()
    dialogue.answer("turn the wheel", room())
    assert asked_steps(dialogue.answer("bit more", dialogue.now)) == [("turn", WHEEL)]


def test_what_follows_going_home_is_done_from_where_the_arm_is():
    outcome = Dialogue().answer("go back to the start, then put the red cube in the drawer", room())
    assert isinstance(outcome, Plan)
    assert asked_steps(outcome) == [("open", DRAWER), ("put_in", RED)]
    assert "I begin where my arm is" in outcome.notes
    for only in ("go home, please", "go home"):
        assert Dialogue().answer(only, room()).control == "home"


def test_as_far_as_possible_is_farther_than_away():
    world = room()
    fridge = world.things[FRIDGE]
    apart = []
    for where_to in (
        "away from the fridge",
        "as far from the fridge as you can",
        "as far away as possible from the fridge",
    ):
        result = Dialogue().answer(f"put the red cube {where_to}", world).result
        apart.append(math.dist((result.things[RED].x, result.things[RED].y), (fridge.x, fridge.y)))
    assert apart[1] == apart[2] > apart[0] + 0.1


@pytest.mark.parametrize("sentence", ["leave the red cube alone", "please let the wheel be"])
def test_what_is_to_be_left_alone_is_not_moved(sentence):
    outcome = Dialogue().answer(sentence, room())
    assert isinstance(outcome, Answer)
    assert "I do not" in outcome.text


def test_it_is_what_was_not_to_be_touched():
    outcome = Dialogue().answer("don't touch the red cube but pick up the one next to it", room())
    assert isinstance(outcome, Plan)
    assert asked_steps(outcome)[0][1] != RED


def test_why_a_thing_has_its_colour_is_not_known():
    assert isinstance(Dialogue().answer("why is the fridge red?", room()), Refusal)

"""Towers and rows whose order is said, on tables and boards, and towers that are taken apart."""

import numpy as np
import pytest

from language import Answer, Dialogue, Object, Plan, Refusal, Scene, board, table

NAMES = ("red", "green", "blue", "pink", "yellow")
APART = [(2, 2, 0), (1, 5, 0), (5, 1, 0), (4, 6, 0), (6, 4, 0)]
TOWER = [(2, 2, 0), (2, 2, 1), (2, 2, 2), (4, 6, 0), (6, 4, 0)]


def on_board(cells=APART):
    return board([("cube", color, *cell) for color, cell in zip(NAMES, cells, strict=True)], viewpoint="human")


def on_table(cells=APART):
    places = [(0.3 + 0.06 * x, -0.25 + 0.07 * y, 0.025 + 0.05 * z) for x, y, z in cells]
    return table(Scene([Object("cube", c, p) for c, p in zip(NAMES, places, strict=True)], "human"))


WORLDS = pytest.mark.parametrize("world", [on_board, on_table])


def after(sentences, world):
    dialogue, outcome = Dialogue(), None
    for sentence in sentences.split(" / "):
        outcome = dialogue.answer(sentence, world)
        world = dialogue.now
    assert isinstance(outcome, Plan), outcome
    return world


def tower(world, base):
    thing = world.things[NAMES.index(base)]
    return [NAMES[i] for i in world.column(thing.x, thing.y)]


@WORLDS
def test_a_thing_on_top_of_another_is_no_list_of_two(world):
    assert tower(after("red cube, on top of the blue cube", world()), "blue") == ["blue", "red"]


@WORLDS
@pytest.mark.parametrize(
    ("sentence", "order"),
    [
        ("green at the bottom, then red, then blue on top", "green red blue"),
        ("build a tower: blue on top, under it pink, and red at the very bottom", "red pink blue"),
        ("make a tower with a yellow base, green in the middle and a red top", "yellow green red"),
        ("from top to bottom: blue, green, red", "red green blue"),
        ("stack up the yellow, the pink and the red cube, from the bottom up", "yellow pink red"),
        ("could you make a stack with pink on top of blue on top of yellow", "yellow blue pink"),
        ("build a tower of three cubes, red first and then pink and blue", "red pink blue"),
        ("build a tower from the blue cube and the red cube with red at the bottom", "red blue"),
        ("what i would like is a tower where blue stands on top of red", "red blue"),
        ("we need a small tower, blue sitting on red", "red blue"),
        ("stack up blue and red so that red is the lower one", "red blue"),
        ("i want a tower where blue is the lowest, then comes pink, and red is the highest", "blue pink red"),
    ],
)
def test_a_tower_is_built_in_the_order_that_is_said(world, sentence, order):
    lowest = order.split()[0]
    assert tower(after(sentence, world()), lowest) == order.split()


@WORLDS
def test_a_tower_of_some_cubes_has_the_said_ones_at_its_ends(world):
    built = tower(after("build a tower of three cubes with the pink one at the bottom", world()), "pink")
    assert len(built) == 3
    built = tower(after("stack all the cubes, the yellow one at the bottom and the blue one on top", world()), "yellow")
    assert len(built) == 5
    assert built[-1] == "blue"


@WORLDS
def test_a_tower_is_turned_upside_down_by_moving_its_cubes(world):
    assert tower(after("turn the tower upside down", world(TOWER)), "blue") == ["blue", "green", "red"]
    sentences = "take the tower apart / and build it the other way round, with the red one on top"
    assert tower(after(sentences, world(TOWER)), "blue") == ["blue", "green", "red"]


@WORLDS
@pytest.mark.parametrize(
    "sentence", ["take the tower apart", "unstack everything", "dismantle it all", "tear down the tower, one by one"]
)
def test_a_tower_is_taken_apart_to_the_last_cube(world, sentence):
    world = after(sentence, world(TOWER))
    assert all(below is None for below in world.below)


@WORLDS
@pytest.mark.parametrize(
    ("sentence", "order"),
    [
        ("build me a row of red, blue and green along the front edge, from left to right", "red blue green"),
        ("make a row with pink on the left, red in the middle and yellow on the right", "pink red yellow"),
        ("line up red, green and blue from right to left", "blue green red"),
    ],
)
def test_a_row_is_straight_and_in_the_order_that_is_said(world, sentence, order):
    world = after(sentence, world())
    row = [world.things[NAMES.index(name)] for name in order.split()]
    assert len({round(thing.x, 3) for thing in row}) == 1
    assert [thing.y for thing in row] == sorted(thing.y for thing in row)  # a person's right is the robot's left
    if "front" in sentence:
        assert row[0].x == world.bounds[1]


@WORLDS
def test_a_row_or_tower_of_nothing_that_is_there_is_refused(world):
    assert isinstance(Dialogue().answer("build a tower with black at the bottom and red on top", world()), Refusal)
    assert isinstance(Dialogue().answer("make a row of black and white", world()), Refusal)


@pytest.mark.parametrize(
    "question",
    [
        "how many cubes high is the tower?",
        "how tall is the tower",
        "of how many cubes is the tower made?",
        "how high is it now?",
        "tell me the height of the stack",
        "how many levels does the tower have?",
    ],
)
@WORLDS
def test_the_height_of_a_tower_is_told_in_cubes(world, question):
    outcome = Dialogue().answer(question, world(TOWER))
    assert isinstance(outcome, Answer)
    assert outcome.text == "It is 3 high: the blue cube, the green cube and the red cube."


def test_the_topmost_cube_is_taken_and_kept():
    for sentence in ("pick up the cube at the top", "pick up the cube at the top and just hold it in the air"):
        outcome = Dialogue().answer(sentence, on_table(TOWER))
        assert isinstance(outcome, Plan)
        assert [NAMES[step.object] for step in outcome.steps] == ["blue"]


@WORLDS
@pytest.mark.parametrize("words", ["and one more", "once more", "and one more time"])
def test_one_more_is_the_same_step_again(world, words):
    dialogue, world = Dialogue(), world()
    dialogue.answer("move the pink cube a bit to the left", world)
    first, before = dialogue.now.things[3].y, world.things[3].y
    assert isinstance(dialogue.answer(words, dialogue.now), Plan)
    assert dialogue.now.things[3].y - first == pytest.approx(first - before, abs=0.011)


@WORLDS
def test_something_on_top_of_that_is_put_there_after_a_question(world):
    for question in ("", " / which one is at the top?"):
        assert len(tower(after(f"put red on blue{question} / and the green one on top of that", world()), "blue")) == 3


@WORLDS
@pytest.mark.parametrize(
    ("pair", "expected"),
    [
        ("green and blue", ["red", "blue", "green"]),
        ("blue and red", ["blue", "green", "red"]),
        ("red and green", ["green", "red", "blue"]),
    ],
)
def test_two_things_of_one_tower_change_places_in_it(world, pair, expected):
    before = world(TOWER)
    now = after(f"swap {pair}", before)
    assert tower(now, "red") == expected
    assert now.things[NAMES.index(expected[0])].x == pytest.approx(before.things[0].x)


@WORLDS
@pytest.mark.parametrize(
    "said", ["and blue on top", "the blue one too", "same for the blue one", "and the blue one on top of that"]
)
def test_what_follows_goes_on_top_of_what_was_stacked(world, said):
    assert tower(after(f"put green on red / {said}", world()), "red") == ["red", "green", "blue"]


@WORLDS
def test_another_one_is_none_of_the_tower(world):
    dialogue = Dialogue()
    dialogue.answer("put green on red", world())
    outcome = dialogue.answer("and another cube on top", dialogue.now)
    assert not {NAMES.index("red"), NAMES.index("green")} & {step.object for step in getattr(outcome, "steps", ())}


def test_next_to_what_was_stacked_is_not_on_top_of_it():
    now = after("put green on red / and the blue one next to it", on_table())
    assert tower(now, "blue") == ["blue"]


@WORLDS
def test_what_stands_on_nothing_is_not_unstacked(world):
    outcome = Dialogue().answer("unstack the pink cube", world(TOWER))
    assert isinstance(outcome, Refusal)
    assert "no other thing" in outcome.text


@WORLDS
@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("what is on the bottom?", "The red cube is under the green cube."),
        ("where is the red cube?", "the green cube is on it"),
        ("how many are on top of the red one?", "two (2)"),
        ("how many cubes are above the green one?", "one (1)"),
        ("how many are stacked?", "three (3)"),
        ("how many are there?", "five (5)"),
    ],
)
def test_answers_about_a_tower_count_what_is_over_a_thing(world, question, answer):
    outcome = Dialogue().answer(question, world(TOWER))
    assert isinstance(outcome, Answer)
    assert answer in outcome.text
    assert "next to" not in outcome.text


def test_what_would_happen_is_not_answered_with_what_is():
    assert isinstance(Dialogue().answer("how many cubes would fall if the tower fell?", on_board(TOWER)), Refusal)


@WORLDS
def test_all_of_a_tower_that_was_built_go_back_on_the_table(world):
    now = after(
        "build a tower of the red, the green and the blue cube / great. put them all back on the table", world()
    )
    assert not any(below is not None for below in now.below)


@WORLDS
def test_a_tower_that_was_built_grows(world):
    now = after("build a tower of red and green / and blue on top", world())
    assert tower(now, "red") == ["red", "green", "blue"]


def test_everything_is_put_on_the_table():
    now = after("put everything on the table", on_table(TOWER))
    assert not any(below is not None for below in now.below)


def test_what_is_on_the_table_already_is_not_moved_to_put_it_there():
    outcome = Dialogue().answer("put the cubes on the table", on_table())
    assert isinstance(outcome, Refusal)
    assert "on the table already" in outcome.text
    done = Dialogue().answer("disassemble that tower and leave the cubes lying on the table", on_table(TOWER))
    assert {NAMES[step.object] for step in done.steps} == {"green", "blue"}


@WORLDS
@pytest.mark.parametrize(
    ("question", "name"),
    [("which cube is the lowest of the stack?", "red"), ("which cube carries all the others?", "red")],
)
def test_the_lowest_cube_of_a_tower_is_told(world, question, name):
    outcome = Dialogue().answer(question, world(TOWER))
    assert isinstance(outcome, Answer)
    assert outcome.text.startswith(f"The {name} cube")


def test_no_cube_on_another_one_takes_the_towers_apart():
    now = after("i want no cube on another one", on_table(TOWER))
    assert not any(below is not None for below in now.below)


def test_them_are_all_of_a_tower_that_was_taken_apart():
    world = after("take the tower apart / put them in a row", on_table(TOWER))
    places = np.array([(thing.x, thing.y) for thing in world.things[:3]])
    assert len({round(world.things[i].bottom, 2) for i in range(3)}) == 1
    along = np.ptp(places, axis=0)
    assert along.min() < 0.01 < 0.1 < along.max()


def test_the_top_one_is_on_top_of_the_tower_if_there_is_one():
    dialogue, world = Dialogue(), on_table([(6, 2, 0), (1, 5, 0), (1, 1, 0), (6, 2, 1), (5, 4, 0)])
    outcome = dialogue.answer("pick up the top one", world)
    assert [NAMES[step.object] for step in outcome.steps] == ["pink"]

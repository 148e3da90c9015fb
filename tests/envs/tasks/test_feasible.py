"""What is feasible in a room as it is."""

import numpy as np
import pytest

from envs.tasks.shared.feasible import PLAIN_VERBS as VERBS
from envs.tasks.shared.feasible import Room, options
from language import COLORS, NOUNS, Scene
from language.verbs import HANDING

SIZE, AREA = 0.05, (0.32, 0.58, -0.13, 0.13)
CUBE, DRAWER, FRIDGE = (list(NOUNS).index(noun) for noun in ("cube", "drawer", "fridge"))
INSIDE = {3: (0.43, -0.36, 0.04), 4: (0.37, 0.36, 0.06)}  # a place in each fitting, by its number in `room`
ON_TABLE, ELSEWHERE = (0.4, 0.0, SIZE / 2), (0.5, 0.0, SIZE / 2)
FREE = (0.45, 0.1, SIZE / 2)  # of the target


def room(first=ON_TABLE, second=ELSEWHERE, drawer=1.0, fridge=0.0):
    """A room with two cubes (0, 1), a target (2), a drawer (3) and a fridge (4)."""
    nouns = [CUBE, CUBE, CUBE, DRAWER, FRIDGE]
    places = [first, second, FREE, (0.3, -0.36, 0.08), (0.27, 0.36, 0.1)]
    scene = Scene.from_arrays(nouns, range(5), places, SIZE, [False, False, True, False, False])
    inside = np.zeros((5, 5), bool)
    for thing in (0, 1):
        for fitting, place in INSIDE.items():
            inside[thing, fitting] = np.allclose(places[thing], place)
    fits = np.isin(nouns, (DRAWER, FRIDGE))
    return Room(scene, np.array([0, 0, 0, drawer, fridge]), inside, fits, AREA)


def said(room, verb, held=-1):
    return {(option.referent, option.target) for option in options(room, held) if option.verb == verb}


def test_what_stands_on_the_table_can_be_reached_taken_lifted_and_brought_everywhere():
    found = room()
    assert len(COLORS) >= 5
    for verb in ("grasp", "lift"):
        assert said(found, verb) == {(0, None), (1, None)}
    assert said(found, "reach") == {(0, None), (1, None), (3, None), (4, None)}
    assert said(found, "pick_and_place") == {(0, 2), (1, 2)}
    assert said(found, "stack") == {(0, 1), (1, 0)}
    assert said(found, "unstack") == said(found, "take_out") == set()
    assert {option.verb for option in options(found)} <= set(VERBS)


@pytest.mark.parametrize(
    ("share", "opens", "closes", "takes_in"),
    [(0.0, True, False, False), (0.5, False, False, False), (0.85, False, True, False), (1.0, False, True, True)],
)
def test_a_fitting_is_opened_when_shut_closed_when_open_and_filled_when_wide_open(share, opens, closes, takes_in):
    found = room(drawer=share)
    assert ((3, None) in said(found, "open")) == opens
    assert ((3, None) in said(found, "close")) == closes
    assert ((0, 3) in said(found, "put_in")) == takes_in


def test_what_lies_in_an_open_fitting_is_taken_out_and_nothing_else_is_put_in():
    found = room(first=INSIDE[3])
    assert said(found, "take_out") == {(0, 3)}
    assert said(found, "put_in") == set()
    assert said(found, "lift") == {(1, None)}
    assert said(room(first=INSIDE[3], drawer=0.0), "take_out") == set()


def test_of_a_stack_only_the_upper_object_is_taken_and_nothing_is_put_on_it():
    found = room(second=(ON_TABLE[0], ON_TABLE[1], 1.5 * SIZE))
    assert said(found, "unstack") == said(found, "lift") == {(1, None)}
    assert said(found, "stack") == set()
    assert said(found, "pick_and_place") == {(1, 2)}


def test_nothing_is_placed_where_something_stands():
    assert said(room(second=FREE), "pick_and_place") == set()


def test_with_an_object_in_the_gripper_only_what_can_be_done_with_it_is_feasible():
    found = room(first=(0.4, 0.0, 0.2))
    assert {(option.verb, option.referent, option.target) for option in options(found, held=0)} == {
        ("pick_and_place", 0, 2),
        ("stack", 0, 1),
        ("put_in", 0, 3),
    }


@pytest.mark.parametrize("lies", [False, True])
def test_an_object_is_handed_over_to_an_empty_hand_and_what_lies_on_one_is_left_there(lies):
    hand = (0.55, -0.45, 0.14)
    places = [(*hand[:2], hand[2] + SIZE / 2) if lies else ON_TABLE, ELSEWHERE, hand, (0.3, -0.36, 0.08)]
    nouns = [CUBE, CUBE, list(NOUNS).index("palm"), DRAWER]
    fits = np.isin(nouns, (DRAWER, FRIDGE))
    scene = Scene.from_arrays(nouns, range(4), places, SIZE, np.zeros(4, bool))
    found = Room(scene, np.zeros(4), np.zeros((4, 4), bool), fits, AREA)
    assert said(found, HANDING) == (set() if lies else {(0, 2), (1, 2)})
    assert said(found, HANDING, held=1) == (set() if lies else {(1, 2)})
    assert said(found, "lift") == ({(1, None)} if lies else {(0, None), (1, None)})
    assert said(found, "reach") == {*said(found, "lift"), (3, None)}
    assert said(found, "open") == {(3, None)}  # what lies on a hand is in the way of no fitting


def test_a_handle_in_the_gripper_excludes_nothing():
    assert options(room(), held=3) == options(room())


def test_an_object_in_the_way_of_the_fittings_keeps_them_from_being_moved():
    found = room(first=(0.35, -0.3, SIZE / 2))
    assert said(found, "open") == said(found, "close") == set()
    assert said(found, "grasp") == {(1, None)}

"""Sessions on the board: sentences are carried out on stacks, by the scripted expert or a policy."""

import numpy as np
import pytest

from demo import board
from demo.session import Session
from demo.session_config import make_config
from envs.experts import expert
from language import Plan
from tests.helpers.sessions import run_to_end, session_fixture

MAX_STEPS = 400  # control steps of one sentence: it may have several moves
FEW = ["task.num_objects=7", "task.min_objects=7"]


session = session_fixture(task="rearrange", driver="expert", overrides=FEW)


@pytest.fixture(autouse=True)
def _expert_at_rest(session):
    session.shuffle()
    session.set_driver("expert")


def loose_cubes(session):
    """(thing, name) of each cube on top of a stack whose name fits no other, and what the names are about."""
    world = board.world_of(session.env)
    names = [board.name(world, i) for i in range(len(world.things))]
    free = [i for i, above in enumerate(world.above) if above is None and world.things[i].kind == "cube"]
    return [(i, names[i]) for i in free if " at " not in names[i]]


def scene_with_loose_cubes(session, count=2):
    for _ in range(20):
        if len(cubes := loose_cubes(session)) >= count:
            return cubes
        session.shuffle()
    raise AssertionError("no scene with such cubes")


def cells(session):
    """(K, 3) column, row and level of each thing, as fractions."""
    numbers, grid = board.movable(session.env), board.grid_of(session.env)
    return (session.scene().positions[numbers] - grid.place(0, 0, 0)) / [grid.cell, grid.cell, grid.size]


@pytest.mark.slow
def test_a_task_with_stacks_takes_place_on_the_board(session):
    assert session.config.workspace == session.env.config.workspace.name == "board"


def test_a_cube_is_put_on_another_and_brought_back(session):
    (first, one), (second, other), *_ = scene_with_loose_cubes(session)
    before = cells(session)
    result = session.say(f"pls put {one} ontop of {other}")
    assert [action.verb for action in result.steps] == ["lift", "stack"]
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    expected = before.copy()
    expected[first] = before[second] + [0, 0, 1]
    np.testing.assert_allclose(cells(session), expected, atol=0.2)
    session.say("undo")
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    np.testing.assert_allclose(cells(session), before, atol=0.2)


def test_what_is_taken_stays_in_the_gripper_until_it_is_dropped(session):
    (first, name), *_ = scene_with_loose_cubes(session, 1)
    before = cells(session)
    session.say(f"pick up {name}")
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    assert board.world_of(session.env).held == first
    for _ in range(10):
        session.step()
    assert board.world_of(session.env).held == first
    session.say("drop it")
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    np.testing.assert_allclose(cells(session), before, atol=0.2)


def test_several_steps_are_done_in_order(session):
    for _ in range(20):  # in some scenes it asks where the second cube shall go
        (first, one), (second, other), *_ = scene_with_loose_cubes(session)
        result = session.say(f"put {one} in the back left corner, then put {other} on it")
        if isinstance(result, Plan):
            break
        session.shuffle()
    assert len(result.steps) == 4, result
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    np.testing.assert_allclose(cells(session)[[first, second], :2], [(7, 7), (7, 7)], atol=0.2)


def test_the_policy_places_objects_and_the_expert_holds_them(session):
    (first, one), (second, other), *_ = scene_with_loose_cubes(session)
    session._policy = expert(session.env)
    session.set_driver("policy")
    before = cells(session)
    session.say(f"put {one} on {other}")
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    np.testing.assert_allclose(cells(session)[first], before[second] + [0, 0, 1], atol=0.2)
    session.say(f"take {one}")
    assert run_to_end(session, MAX_STEPS).startswith("Done")
    assert board.world_of(session.env).held == first
    session._policy = None


def test_the_see_through_object_marks_the_place_only_while_something_is_brought_there(session):
    (_, one), *_ = scene_with_loose_cubes(session, 1)
    marker = int(np.flatnonzero(session.scene().targets)[0])
    assert session.scene().positions[marker, 2] < 0
    session.say(f"put {one} in the back left corner")
    session.step()
    place = board.grid_of(session.env).place(7, 7, 0)
    np.testing.assert_allclose(session.scene().positions[marker, :2], place[:2], atol=1e-3)
    run_to_end(session, MAX_STEPS)
    assert session.scene().positions[marker, 2] < 0


def test_a_verb_that_moves_nothing_is_refused_with_a_reason(session):
    (_, name), *_ = scene_with_loose_cubes(session, 1)
    result = session.say(f"reach {name}")
    assert "Try" in result.message
    assert not session.busy


def test_a_sentence_without_a_reading_gets_examples(session):
    assert "Try" in session.say("colourless ideas sleep").message
    assert not session.busy


def test_the_example_is_possible_in_every_scene(session):
    for _ in range(5):
        session.shuffle()
        assert session.preview(session.example()).steps, session.example()


@pytest.mark.slow
def test_pyramids_are_named_as_pyramids():
    session = Session(make_config(task="rearrange", driver="expert"), seed=0)
    seen = set()
    for _ in range(6):
        session.shuffle()
        names = session.object_names()
        seen |= {kind for kind in ("cube", "pyramid") for words in names if kind in words.split()}
        assert len(names) == len(session.scene())
    assert seen == {"cube", "pyramid"}
    session.close()


def test_an_object_that_is_dragged_stands_in_a_cell_on_top_of_what_is_there(session):
    (first, _), (second, _), *_ = scene_with_loose_cubes(session)
    numbers, places = board.movable(session.env), session.scene().positions
    session.put_object(int(numbers[first]), places[numbers[second], :2] + 0.01)
    for _ in range(10):
        session.step()
    now = cells(session)
    np.testing.assert_allclose(now[first], now[second] + [0, 0, 1], atol=0.2)

"""Lists of moves on the board, in the simulation."""

import numpy as np
import pytest

from core.errors import ConfigError
from envs.experts.board import Move, MoveRunner, carry_out, moves_of
from envs.tasks.board import SHAPES, Grid
from envs.tasks.shared.types import EpisodeSpec, GripperStart
from language import LanguageError, Plan, Scene, Step, board, interpret
from tests.helpers.env_cases import make

CELL, SIZE = 0.0375, 0.025
GRID = Grid([0.295, 0.595, -0.15, 0.15], CELL, SIZE)
TOWER = [(3, 4, level) for level in range(8)]
WALLS = [(i, j, level) for i, j in ((4, 3), (2, 3), (3, 2)) for level in range(8)]  # with TOWER round the cell (3, 3)


@pytest.fixture(scope="module")
def env():
    board = ["task.num_objects=40", "task.curriculum={near: 0, held: 1, placed: 0}"]
    made = make("kuka", "step", "rearrange", *board)
    yield made
    made.close()


def begin(env, cells, pyramids=(), held=None):
    """Lays out these cells, and gives the number of each among the objects that are shown."""
    places = np.array([GRID.place(*cell) for cell in cells])
    scene = Scene.from_arrays(np.zeros(len(cells), int), np.arange(len(cells)) % 9, places, SIZE)
    shapes = np.array([SHAPES.index("pyramid" if i in pyramids else "cube") for i in range(len(cells))])
    start = None if held is None else GripperStart(np.zeros(3), held=True)
    everything = np.ones(len(cells), bool)
    env.start([EpisodeSpec(scene=scene, referent=held or 0, shapes=shapes, resting=everything, start=start)], seed=1)
    shown = env.state.objects[0, env.state.shown[0]]
    return np.linalg.norm(shown[None] - places[:, None], axis=2).argmin(1)


def cells_now(env, order):
    """(K, 3) column, row and level where each object is now, as fractions."""
    shown = env.state.objects[0, env.state.shown[0]][order]
    return (shown - GRID.place(0, 0, 0)) / [CELL, CELL, SIZE]


@pytest.mark.slow
def test_moves_are_carried_out_one_after_another_and_nothing_else_moves(env):
    cells = [*TOWER, (6, 1, 0)]
    order = begin(env, cells)
    steps = [((7,), (6, 1, 1)), ((6,), (0, 7, 0)), ((7,), (0, 7, 1))]
    moves = [Move(int(order[thing]), GRID.place(*cell)) for (thing,), cell in steps]
    seen = []
    assert carry_out(env, moves, watch=seen.append) == [True] * 3
    assert len(seen) > 60
    cells[6], cells[7] = (0, 7, 0), (0, 7, 1)
    np.testing.assert_allclose(cells_now(env, order), cells, atol=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_an_object_goes_to_the_ground_between_stacks_of_eight_and_back(env, shape):
    cells = [*TOWER, *WALLS, (7, 7, 0)]
    order = begin(env, cells, pyramids=[len(cells) - 1] if shape == "pyramid" else [])
    thing = int(order[-1])
    assert carry_out(env, [Move(thing, GRID.place(3, 3, 0))]) == [True]
    assert carry_out(env, [Move(thing, GRID.place(7, 0, 0))]) == [True]
    cells[-1] = (7, 0, 0)
    np.testing.assert_allclose(cells_now(env, order), cells, atol=0.2)


def test_an_object_that_is_not_released_stays_in_the_gripper_in_the_air(env):
    order = begin(env, [(2, 2, 0), (2, 2, 1)])
    assert carry_out(env, [Move(int(order[1]), GRID.place(5, 5, 6), release=False)]) == [True]
    np.testing.assert_allclose(cells_now(env, order), [(2, 2, 0), (5, 5, 6)], atol=0.25)
    assert env.state.held[0] == np.flatnonzero(env.state.shown[0])[order[1]]


def test_an_object_that_is_held_at_first_is_put_down(env):
    order = begin(env, [(2, 2, 0), (4, 4, 7)], held=1)
    assert carry_out(env, [Move(int(order[1]), GRID.place(2, 2, 1))]) == [True]
    np.testing.assert_allclose(cells_now(env, order), [(2, 2, 0), (2, 2, 1)], atol=0.1)
    assert env.state.held[0] < 0


def test_a_move_that_takes_too_long_is_given_up_with_those_after_it(env):
    order = begin(env, [(2, 2, 0), (4, 4, 0)])
    runner = MoveRunner(env, [Move(int(order[0]), GRID.place(6, 6, 0)), Move(int(order[1]), (0, 0, 0))], max_steps=3)
    for _ in range(3):
        assert runner() is not None
    assert runner() is None
    assert runner.done == [False]


@pytest.mark.slow
def test_an_environment_of_several_worlds_or_without_a_gripper_is_refused():
    for many, task in ((2, "rearrange"), (1, "nl_reach")):
        made = make("kuka", "step", task, worlds=many)
        with pytest.raises(ConfigError, match="moves need one world, and a task that grips"):
            carry_out(made, [])
        made.close()


# ---- The moves of a command


def steps_of(sentence, world):
    outcome = interpret(sentence, world)
    assert isinstance(outcome, Plan), outcome
    return outcome.steps


def test_the_steps_of_a_command_become_moves_to_cells():
    world = board([("cube", "red", 1, 2, 0), ("cube", "blue", 4, 4, 0), ("pyramid", "green", 4, 4, 1)])
    steps = steps_of("put the green pyramid on the red cube, then pick up the blue cube", world)
    first, second = moves_of(steps, [(1, 2), (4, 4), (4, 4)], [7, 8, 9], GRID)
    assert (first.thing, first.release) == (9, True)
    np.testing.assert_allclose(first.place, GRID.place(1, 2, 1))
    assert (second.thing, second.release) == (8, False)
    np.testing.assert_allclose(second.place, GRID.place(4, 4, 7))


def test_a_moved_object_is_taken_from_its_new_place():
    actions = [Step("lift", 0), Step("pick_and_place", 0, None, (5.0, 6.0), 0.0), Step("lift", 0)]
    moves = moves_of(actions, [(1, 2)], [0], GRID)
    assert [move.release for move in moves] == [True, False]
    np.testing.assert_allclose(moves[1].place, GRID.place(5, 6, 7))


def test_a_step_that_moves_nothing_on_a_board_is_refused():
    with pytest.raises(LanguageError, match="'press' moves nothing on a board"):
        moves_of([Step("press", 0)], [(1, 2)], [0], GRID)


def test_a_command_is_carried_out_on_the_board(env):
    cells = [(1, 2, 0), (4, 4, 0), (4, 4, 1)]
    order = begin(env, cells)
    world = board([("cube", color, *cell) for color, cell in zip(("red", "blue", "green"), cells, strict=True)])
    steps = steps_of("put the green cube on the red cube and the blue cube in the back left corner", world)
    assert carry_out(env, moves_of(steps, [cell[:2] for cell in cells], order, GRID)) == [True, True]
    np.testing.assert_allclose(cells_now(env, order), [(1, 2, 0), (7, 7, 0), (1, 2, 1)], atol=0.15)

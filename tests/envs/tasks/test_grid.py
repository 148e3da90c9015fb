"""Objects in the cells of a board: where they are drawn."""

import numpy as np
import pytest

from core.errors import ConfigError
from envs.tasks.board import Grid, above

GRID = Grid([0.295, 0.595, -0.15, 0.15], cell=0.0375, size=0.025)
LEVELS = 8


def cells_of(places):
    """(K, 3) column, row and level of each place, as fractions."""
    low = GRID.place(0, 0, 0)
    return (places - low) / [GRID.cell, GRID.cell, GRID.size]


def test_a_place_is_the_middle_of_an_object_in_its_cell():
    assert (GRID.columns, GRID.rows) == (8, 8)
    np.testing.assert_allclose(GRID.place(0, 0, 0), [0.31375, -0.13125, 0.0125])
    np.testing.assert_allclose(GRID.place(7, 7, 7), [0.57625, 0.13125, 0.1875])


@pytest.mark.parametrize("count", [1, 16, 119])
def test_stacks_have_no_gaps_and_targets_are_free_places_on_top(count):
    for seed in range(30):
        cells = cells_of(GRID.draw(np.random.default_rng(seed), count, targets=2, levels=LEVELS))
        np.testing.assert_allclose(cells, cells.round(), atol=1e-9)
        taken = {tuple(cell) for cell in cells.round().astype(int).tolist()}
        assert len(taken) == count + 2
        assert all(0 <= i < 8 and 0 <= j < 8 and 0 <= level < LEVELS for i, j, level in taken)
        assert all(level == 0 or (i, j, level - 1) in taken for i, j, level in taken)
        assert not any((i, j, level + 1) in taken for i, j, level in cells[count:].round().astype(int).tolist())


def test_boards_are_drawn_both_flat_and_stacked():
    highest = [cells_of(GRID.draw(np.random.default_rng(seed), 16, 1, LEVELS))[:16, 2].max() for seed in range(40)]
    assert min(highest) < 1.5
    assert max(highest) > 3.5


def test_more_objects_than_places_are_refused():
    GRID.draw(np.random.default_rng(0), 64 * LEVELS - LEVELS, targets=1, levels=LEVELS)
    with pytest.raises(
        ConfigError, match=r"task.num_objects=512 objects in stacks of task.levels=8 and 1 targets do not"
    ):
        GRID.draw(np.random.default_rng(0), 64 * LEVELS, targets=1, levels=LEVELS)


def test_above_holds_for_objects_over_others_in_the_same_stack():
    places = np.array([GRID.place(*cell) for cell in ((0, 0, 0), (0, 0, 1), (0, 0, 3), (1, 0, 1))])
    expected = np.zeros((4, 4), bool)
    expected[0, [1, 2]] = expected[1, 2] = True
    np.testing.assert_array_equal(above(places, GRID.size), expected)


def test_the_nearest_cells_of_places_are_found_and_lie_on_the_grid():
    cells = [(0, 0, 0), (7, 3, 5), (2, 6, 1)]
    places = np.array([GRID.place(*cell) for cell in cells])
    np.testing.assert_array_equal(GRID.cells(places + [0.01, -0.01, 0.005]), cells)
    np.testing.assert_array_equal(GRID.cells(np.array([[0.0, 9.0, -1.0]])), [(0, 7, 0)])

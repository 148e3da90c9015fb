from itertools import combinations

import numpy as np
import pytest

from language import COLORS, LanguageError, color_name, color_table, draw_colors, rgba


@pytest.mark.parametrize("name", COLORS)
def test_a_colour_is_found_by_its_name_and_named_by_its_rgba(name):
    assert color_name(rgba(name)) == name


def test_a_colour_read_from_a_float32_observation_is_still_exact():
    assert [color_name(row) for row in color_table()] == list(COLORS)


def test_colours_are_opaque_and_well_apart():
    for one, other in combinations(color_table(), 2):
        assert one[3] == other[3] == 1
        assert np.linalg.norm(one - other) >= 0.5


def test_an_unnamed_colour_is_an_error_and_not_its_neighbour():
    with pytest.raises(LanguageError, match="no name"):
        color_name((0.99, 0.0, 0.0, 1.0))


def test_a_misspelt_colour_gets_a_suggestion():
    with pytest.raises(LanguageError, match="did you mean 'green'"):
        rgba("gren")


def test_drawing_without_replacement_gives_each_colour_once():
    rng = np.random.default_rng(0)
    assert sorted(draw_colors(rng, len(COLORS), replace=False)) == sorted(COLORS)


def test_excluded_colours_are_not_drawn():
    drawn = draw_colors(np.random.default_rng(0), 200, excluding=("red", "blue"))
    assert set(drawn) == set(COLORS) - {"red", "blue"}


@pytest.mark.parametrize(
    "wanted",
    [
        {"n": len(COLORS) + 1, "replace": False},
        {"n": 1, "excluding": tuple(COLORS)},
        {"n": 1, "excluding": ("redd",)},
    ],
)
def test_drawing_what_is_not_there_is_an_error(wanted):
    with pytest.raises(LanguageError):
        draw_colors(np.random.default_rng(0), **wanted)

"""Named colours and their RGBA values."""

from itertools import combinations

import numpy as np
import pytest

from language import (
    COLORS,
    SEE_THROUGH,
    Color,
    LanguageError,
    color_name,
    color_table,
    draw_colors,
    parse,
    rgba,
)


@pytest.mark.parametrize("see_through", [False, True])
@pytest.mark.parametrize("name", COLORS)
def test_names_and_rgba_values_convert_both_ways(name, see_through):
    assert color_name(rgba(name, see_through)) == name
    assert rgba(name, see_through)[3] == (SEE_THROUGH if see_through else 1)


@pytest.mark.parametrize("see_through", [False, True])
def test_a_colour_in_a_float32_observation_is_exact(see_through):
    table = color_table(see_through)
    assert table.dtype == np.float32
    assert [color_name(row) for row in table] == list(COLORS)


def test_colours_differ_clearly():
    for one, other in combinations(color_table(), 2):
        assert np.linalg.norm(one - other) >= 0.5


@pytest.mark.parametrize("unnamed", [(0.99, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.75)])
def test_an_unnamed_colour_raises_unless_the_nearest_name_is_requested(unnamed):
    with pytest.raises(LanguageError, match="no name; the named colors are red, green"):
        color_name(unnamed)
    assert color_name(unnamed, nearest=True) == "red"


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("broken", [(1.0, 0.0, 0.0), (1.0, 0.0, 0.0, float("nan")), ()])
def test_an_invalid_rgba_raises(broken, nearest):
    with pytest.raises(LanguageError, match="four finite numbers"):
        color_name(broken, nearest)


def test_a_misspelt_colour_raises_with_a_suggestion():
    with pytest.raises(LanguageError, match="did you mean 'green'"):
        rgba("gren")


def test_drawing_without_replacement_returns_each_colour_once():
    rng = np.random.default_rng(0)
    assert sorted(draw_colors(rng, len(COLORS), replace=False)) == sorted(COLORS)


def test_excluded_colours_are_not_drawn():
    drawn = draw_colors(np.random.default_rng(0), 200, excluding=("red", "blue"))
    assert set(drawn) == set(COLORS) - {"red", "blue"}


def test_drawing_zero_colours_returns_none():
    assert draw_colors(np.random.default_rng(0), 0, excluding=tuple(COLORS)) == ()


@pytest.mark.parametrize(
    "wanted",
    [
        {"n": len(COLORS) + 1, "replace": False},
        {"n": 1, "excluding": tuple(COLORS)},
        {"n": 1, "excluding": ("redd",)},
    ],
)
def test_drawing_more_colours_than_exist_raises(wanted):
    with pytest.raises(LanguageError):
        draw_colors(np.random.default_rng(0), **wanted)


@pytest.mark.parametrize(("word", "name"), [("grey", "gray"), ("gray", "gray"), ("violet", "purple")])
def test_synonyms_of_colours_are_parsed(word, name):
    assert parse(f"reach the {word} ball").phrase.color == name


@pytest.mark.slow
def test_a_new_colour_needs_one_entry(monkeypatch):
    monkeypatch.setitem(COLORS, "brown", Color((0.5, 0.25, 0.0), ("chestnut",)))
    assert color_name(rgba("brown", see_through=True)) == "brown"
    assert parse("reach the chestnut cube").phrase.color == "brown"
    assert "brown" in draw_colors(np.random.default_rng(0), len(COLORS), replace=False)

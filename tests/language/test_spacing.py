import math

import numpy as np
import pytest

from language.spacing import keep_apart, scatter

ROW = [(0.0, 0.0), (0.1, 0.0), (0.25, 0.0), (0.3, 0.0), (0.5, 0.0)]


def test_the_first_candidates_that_are_apart_are_kept():
    assert keep_apart(ROW, 3, 0.2) == [(0.0, 0.0), (0.25, 0.0), (0.5, 0.0)]
    assert keep_apart(ROW, 2, 0.2) == [(0.0, 0.0), (0.25, 0.0)]
    assert keep_apart(ROW, 9, 0.2) == [(0.0, 0.0), (0.25, 0.0), (0.5, 0.0)]


def test_candidates_keep_their_distance_from_other_places():
    assert keep_apart(ROW, 9, 0.2, others=[(0.1, 0.0, 7.0)]) == [(0.3, 0.0), (0.5, 0.0)]


def test_a_distance_equal_to_the_spacing_is_enough():
    assert keep_apart([(0.1, 0.0), (0.1 + 0.2, 0.0)], 2, 0.2) == [(0.1, 0.0), (0.1 + 0.2, 0.0)]


@pytest.mark.parametrize("count", [1, 6])
def test_scattered_places_are_in_the_area_and_apart(count):
    places = scatter(np.random.default_rng(0), count, (0.3, 0.7, -0.3, 0.3), 0.12)
    assert len(places) == count
    assert all(0.3 <= x <= 0.7 and -0.3 <= y <= 0.3 for x, y in places)
    assert all(math.dist(a, b) >= 0.12 for i, a in enumerate(places) for b in places[:i])


def test_no_places_are_returned_where_they_do_not_fit():
    assert scatter(np.random.default_rng(0), 3, (0.0, 0.1, 0.0, 0.1), 0.5) == []

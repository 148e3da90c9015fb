"""Layouts drawn from specifications of objects, and subtasks among them."""

import re

import numpy as np
import pytest

from language import COLORS, SHAPES, LanguageError
from language.placement import ObjectSpec, from_all, from_lists, from_pairs

LEFT, RIGHT = (0.3, 0.5, 0.1, 0.3, 0.025, 0.025), (0.3, 0.5, -0.3, -0.1, 0.025, 0.2)
TABLE = (0.2, 0.8, -0.5, 0.5, 0.025, 0.025)
RED = ObjectSpec("cube", "red", LEFT)
BALL = ObjectSpec("sphere", None, RIGHT, fixed=True, random_rotation=True)
PLACE = ObjectSpec(None, None, TABLE, size=0.08, role="target")


def draws(layout, number=200, spacing=0.1, seed=0):
    rng = np.random.default_rng(seed)
    return [layout.draw(rng, spacing) for _ in range(number)]


def test_objects_follow_their_specifications_and_areas():
    for placed in draws(from_all([RED, BALL, PLACE])):
        cube, ball, place = placed.scene
        assert (cube.noun, cube.color, ball.noun) == ("cube", "red", "sphere")
        assert (cube.role, ball.role, place.role) == ("real", "real", "target")
        assert (cube.size, place.size) == (0.05, 0.08)
        assert placed.fixed.tolist() == [False, True, False]
        for thing, spec in zip(placed.scene, (RED, BALL, PLACE), strict=True):
            low, high = np.reshape(spec.area, (3, 2)).T
            assert (low <= thing.position).all()
            assert (thing.position <= high).all()


def test_places_fill_the_areas_and_unspecified_words_take_every_value():
    drawn = draws(from_all([BALL, PLACE]), 600)
    heights = np.array([placed.scene.positions[0, 2] for placed in drawn])
    assert heights.min() < 0.03 < 0.19 < heights.max()
    assert {int(placed.scene.nouns[1]) for placed in drawn} == set(range(len(SHAPES)))
    assert {int(placed.scene.colors[1]) for placed in drawn} == set(range(len(COLORS)))


def test_yaw_is_random_only_on_request():
    yaw = np.array([placed.yaw for placed in draws(from_all([RED, BALL]), 600)])
    assert not yaw[:, 0].any()
    assert yaw[:, 1].min() >= -np.pi
    assert yaw[:, 1].max() < np.pi
    assert np.histogram(yaw[:, 1], bins=4, range=(-np.pi, np.pi))[0].min() > 100


def test_all_centres_including_targets_keep_the_spacing():
    specs = [ObjectSpec(None, None, TABLE, role=role) for role in ("real", "target") * 4]
    for placed in draws(from_all(specs), 50, spacing=0.15):
        ground = placed.scene.positions[:, :2]
        apart = np.linalg.norm(ground[:, None] - ground, axis=2) + 9 * np.eye(8)
        assert apart.min() >= 0.15 - 1e-9


def test_places_at_exactly_the_spacing_are_accepted():
    specs = [ObjectSpec("cube", None, (x, x, 0, 0, 0, 0)) for x in (0.35, 0.47, 0.59)]
    (placed,) = draws(from_all(specs), 1, spacing=0.12)
    assert placed.scene.positions[:, 0].tolist() == [0.35, 0.47, 0.59]


def test_drawn_colors_differ_within_a_role_while_colors_are_left():
    every = len(COLORS)
    given = ["red", None, "green"] + [None] * (every - 3)
    specs = [ObjectSpec(None, color, TABLE) for color in given]
    specs += [ObjectSpec(None, None, TABLE, role="target") for _ in range(every + 2)]
    for placed in draws(from_all(specs), 50, spacing=0.0):
        assert sorted(placed.scene.colors[:every].tolist()) == list(range(every))
        assert set(placed.scene.colors[every:].tolist()) == set(range(every))


def test_the_same_seed_draws_the_same_layout():
    first, again, other = (draws(from_all([RED, BALL, PLACE]), 5, seed=seed) for seed in (1, 1, 2))
    assert [tuple(placed.scene) for placed in first] == [tuple(placed.scene) for placed in again]
    assert [placed.yaw.tolist() for placed in first] == [placed.yaw.tolist() for placed in again]
    assert [tuple(placed.scene) for placed in first] != [tuple(placed.scene) for placed in other]


# ---- subtasks -----------------------------------------------------------------------------------------------------


def picks(layout):
    rng = np.random.default_rng(0)
    return {layout.pick(rng) for _ in range(200)}


def test_a_pair_keeps_its_goal():
    layout = from_pairs([(RED, PLACE), (BALL, None), (RED, BALL)])
    assert layout.specs == (RED, PLACE, BALL, RED, BALL)
    assert picks(layout) == {(0, 1), (2, None), (3, 4)}


def test_from_lists_combines_any_init_with_any_goal():
    assert picks(from_lists([RED, BALL], [PLACE, RED, PLACE])) == {(i, j) for i in (0, 1) for j in (2, 3, 4)}
    assert picks(from_lists([RED], [])) == {(0, None)}
    assert picks(from_lists([], [PLACE])) == {(None, 0)}


def test_from_all_combines_real_objects_with_targets():
    assert picks(from_all([PLACE, RED, BALL, PLACE])) == {(1, 0), (1, 3), (2, 0), (2, 3)}
    assert picks(from_all([RED, BALL])) == {(0, None), (1, None)}


# ---- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"noun": "cub"}, "noun=cub: 'cub' is not a known noun; did you mean 'cube'?"),
        ({"color": "gren"}, "color=gren: 'gren' is not a known color; did you mean 'green'?"),
        ({"role": "goal"}, "role=goal: 'goal' is not a known role; choose from real, target"),
        ({"role": None}, "role=None: "),
        ({"area": (0.1, 0.2)}, "area=(0.1, 0.2) must be 6 finite numbers: x0, x1, y0, y1, z0, z1"),
        ({"area": (0, 1, 0, 1, 0, float("nan"))}, "must be 6 finite numbers"),
        ({"area": "table"}, "area=table must be 6 finite numbers"),
        ({"area": None}, "area=None must be 6 finite numbers"),
        ({"area": (0.4, 0.3, 0, 1, 0, 1)}, "x0=0.4 must be at most x1=0.3"),
        ({"area": (0, 1, 0, 1, 0.2, 0.1)}, "z0=0.2 must be at most z1=0.1"),
        ({"size": 0.0}, "size=0.0 must be a positive number of metres"),
    ],
)
def test_an_invalid_specification_is_refused_with_its_key(wrong, message):
    with pytest.raises(LanguageError, match=re.escape(message)):
        ObjectSpec(**{"noun": "cube", "color": "red", "area": LEFT, **wrong})


def test_a_target_cannot_be_an_init():
    for make in (lambda: from_lists([RED, PLACE], []), lambda: from_pairs([(RED, None), (PLACE, RED)])):
        with pytest.raises(LanguageError, match="object 1 is an init with role=target: it must be real"):
            make()


@pytest.mark.parametrize("make", [lambda: from_pairs([]), lambda: from_lists([], []), lambda: from_all([])])
def test_an_empty_layout_is_refused(make):
    with pytest.raises(LanguageError, match="at least one object"):
        make()


def test_a_layout_without_room_is_refused_with_the_object():
    tight = ObjectSpec("cube", None, (0.4, 0.45, 0, 0.05, 0, 0))
    with pytest.raises(LanguageError, match=r"object 1 found no place in its area=\[0.4, 0.45.*spacing=0.2 metres"):
        from_all([tight, tight]).draw(np.random.default_rng(0), 0.2)

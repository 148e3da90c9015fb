"""Objects that phrases fit in a scene."""

import pytest

from language import ObjectPhrase, Scene, SeveralFit, ground, matches, parse
from tests.helpers.language_cases import PLACES, TABLE, scene, steps

ACROSS = Scene(TABLE, viewpoint="human")


def fitting(words, table=TABLE, pointed=()):
    return matches(parse(f"reach {words}").phrase, table, pointed).nonzero()[0].tolist()


@pytest.mark.parametrize(
    ("words", "index"),
    [
        ("the red object", 0),
        ("the sphere", 2),
        ("the blue cube", 1),
        ("the object left of the sphere", 3),
        ("the cube right of the blue cube", 0),
        ("the cube left of the sphere left of the blue cube", 3),
        ("the cube behind the sphere below the yellow cylinder", 3),
        ("the sphere right of the cube behind the ball left of the red cube", 2),
        ("the leftmost cube right of the sphere", 1),
        ("the big cube", 3),
        ("the little one", 1),
    ],
)
def test_phrases_ground_to_the_expected_object(words, index):
    assert ground(parse(f"reach {words}"), TABLE) == index


@pytest.mark.parametrize(
    ("words", "indices"),
    [
        ("left of the sphere", [3]),
        ("right of the sphere", [0, 1]),
        ("in front of the green cube", [0, 1, 2, 4]),
        ("behind the sphere", [3]),
        ("above the sphere", [4]),
        ("below the cylinder", [2]),
        ("near the sphere", [1, 4]),
        ("nearest to the red cube", [1]),
        ("farthest from the red cube", [3]),
        ("between the red cube and the sphere", [1]),
        ("between the sphere and the red cube", [1]),
    ],
)
def test_each_relation_matches_the_expected_objects(words, indices):
    assert fitting(f"the object {words}") == indices


@pytest.mark.parametrize(
    ("superlative", "indices"),
    [
        ("leftmost", [3]),
        ("rightmost", [0]),
        ("nearest", [1]),
        ("farthest", [3]),
        ("highest", [4]),
        ("lowest", [0]),
        ("largest", [3]),
        ("smallest", [1]),
    ],
)
def test_each_superlative_matches_the_expected_objects(superlative, indices):
    assert fitting(f"the {superlative} object") == indices


@pytest.mark.parametrize(
    ("words", "robot", "human"),
    [
        ("the object left of the sphere", [3], [0, 1]),
        ("the object right of the sphere", [0, 1], [3]),
        ("the object in front of the sphere", [], [3]),
        ("the object behind the green cube", [], [0, 1, 2, 4]),
        ("the leftmost cube", [3], [0]),
        ("the nearest cube", [1], [3]),
        ("the object above the sphere", [4], [4]),
    ],
)
def test_relations_depend_on_the_viewpoint(words, robot, human):
    assert fitting(words) == robot
    assert fitting(words, ACROSS) == human


@pytest.mark.parametrize(("gap", "holds"), [(0.02, False), (0.04, True), (-0.04, False)])
def test_a_relation_holds_above_a_margin_of_three_centimetres(gap, holds):
    phrase = ObjectPhrase("cube", None, "left of", (ObjectPhrase("sphere"),))
    assert matches(phrase, scene(("red cube", gap), ("red sphere", 0.0)))[0] == holds


def test_a_superlative_selects_among_the_objects_that_the_rest_fits():
    assert fitting("the leftmost cube in front of the green cube") == [1]
    assert fitting("the highest cube that is not green") == [1]


def test_a_superlative_matches_ties():
    assert fitting("the leftmost cube", scene(("red cube", 0.1), ("blue cube", 0.105), ("green cube", 0.0))) == [0, 1]


def test_between_requires_two_different_anchors():
    assert fitting("the object between the red cube and the red cube") == []


@pytest.mark.parametrize(
    ("words", "indices"),
    [
        ("the object that is not blue", [0, 3, 4]),
        ("the object that isn't a cube", [2, 4]),
        ("the cube that is not red", [1, 3]),
        ("the blue one which is not a box", [2]),
        ("the object that is not a blue cube", [0, 2, 3, 4]),
        ("the cube that is not small", [0, 3]),
        ("the object that is not a large cube", [0, 1, 2, 4]),
        ("the cube that is not red right of the sphere", [1]),
    ],
)
def test_a_negation_excludes_objects(words, indices):
    assert fitting(words) == indices


@pytest.mark.parametrize(
    ("words", "indices"),
    [
        ("the red cube", [0, 3]),
        ("the transparent red cube", [3]),
        ("the solid red one", [0]),
        ("the opaque cube", [0, 1]),
    ],
)
def test_roles_distinguish_targets_from_real_objects(words, indices):
    assert fitting(words, PLACES) == indices


@pytest.mark.parametrize("words", ["this", "that", "this cube", "that blue one", "here", "there", "over there"])
def test_a_gesture_resolves_an_ambiguous_phrase(words):
    assert fitting(words, pointed=[1]) == [1]


def test_gestures_are_matched_to_words_in_order_and_the_last_is_reused():
    assert steps("push this there", PLACES, [1, 3]) == [("push", 1, 3)]
    assert steps("reach this, then reach that, then reach this", TABLE, [4, 2]) == [
        ("reach", None, 4),
        ("reach", None, 2),
        ("reach", None, 2),
    ]


def test_a_gesture_may_show_the_anchor_of_a_relation():
    assert fitting("the cube left of this", pointed=[2]) == [3]
    assert fitting("the object between this and that sphere", pointed=[0, 2]) == [1]


@pytest.mark.parametrize("words", ["this sphere", "that red one"])
def test_a_gesture_does_not_override_the_words(words):
    assert fitting(words, pointed=[1]) == []


def test_a_moved_object_must_be_real():
    assert steps("push the red cube to the transparent red cube", PLACES) == [("push", 0, 3)]
    with pytest.raises(SeveralFit):
        parse("reach the red cube", PLACES)

"""Colloquial phrasings."""

import pytest

from language import NotUnderstood, Object, Scene, parse, say

TABLE = Scene(
    [
        Object("cube", "red", (0.4, 0.1, 0.0)),
        Object("cube", "blue", (0.4, -0.1, 0.0)),
        Object("sphere", "blue", (0.5, 0.0, 0.0)),
        Object("cube", "green", (0.5, 0.2, 0.0), role="target"),
        Object("cube", "pink", (0.5, -0.2, 0.0), role="target"),
    ]
)


@pytest.mark.parametrize(
    ("sentence", "means"),
    [
        ("grab the cube, lift it, and push it to the ball", "grasp the cube, then lift it, then push it to the sphere"),
        ("first reach the cube, then lift it", "reach the cube, then lift it"),
        ("Reach the cube. Then lift it.", "reach the cube, then lift it"),
        ("after you lift it and reach it, go to the cube, thanks.", "lift it, then reach it, then reach the cube"),
        ("reach the leftmost", "reach the leftmost object"),
        ("reach the left one near the cube", "reach the leftmost object near the cube"),
        ("reach the cube on the left", "reach the leftmost cube"),
        ("reach the cube on the left of the ball", "reach the cube left of the sphere"),
        ("take the cube and put it there", "pick the cube and place it there"),
        ("take the cube and reach there", "grasp the cube, then reach there"),
        ("pick the cube", "lift the cube"),
        ("not the leftmost, the one on the right", "not the leftmost object, the rightmost object"),
        ("reach the cube that isn't transparent", "reach the cube that is not transparent"),
        ("reach the cube that is not a big one", "reach the cube that is not large"),
    ],
)
def test_colloquial_sentences_are_understood(sentence, means):
    assert parse(sentence) == parse(means)
    assert parse(say(parse(sentence))) == parse(sentence)


def test_two_superlatives_in_one_phrase_are_refused():
    with pytest.raises(ValueError, match="say one of them"):
        parse("reach the leftmost cube on the right")


@pytest.mark.parametrize(
    ("correction", "pointed", "init", "goal"),
    [
        ("no, the blue cube", [], 1, 3),
        ("no, there", [4], 0, 4),
        ("no, this one", [2], 2, 3),
        ("not that one, this one", [0, 1], 1, 3),
        ("no, to the transparent pink cube", [], 0, 4),
    ],
)
def test_a_correction_keeps_the_other_gestures(correction, pointed, init, goal):
    before = parse("push this there", TABLE, pointed=[0, 3])
    step = parse(correction, TABLE, pointed, previous=before).steps[0]
    assert (step.init, step.goal) == (init, goal)
    again = parse("no, the sphere", TABLE, previous=parse(correction, TABLE, pointed, previous=before)).steps[0]
    assert (again.init, again.goal) == (2, goal)


@pytest.mark.parametrize(
    ("sentence", "position", "message"),
    [
        ("reach every red cube", 6, "only the object of 'sort'"),
        ("sort the red cube to every cube", 21, "Expected here: the"),
        ("sort every red cube left of every cube to this", 28, "Expected here: the"),
        ("no, every red cube", 4, "is not understood"),
    ],
)
def test_every_is_understood_only_as_what_is_sorted(sentence, position, message):
    with pytest.raises(NotUnderstood, match=message) as caught:
        parse(sentence)
    assert caught.value.position == position

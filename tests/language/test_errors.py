"""The three errors: kind, position, and suggestions."""

import re

import numpy as np
import pytest

from language import NothingFits, NotUnderstood, Object, Scene, SeveralFit, ground, parse
from tests.helpers.language_cases import PLACES, TABLE, answer, random_scenes, scene


@pytest.mark.parametrize(
    ("sentence", "position", "expects", "hint"),
    [
        ("reach the rred cube", 10, "red", "did you mean 'red'"),
        ("reach the red cube left off the ball", 19, "left of", "did you mean 'left of'"),
        ("reach the red cube letf of the ball", 19, "left of", "did you mean 'left of'"),
        ("reach the cube inn front of the ball", 15, "in front of", "did you mean 'in front of'"),
        ("Rech the red cube", 0, "reach", "did you mean 'reach'"),
        ("reach the red", 13, "cube", "ends too early"),
        ("reach red cube", 6, "the", "Expected here: the"),
        ("reach the cube cube", 15, "left of", "the end of the sentence"),
        ("reach   the\tmauve cube", 12, "red", "'mauve' is not understood at character 13"),
        ("push the cube", 13, "to", "Expected here: to, at, here, .* to the same position as"),
        ("reach the cube, then the ball", 21, "reach", "Expected here: reach"),
        ("reach the object that is not an object", 17, None, "everything is an object"),
        ("", 0, "reach", "ends too early"),
    ],
)
def test_not_understood_has_position_expected_phrases_and_a_hint(sentence, position, expects, hint):
    with pytest.raises(NotUnderstood, match=hint) as caught:
        parse(sentence)
    assert caught.value.position == position
    assert expects is None or expects in caught.value.expected


def test_an_overlong_sentence_is_refused():
    with pytest.raises(NotUnderstood, match="at most 1000"):
        parse("reach the " + "red " * 1_000_000 + "cube")


@pytest.mark.parametrize(
    ("sentence", "part", "position"),
    [
        ("reach the purple cube", "purple object", 6),
        ("please reach the red cylinder", "red cylinder", 13),
        ("reach the cube left of the red sphere", "red sphere", 23),
        ("reach the cube left of the green cube", "cube left of the green cube", 6),
        ("reach the small sphere", "small sphere", 6),
        ("reach the transparent cube", "transparent cube", 6),
        ("reach the cylinder that is not yellow", "cylinder that is not yellow", 6),
        ("reach the ball, then touch the pink one", "pink object", 27),
    ],
)
def test_nothing_fits_has_the_failing_part_and_lists_the_scene(sentence, part, position):
    with pytest.raises(NothingFits, match=f"there is no {part}.*; there is a red cube, a blue cube") as caught:
        parse(sentence, TABLE)
    assert caught.value.part == part
    assert caught.value.position == position


def test_nothing_fits_suggests_similar_objects():
    with pytest.raises(NothingFits, match=r"no red sphere \(did you mean the red cube or the blue sphere\?\)"):
        parse("reach the red sphere", TABLE)


def test_nothing_fits_in_an_empty_scene():
    with pytest.raises(NothingFits, match="nothing at all"):
        ground(parse("reach the object"), scene())


@pytest.mark.parametrize(
    ("sentence", "message", "position"),
    [
        ("reach it", "no object was named before", 6),
        ("reach this", "needs a gesture", 6),
        ("lift the green cube and push it there", "'there' needs a gesture", 32),
        ("push the green cube to the green cube", "is the object that is to be moved", 23),
        ("push the transparent red cube to the ball", "no transparent red cube that can be moved", 5),
        ("reach the transparent red cube and lift it", "the transparent red cube, which only marks a place", 40),
        ("no, the blue one", "no previous instruction to correct", 0),
    ],
)
def test_missing_context_is_reported_with_its_reason(sentence, message, position):
    with pytest.raises(NothingFits, match=message) as caught:
        parse(sentence, PLACES)
    assert caught.value.position == position


def test_a_contradicting_gesture_is_reported_with_its_object():
    with pytest.raises(NothingFits, match="nothing fits 'this cube': the gesture shows the blue sphere"):
        parse("reach this cube", TABLE, pointed=[2])


@pytest.mark.parametrize("pointed", [[99], [-1]])
def test_a_gesture_at_an_unknown_index_is_refused(pointed):
    with pytest.raises(ValueError, match="out of range: the scene has 5 objects"):
        parse("reach this", TABLE, pointed=pointed)


@pytest.mark.parametrize(
    ("sentence", "candidates", "position"),
    [
        ("reach the blue object", (1, 2), 6),
        ("reach the cube right of the sphere", (0, 1), 6),
        ("reach the red cube right of the blue one", (1, 2), 28),
        ("reach the object", (0, 1, 2, 3, 4), 6),
        ("reach the sphere and touch the cube", (0, 1, 3), 27),
    ],
)
def test_several_fit_lists_all_candidates(sentence, candidates, position):
    with pytest.raises(SeveralFit, match=f"any of {len(candidates)}. Do you mean") as caught:
        parse(sentence, TABLE)
    assert caught.value.candidates == candidates
    assert caught.value.position == position


def test_the_question_names_each_candidate_in_parsable_words():
    with pytest.raises(SeveralFit) as caught:
        parse("reach the blue object", TABLE)
    assert caught.value.question == "Do you mean the blue cube or the blue sphere?"
    asked = 0
    for each in random_scenes(60):
        error = answer("reach the object", each)
        for name, index in zip(names(error), error.candidates, strict=True):
            if " at (" not in name:
                asked += 1
                assert ground(parse(f"reach {name}"), each) == index
    assert asked > 200


def names(error):
    return error.question.removeprefix("Do you mean ").removesuffix("?").split(" or ")


def test_indistinguishable_candidates_are_named_with_their_positions():
    table = scene(("red cube", 0.0), ("red cube", 0.02))
    with pytest.raises(
        SeveralFit, match=re.escape("the red cube at (0.40, 0.00, 0.00) or the red cube at (0.40, 0.02")
    ):
        parse("reach the cube", table)


@pytest.mark.parametrize("sentence", ["reach the cube", "reach the sphere", "reach the leftmost cube"])
def test_messages_about_large_scenes_are_short(sentence):
    crowd = Scene.from_arrays(np.zeros(60), np.zeros(60), np.linspace([0.3, -0.3, 0], [0.3, 0.3, 0], 60))
    assert len(str(answer(sentence, crowd))) < 1000


def test_long_phrases_are_truncated_in_messages():
    table = Scene([*TABLE, Object("cylinder", "gray", (0.4, 0.0, 0.1))])
    nest = "the gray one by the sphere by " * 30 + "the gray one"
    for words, kind in (("the pink one", NothingFits), ("the red one", NothingFits), ("the object", SeveralFit)):
        error = answer(f"reach {words} left of {nest}", table)
        assert isinstance(error, kind)
        assert len(str(error)) < 1000


@pytest.mark.parametrize(
    "sentence", ["reach the cube left of the red cube, it", "push this there", "no, this one", "lift it"]
)
def test_an_ambiguous_sentence_raises_instead_of_guessing(sentence):
    assert not hasattr(answer(sentence, TABLE), "steps")

import pytest
from language_cases import scene

from language import NothingFits, ObjectPhrase, SeveralFit, ground, matches, parse

# From the robot's right to its left, as y grows to the left.
TABLE = scene(("red cube", -0.2), ("blue cube", -0.1), ("blue sphere", 0.1), ("green cube", 0.2))


@pytest.mark.parametrize(
    ("sentence", "index"),
    [
        ("reach the red object", 0),
        ("reach the sphere", 2),
        ("reach the blue cube", 1),
        ("reach the object left of the sphere", 3),
        ("reach the cube right of the blue cube", 0),
        ("reach the cube left of the sphere left of the blue cube", 3),
    ],
)
def test_the_words_find_their_object(sentence, index):
    assert ground(parse(sentence), TABLE) == index


def test_the_robots_left_is_greater_y():
    assert matches(parse("reach the object left of the blue cube").phrase, TABLE).tolist() == [0, 0, 1, 1]
    assert matches(parse("reach the object right of the blue cube").phrase, TABLE).tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize(("gap", "holds"), [(0.02, False), (0.04, True), (-0.04, False)])
def test_a_relation_holds_beyond_three_centimetres(gap, holds):
    phrase = ObjectPhrase("cube", None, "left of", ObjectPhrase("sphere"))
    assert matches(phrase, scene(("red cube", gap), ("red sphere", 0.0)))[0] == holds


@pytest.mark.parametrize(
    ("sentence", "part"),
    [
        ("reach the yellow cube", "yellow object"),
        ("reach the green cylinder", "cylinder"),
        ("reach the red sphere", "red sphere"),
        ("reach the cube left of the red sphere", "red sphere"),
        ("reach the cube left of the green cube", "cube left of the green cube"),
    ],
)
def test_what_nothing_fits_is_told_by_its_failing_part(sentence, part):
    with pytest.raises(NothingFits, match=f"there is no {part}; there is a red cube, a blue cube") as caught:
        ground(parse(sentence), TABLE)
    assert caught.value.part == part


def test_nothing_fits_an_empty_table():
    with pytest.raises(NothingFits, match="nothing at all"):
        ground(parse("reach the object"), scene())


@pytest.mark.parametrize(
    ("sentence", "candidates"),
    [
        ("reach the blue object", (1, 2)),
        ("reach the cube right of the sphere", (0, 1)),
        ("reach the red cube right of the blue one", (1, 2)),
    ],
)
def test_what_several_fit_is_told_with_all_of_them(sentence, candidates):
    with pytest.raises(SeveralFit, match=f"any of {len(candidates)}: .*blue cube at ") as caught:
        ground(parse(sentence), TABLE)
    assert caught.value.candidates == candidates

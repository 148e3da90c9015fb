"""Chains of steps, and corrections of previous instructions."""

import pytest

from language import Chain, NothingFits, Object, Scene, SeveralFit, parse, revise, say
from tests.helpers.language_cases import PLACES, TABLE, answer, steps

LIFT_AND_TOUCH = [("lift", 1, None), ("reach", None, 2)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "sentence",
    [
        "lift the green cube, then touch the ball",
        "lift the green cube then touch the ball",
        "lift the green cube and touch the ball",
        "lift the green cube, and then touch the ball",
        "lift the green cube; after that touch the ball",
        "after you lift the green cube, touch the ball",
        "Once you lift the green cube, touch the ball, please.",
        "pick up the green cube and reach for the ball",
    ],
)
def test_steps_may_be_joined_in_several_ways(sentence):
    sentence = sentence.replace("the ball", "the blue ball")
    assert steps(sentence, PLACES) == LIFT_AND_TOUCH
    assert isinstance(parse(sentence), Chain)


def test_long_chains_are_parsed():
    sentence = "touch the ball, then grab the green cube and lift it, then push it to the transparent sphere"
    assert steps(sentence.replace("the ball", "the blue ball"), PLACES) == [
        ("reach", None, 2),
        ("grasp", None, 1),
        ("lift", 1, None),
        ("push", 1, 4),
    ]


def test_after_you_puts_its_step_first():
    nested = parse("after you touch the ball, lift the cube and push it there")
    assert [step.task for step in nested.steps] == ["reach", "lift", "push"]
    assert say(nested) == "reach the sphere, then lift the cube, then push it there"


def test_it_refers_to_the_object_of_the_previous_step():
    assert steps("touch the green cube, then lift it", PLACES) == [("reach", None, 1), ("lift", 1, None)]
    assert steps("touch the yellow one, then lift the object below it", TABLE) == [
        ("reach", None, 4),
        ("lift", 2, None),
    ]


def test_it_refers_to_what_was_spoken_of_before_and_to_the_fitting_where_it_is_opened_or_closed():
    things = [Object("cube", "red", (0.5, 0.0, 0.02)), Object("drawer", "blue", (0.4, -0.3, 0.08))]
    scene = Scene(things)
    assert steps("put the red cube in the drawer and close it", scene) == [("put_in", 0, 1), ("close", None, 1)]
    assert steps("open the drawer, put the cube in it and close it", scene) == [
        ("open", None, 1),
        ("put_in", 0, 1),
        ("close", None, 1),
    ]
    with pytest.raises(NothingFits, match="'it' refers to nothing"):
        parse("open it", scene)
    spoken = [
        parse(sentence, scene, spoken=(0, 1)).steps[0].objects for sentence in ("open it", "put it in the drawer")
    ]
    assert spoken == [(1,), (0, 1)]


def test_a_step_is_grounded_in_the_scene_after_the_previous_step():
    sentence = "push the solid red cube to the transparent sphere, then lift the leftmost cube"
    assert steps(sentence, PLACES) == [("push", 0, 4), ("lift", 0, None)]
    result = parse(sentence, PLACES).result
    assert result.positions[0][:2].tolist() == [0.6, 0.1]
    assert result.positions[0][2] > PLACES.positions[0][2]


@pytest.mark.parametrize(
    ("before", "correction", "after"),
    [
        ("reach the red cube", "no, the blue one", "reach the blue cube"),
        ("reach the red cube", "No, I meant the blue one!", "reach the blue cube"),
        ("reach the red cube", "sorry, the ball", "reach the sphere"),
        ("reach the blue cube", "not the cube, the sphere", "reach the sphere"),
        ("reach the blue cube", "not the cube but the ball", "reach the sphere"),
        ("reach the red cube", "not the red one, i meant the blue one", "reach the blue cube"),
        ("reach the rightmost cube", "I meant the left one", "reach the leftmost cube"),
        ("reach the cube left of the ball", "no, the one right of the blue cube", "reach the red cube"),
        ("reach the small cube", "actually, the large one", "reach the large cube"),
        ("lift the red cube", "no, grab the ball", "grasp the sphere"),
        ("reach the ball, then lift the red cube", "no, the blue one", "reach the sphere, then lift the blue cube"),
        (
            "reach the ball, then lift the red cube",
            "not the ball, the tin",
            "reach the cylinder, then lift the red cube",
        ),
    ],
)
def test_a_correction_revises_the_previous_instruction(before, correction, after):
    got = parse(correction, TABLE, previous=parse(before))
    assert got.steps == parse(after, TABLE).steps


@pytest.mark.parametrize(
    ("before", "correction", "after"),
    [
        ("push the green cube to the transparent cube", "no, to the transparent sphere", ("push", 1, 4)),
        ("push the green cube to the transparent cube", "no, there", ("push", 1, 4)),
        (
            "push the green cube to the transparent cube",
            "not the transparent cube, the transparent ball",
            ("push", 1, 4),
        ),
        ("push the green cube to the transparent cube", "no, the blue ball", ("push", 2, 3)),
        ("reach the green cube", "no, there", ("reach", None, 4)),
        ("poke the green cube", "no, to the transparent sphere", ("poke", 1, 4)),
    ],
)
def test_a_correction_may_change_the_goal(before, correction, after):
    assert steps(correction, PLACES, pointed=[4], previous=parse(before)) == [after]


def test_an_ambiguous_correction_raises_several_fit():
    error = answer("no, the blue one", TABLE, previous=parse("reach the object left of the red cube"))
    assert isinstance(error, SeveralFit)
    assert error.candidates == (1, 2)
    assert error.position == 4


def test_errors_of_a_correction_refer_to_positions_in_the_correction():
    before = parse("touch the ball and push the blue cube to the purple cylinder")
    error = answer("no, the red one", TABLE, previous=before)
    assert isinstance(error, NothingFits)
    assert error.part == "purple object"
    assert error.position == 4


def test_gestures_of_a_correction_are_matched_to_its_words():
    before = parse("reach the red cube")
    assert steps("not that one, this one", TABLE, pointed=[2, 1], previous=before) == [("reach", None, 1)]
    assert steps("no, this one", TABLE, pointed=[2], previous=before) == [("reach", None, 2)]


def test_revise_equals_parse_with_the_previous_instruction():
    before, correction = parse("reach the red cube"), parse("no, the blue one")
    assert revise(before, correction, TABLE) == parse("no, the blue one", TABLE, previous=before)


@pytest.mark.parametrize(
    "sentence", ["hand me the cube", "give the red cube to me", "take the cube and put it in my hand"]
)
def test_a_hand_that_is_held_out_is_the_goal_without_being_named(sentence):
    held_out = Scene([Object("cube", "red", (0.4, 0.1, 0.025)), Object("palm", "pink", (0.5, -0.1, 0.12))])
    understood = parse(sentence, held_out)
    assert [(step.task, step.init, step.goal) for step in understood.steps] == [("hand_over", 0, 1)]
    assert understood.result[0].position == (0.5, -0.1, pytest.approx(0.145))
    nobody = parse(sentence, Scene(list(held_out)[:1]))
    assert (nobody.steps[0].goal, nobody.result[0].position) == (None, (0.4, 0.1, 0.025))


GATHERED = [
    Object("cube", "red", (0.5, 0.2, 0.025)),
    Object("cube", "red", (0.4, -0.1, 0.025)),
    Object("sphere", "red", (0.4, 0.1, 0.025)),
    Object("cube", "green", (0.45, -0.25, 0.025), role="target"),
    Object("cube", "red", (0.55, 0.25, 0.025), role="target"),
    Object("drawer", "red", (0.4, 0.4, 0.1)),
]


@pytest.mark.parametrize(
    ("phrase", "sorted_"),
    [("every red cube", [1, 0]), ("every red object", [1, 2, 0]), ("every object that is not a cube", [2])],
)
def test_every_gives_a_step_for_each_real_loose_object_the_nearest_to_the_place_first(phrase, sorted_):
    scene = Scene(GATHERED)
    understood = parse(f"sort {phrase} to the transparent green cube", scene)
    assert [(step.task, step.init, step.goal) for step in understood.steps] == [("sort", each, 3) for each in sorted_]
    assert set(understood.instructions) == {understood.meaning}
    assert understood.result[sorted_[-1]].position == scene[3].position


def test_sorting_with_the_names_one_object():
    scene = Scene(GATHERED)
    assert steps("bring the red sphere to the transparent green cube", scene) == [("sort", 2, 3)]
    assert isinstance(answer("gather the red cube at the transparent green cube", scene), SeveralFit)
    assert isinstance(answer("gather every blue cube at the transparent green cube", scene), NothingFits)


def test_every_object_is_one_part_of_a_chain():
    understood = parse(
        "reach the red sphere, then collect every red cube at the transparent green cube", Scene(GATHERED)
    )
    assert [step.task for step in understood.steps] == ["reach", "sort", "sort"]
    assert [each.task for each in understood.instructions] == ["reach", "sort", "sort"]

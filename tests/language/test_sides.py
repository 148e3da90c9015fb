"""Which things are meant by a side: one is the farthest there, "all" are those of its half, "two" the two farthest."""

import pytest

from language import Dialogue, Object, Plan, Scene, table

YS = {"red": 0.16, "green": 0.1, "gray": 0.01, "blue": -0.1, "pink": -0.18}


def touched(sentence):
    world = table(
        Scene([Object("cube", color, (0.4, y, 0.025)) for color, y in YS.items()]), bounds=(0.3, 0.5, -0.2, 0.2)
    )
    outcome = Dialogue().answer(sentence, world)
    assert isinstance(outcome, Plan), outcome
    return {list(YS)[step.object] for step in outcome.steps}


@pytest.mark.parametrize(
    ("sentence", "colors"),
    [
        ("touch all cubes on the right", "blue pink"),
        ("touch every cube on the left half of the table", "red green"),
        ("touch the cubes on the left", "red green"),
        ("touch the two cubes on the left", "red green"),
        ("touch the cube on the right", "pink"),
        ("move all cubes on the right to the left side", "blue pink"),
        ("put all the cubes on the right in a row", "blue pink"),
    ],
)
def test_all_things_of_a_side_are_those_of_its_half(sentence, colors):
    assert touched(sentence) <= set(colors.split())
    assert touched(sentence)

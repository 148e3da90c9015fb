"""Objects, scenes and viewpoints."""

import numpy as np
import pytest

from language import LanguageError, Object, Scene

THINGS = (
    Object("cube", "red", (0.4, 0.1, 0.02), size=0.04),
    Object("sphere", "blue", (0.5, -0.1, 0.02), role="target"),
)


def test_a_scene_returns_its_objects():
    made = Scene(THINGS)
    assert tuple(made) == THINGS
    assert len(made) == 2


def test_a_scene_of_arrays_equals_a_scene_of_objects():
    first = Scene(THINGS)
    again = Scene.from_arrays(first.nouns, first.colors, first.positions, first.sizes, first.targets)
    assert tuple(again) == THINGS


def test_a_scene_copies_its_arrays_and_is_read_only():
    positions = np.zeros((2, 3))
    made = Scene.from_arrays([0, 1], [0, 1], positions)
    positions[:] = 1
    assert not made.positions.any()
    with pytest.raises(ValueError, match="read-only"):
        made.positions[0] = 1


def test_moved_changes_positions_only():
    before = Scene(THINGS, viewpoint="human")
    moved = before.moved([(0.6, 0.0, 0.1), (0.5, -0.1, 0.02)])
    assert tuple(before) == THINGS
    assert [thing.position for thing in moved] == [(0.6, 0.0, 0.1), (0.5, -0.1, 0.02)]
    assert [(thing.noun, thing.size, thing.role) for thing in moved] == [
        ("cube", 0.04, "real"),
        ("sphere", 0.05, "target"),
    ]
    assert moved.viewpoint == "human"


def test_a_scene_may_be_empty():
    assert len(Scene([])) == 0


@pytest.mark.parametrize(("nouns", "colors", "rows"), [([9], [0], 1), ([0], [-1], 1), ([0], [0, 1], 1), ([0], [0], 2)])
def test_wrong_arrays_are_refused(nouns, colors, rows):
    with pytest.raises(LanguageError):
        Scene.from_arrays(nouns, colors, np.zeros((rows, 3)))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"noun": "sfere"}, "did you mean 'sphere'"),
        ({"color": "rd"}, "did you mean 'red'"),
        ({"role": "ghost"}, "choose from real, target"),
        ({"position": (0.0, float("nan"), 0.0)}, "finite"),
        ({"size": 0.0}, "positive"),
    ],
)
def test_invalid_objects_are_refused_with_a_message(wrong, message):
    with pytest.raises(LanguageError, match=message):
        Object(**({"noun": "cube", "color": "red", "position": (0.0, 0.0, 0.0)} | wrong))

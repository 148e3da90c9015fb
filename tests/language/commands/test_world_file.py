"""Boards and tables as YAML files."""

import pytest

from language import LanguageError, Plan, interpret
from language.scene_file import SceneFileError, read_world

BOARD = """\
held: b
viewpoint: human
blocks:
  - {id: a, noun: cube, color: white, cell: [1, 2, 0]}
  - {id: b, noun: pyramid, color: magenta, cell: [4, 4, 3]}
"""


def test_a_board_may_have_colours_and_shapes_that_only_people_say(tmp_path):
    path = tmp_path / "board.yaml"
    path.write_text(BOARD)
    world, ids = read_world(path)
    assert ids == ("a", "b")
    assert (world.held, world.viewpoint, world.cells) == (1, "human", True)
    outcome = interpret("put the violet prism on the white block", world)
    assert isinstance(outcome, Plan)
    assert [(step.verb, step.object, step.goal) for step in outcome.steps] == [("stack", 1, 0)]


def test_a_list_of_objects_is_a_table(tmp_path):
    path = tmp_path / "table.yaml"
    path.write_text("- {id: r, noun: cube, color: red, position: [0.5, 0.1, 0.0]}")
    world, ids = read_world(path)
    assert ids == ("r",)
    assert not world.cells


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("white", "whit", "block 1: 'whit' is not a known color; did you mean 'white'"),
        ("pyramid", "button", "block 2: 'button' is not a known noun"),
        ("[1, 2, 0]", "[1, 2, 9]", r"block 1: cell=\[1, 2, 9\] must be three whole numbers"),
        ("held: b", "held: c", "'c' is not a known held"),
        ("human", "cat", "'cat' is not a known viewpoint"),
        ("id: b", "id: a", "ids must be distinct"),
        ("cell: [1", "cel: [1", "'cel' is not a known key; did you mean 'cell'"),
    ],
)
def test_an_error_names_the_block_and_the_value(tmp_path, old, new, said):
    path = tmp_path / "board.yaml"
    path.write_text(BOARD.replace(old, new))
    with pytest.raises(LanguageError, match=said):
        read_world(path)


def test_aliases_that_describe_more_than_the_file_holds_are_refused(tmp_path):
    lines = ["a0: &a0 [x]", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 9))]
    path = tmp_path / "bomb.yaml"
    path.write_text("\n".join(lines))
    with pytest.raises(SceneFileError, match="describes more than"):
        read_world(path)

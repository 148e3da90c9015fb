"""Scenes as YAML files, and the error messages for invalid files."""

import numpy as np
import pytest

from language import COLORS, NOUNS
from language.cli import main
from language.sampling import draw_scene
from language.scene_file import MAX_OBJECTS, SceneFileError, as_entries, read_scene

ONE = "- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n"


def test_a_scene_is_unchanged_after_writing_and_reading(tmp_path):
    for seed in range(20):
        drawn = draw_scene(np.random.default_rng(seed))
        path = tmp_path / f"{seed}.yaml"
        path.write_text(
            "".join(
                f"- {{noun: {t.noun}, color: {t.color}, position: {list(t.position)}, "
                f"size: {t.size}, role: {t.role}}}\n"
                for t in drawn
            )
        )
        named = read_scene(path)
        assert list(named.scene) == list(drawn)
        assert named.ids == tuple(f"o{index}" for index in range(len(drawn)))
        assert [entry["id"] for entry in as_entries(named)] == list(named.ids)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "must be a list of objects"),
        ("a: 1", "must be a list of objects"),
        ("[]", "lists 0 objects"),
        (ONE.replace("id: a, ", "") * (MAX_OBJECTS + 1), f"lists {MAX_OBJECTS + 1} objects"),
        ("[", "is not YAML: line 1, column 2"),
        (ONE + "\x00", "is not YAML"),
        ("- {id: 2024-99-99}", "month must be in"),
        ("[" * 5000, "is not YAML that can be read"),
        ("- &a [*a]", "object 1: must be {id, noun"),
        (ONE + ONE, "object 2: id 'a' is taken by object 1"),
        (ONE.replace("id: a", "id: 1"), "object 1: id 1 must be text; put it in quotes"),
        (ONE.replace("id: a", "id: ''"), "object 1: id '' must be"),
        (ONE.replace("red", "redd"), "object 1 ('a'): color 'redd' is not a known color; did you mean 'red'?"),
        (ONE.replace("red", "[red]"), "color ['red'] must be a word"),
        (ONE.replace("cube", "cub"), "noun 'cub' is not a known noun; did you mean 'cube'?"),
        (ONE.replace("color", "colour"), "'colour' is not a known key of an object; did you mean 'color'?"),
        (ONE.replace("id", "1"), "'1' is not a known key"),
        (ONE.replace("noun: cube, ", ""), "noun is missing"),
        (ONE.replace("}", ", role: ghost}"), "role 'ghost' is not a known role; choose from real, target"),
        (ONE.replace(", 0.0]", "]"), "position [0.5, 0.1] has 2 numbers; give three"),
        (ONE.replace("[0.5, 0.1, 0.0]", "here"), "position 'here' must be a list of three numbers"),
        (ONE.replace("0.0", ".nan"), "position[2] nan must be a number from -1000 to 1000 metres"),
        (ONE.replace("0.0", "1.0e+300"), "position[2] 1e+300 must be"),
        (ONE.replace("0.0", "up"), "position[2] 'up' must be a number of metres"),
        (ONE.replace("0.0", "1e-1"), "position[2] '1e-1' must be a number of metres; write 0.1"),
        (ONE.replace("0.0", "yes"), "position[2] True must be a number"),
        (ONE.replace("0.0", "0x" + "f" * 5000), "position[2] a number of thousands of digits"),
        (ONE.replace("}", ", size: 0}"), "size 0.0 must be above 0"),
        (ONE.replace("}", ", size: }"), "size nothing must be a number"),
    ],
    ids=lambda value: None if len(value) > 60 else value,
)
def test_an_invalid_scene_file_is_refused_in_one_line(text, said, tmp_path, capsys):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    assert main(["describe", "--scene", str(path)]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(f"error: {path}: ")
    assert errors.count("\n") == 1
    assert said in errors


def test_folders_and_binary_files_are_refused(tmp_path):
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00\xd8")
    for path in (tmp_path, tmp_path / "bytes.yaml", tmp_path / "nowhere.yaml"):
        with pytest.raises(SceneFileError, match=r"cannot be read|is not YAML"):
            read_scene(path)


def test_every_noun_and_color_is_accepted_in_a_scene_file(tmp_path):
    path = tmp_path / "all.yaml"
    for noun in NOUNS:
        pairs = [(noun, color) for color in COLORS]
        path.write_text("".join(f"- {{noun: {n}, color: {c}, position: [0.5, 0, 0]}}\n" for n, c in pairs))
        assert [(thing.noun, thing.color) for thing in read_scene(path).scene] == pairs

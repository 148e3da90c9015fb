"""`python -m language parse` on sentences as people write them: understood, asked back, refused."""

import pytest

from language import LanguageError, Scene, interpret, whose_left
from language.cli import main
from language.scene_file import read_scene
from tests.helpers.language_cases import answered

SCENE = """\
- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}
- {id: b, noun: sphere, color: blue, position: [0.4, 0.0, 0.0], size: 0.04}
- {id: c, noun: cube, color: blue, position: [0.6, 0.2, 0.0]}
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return str(path)


def test_an_understood_sentence_has_steps_confidence_and_unused_words(capsys, scene):
    found, status = answered(capsys, "pls put teh red block ontop of the blue cube", "--scene", scene)
    assert status == 0
    assert found["outcome"] == "plan"
    assert [(step["verb"], step["object"], step["goal"]) for step in found["steps"]] == [
        ("lift", "a", None),
        ("stack", "a", "c"),
    ]
    assert 0 < found["confidence"] <= 1


def test_a_question_has_its_span_candidates_and_what_each_answer_does(capsys, scene):
    sentence = "grab the block plz"
    found, status = answered(capsys, sentence, "--scene", scene)
    assert status == 2
    assert (found["outcome"], found["error"]) == ("question", "question")
    assert sentence[slice(*found["span"])] == "block"
    assert found["candidates"] == ["a", "c"]
    assert [steps[0]["object"] for steps in found["choices"]] == ["a", "c"]


def test_a_refusal_has_its_reason_and_suggestions(capsys, scene):
    found, status = answered(capsys, "put the red block onto the ball plz", "--scene", scene)
    assert status == 2
    assert (found["outcome"], found["error"]) == ("refusal", "impossible")
    assert found["message"].endswith("nothing can stand on the blue sphere")
    assert found["suggestions"]


def test_what_no_grammar_reads_is_a_syntax_error_with_suggestions(capsys, scene):
    found, _ = answered(capsys, "frobnicate", "--scene", scene)
    assert (found["outcome"], found["error"]) == ("refusal", "syntax")
    assert found["expected"]
    assert found["suggestions"]


@pytest.mark.parametrize("sentence", ["grab the block plz", "pls take the cube that is red", "put it on the ball plz"])
def test_the_command_line_and_python_agree(capsys, scene, sentence):
    named = read_scene(scene)
    outcome = interpret(sentence, named.scene)
    found, _ = answered(capsys, sentence, "--scene", scene)
    assert found["outcome"] == type(outcome).__name__.lower()
    if "steps" in found:
        assert [named.index(step["object"]) for step in found["steps"]] == [step.object for step in outcome.steps]
    else:
        assert (found["message"], tuple(found["span"])) == (outcome.text, outcome.span)


def test_a_gesture_selects_an_object(capsys, scene):
    found, _ = answered(capsys, "pls take that cube", "--scene", scene, "--pointed", "c")
    assert [step["object"] for step in found["steps"]] == ["c"]


@pytest.mark.parametrize("viewpoint", ["robot", "human"])
@pytest.mark.parametrize("sentence", ["reach the red cube", "grab the block plz"])
def test_whose_left_is_told_with_each_sentence(capsys, scene, sentence, viewpoint):
    main(["parse", sentence, "--scene", scene, "--viewpoint", viewpoint])
    assert whose_left(viewpoint) in "".join(capsys.readouterr())


def test_whose_left_is_told_beside_the_names_of_objects(capsys, scene):
    main(["describe", "--scene", scene])
    assert capsys.readouterr().err.strip() == whose_left("robot")


def test_every_viewpoint_says_whose_left_is_meant():
    assert "robot's" in whose_left(Scene([]).viewpoint)
    with pytest.raises(LanguageError, match="'cat'"):
        whose_left("cat")

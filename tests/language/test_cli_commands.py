"""Commands of `python -m language`: output, errors and options."""

import io
import json

import pytest

import language
from language import VERBS, parse
from language.cli import main
from language.scene_file import read_scene
from tests.helpers.language_cases import answered

SCENE = """\
- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}
- {id: b, noun: sphere, color: blue, position: [0.4, 0.0, 0.0], size: 0.04}
- {id: c, noun: cube, color: blue, position: [0.6, 0.2, 0.0]}
- {id: t, noun: cube, color: green, position: [0.6, -0.2, 0.0], role: target}
"""
TWINS = "".join(f"- {{noun: cube, color: red, position: [0.5, 0.1, {z}]}}\n" for z in (0, 0))


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return str(path)


def printed(capsys, *arguments):
    assert main(arguments) == 0
    return capsys.readouterr().out


def test_parse_prints_objects_reward_and_networks(capsys, scene):
    step = {"task": "pick_and_place", "init": "a", "goal": "t", "reward": "pnp", "networks": 3}
    sentence = "pick the red cube and place it to the same position as the transparent green cube"
    assert answered(capsys, sentence, "--scene", scene) == ({**step, "steps": [step]}, 0)


def test_the_answer_to_a_chain_lists_all_steps_and_repeats_the_first(capsys, scene):
    answer, status = answered(capsys, "lift the red cube, then reach the sphere", "--scene", scene)
    assert [(step["task"], step["init"], step["goal"]) for step in answer["steps"]] == [
        ("lift", "a", None),
        ("reach", None, "b"),
    ]
    assert {**answer["steps"][0], "steps": answer["steps"]} == answer
    assert status == 0


@pytest.mark.parametrize(
    ("sentence", "error", "position", "candidates"),
    [
        ("reach the bleu one", "question", 10, ["b", "c"]),
        ("frobnicate", "syntax", 0, []),
        ("", "syntax", 0, []),
        ("reach the red sphere", "nothing", 6, []),
        ("reach there", "nothing", 6, []),
        ("no, the blue one", "nothing", 0, []),
        ("reach the blue one", "ambiguous", 6, ["b", "c"]),
        ("lift the red cube, then reach the blue one", "ambiguous", 30, ["b", "c"]),
    ],
)
def test_errors_have_kind_position_and_candidates(capsys, scene, sentence, error, position, candidates):
    answer, status = answered(capsys, sentence, "--scene", scene)
    assert (answer["error"], answer["position"], answer["candidates"]) == (error, position, candidates)
    assert answer["message"]
    assert status == 2
    assert ("expected" in answer) == (error == "syntax")


def test_answers_go_to_stdout_and_errors_to_stderr(capsys, scene):
    assert main(["parse", "reach the blue cube", "--scene", scene]) == 0
    out, errors = capsys.readouterr()
    assert out.splitlines()[0] == "reach the blue cube"
    assert "goal c" in out
    assert not errors
    assert main(["parse", "reach the blue one", "--scene", scene]) == 2
    out, errors = capsys.readouterr()
    assert errors.splitlines()[:2] == ["reach the blue one", "      ^"]
    assert "candidates: b, c" in errors
    assert not out


def test_pointed_and_viewpoint_options_change_the_answer(capsys, scene):
    assert answered(capsys, "reach this", "--scene", scene, "--pointed", "c")[0]["goal"] == "c"
    put = answered(capsys, "put this there", "--scene", scene, "--pointed", "b", "--pointed", "t")[0]
    assert (put["init"], put["goal"]) == ("b", "t")
    assert answered(capsys, "reach the left cube", "--scene", scene)[0]["goal"] == "c"
    assert answered(capsys, "reach the left cube", "--scene", scene, "--viewpoint", "human")[0]["goal"] == "t"


def test_without_a_scene_only_the_words_are_parsed(capsys):
    step = {"task": "push", "object": "the blue object", "place": "the sphere"}
    assert answered(capsys, "push the blue one to the ball") == ({**step, "steps": [step]}, 0)
    assert answered(capsys, "no, the blue one")[0]["object"] == "the blue object"
    assert answered(capsys, "push the blue one")[1] == 2
    assert printed(capsys, "parse", "reach the tin") == "task reach, object the cylinder\n"


def test_lines_are_answered_in_order_and_corrections_revise_the_last_understood(capsys, scene, monkeypatch):
    lines = "lift the red cube\n\n  \nlift the pink cube\nno, the blue one\r\nno, the green one\nreach the sphere"
    monkeypatch.setattr("sys.stdin", io.StringIO(lines))
    assert main(["parse", "-", "--scene", scene]) == 2
    answers = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [answer.get("init", answer.get("error")) for answer in answers] == ["a", "nothing", "c", "nothing", None]
    assert answers[-1]["goal"] == "b"


def test_help_shows_examples_and_the_scene_file(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    shown = capsys.readouterr().out
    assert not ended.value.code
    assert "python -m language parse" in shown
    assert "role: target" in shown


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "required: command"),
        (["foo"], "invalid choice: 'foo'"),
        (["sample", "--n", "0"], "'0' must be a whole number of at least 1"),
        (["sample", "--n", "many"], "'many'"),
        (["sample", "--seed", "-1"], "'-1'"),
        (["sample", "--depth", "4"], "from 0 to 3"),
        (["sample", "--steps", "9" * 5000], "from 1 to 10"),
        (["describe"], "--scene"),
        (["parse", "x", "--viewpoint", "cat", "--scene", "s"], "'cat' (choose from 'robot', 'human')"),
    ],
)
def test_wrong_arguments_print_one_line(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    errors = capsys.readouterr().err
    assert ended.value.code == 2
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1
    assert said in errors


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--pointed", "a"], "--pointed needs --scene"),
        (["--viewpoint", "human"], "--viewpoint needs --scene"),
        (["--scene", "/nowhere.yaml"], "/nowhere.yaml: cannot be read"),
    ],
)
def test_options_that_need_a_scene_are_refused_without_one(arguments, said, capsys):
    assert main(["parse", "reach this", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_an_unknown_pointed_object_is_refused_with_the_known_ids(capsys, scene):
    assert main(["parse", "reach this", "--scene", scene, "--pointed", "x"]) == 2
    assert "'x' is not a known object id; choose from a, b, c, t" in capsys.readouterr().err


def test_describe_names_every_object(capsys, scene):
    names = dict(line.split("  ", 1) for line in printed(capsys, "describe", "--scene", scene).splitlines())
    assert names == {"a": "the red cube", "b": "the blue sphere", "c": "the blue cube", "t": "the green cube"}


def test_describe_all_lists_phrases_that_name_the_object(capsys, scene):
    named = read_scene(scene)
    for thing in json.loads(printed(capsys, "describe", "--scene", scene, "--all", "--json")):
        assert thing["name"] in thing["phrases"]
        for phrase in thing["phrases"][::3]:
            assert named.ids[parse(f"reach {phrase}", named.scene).steps[0].goal] == thing["id"]


def test_describe_marks_objects_that_no_words_distinguish(capsys, tmp_path):
    (tmp_path / "twins.yaml").write_text(TWINS)
    words = printed(capsys, "describe", "--scene", str(tmp_path / "twins.yaml"), "--all")
    assert words.splitlines() == [f"o{i}  (no phrase distinguishes it from the others)" for i in (0, 1)]


def test_count_prints_exact_numbers_and_powers_of_ten(capsys):
    counted = json.loads(printed(capsys, "count", "--json"))
    assert [row["depth"] for row in counted] == [0, 1, 2, 3]
    assert [row["sentences"] for row in counted] == [language.count(depth) for depth in range(4)]
    assert [int(row["log10"]) for row in counted] == [len(str(row["sentences"])) - 1 for row in counted]
    assert f"{counted[0]['sentences']:,}" in printed(capsys, "count")


def test_samples_in_json_include_their_scene(capsys, tmp_path):
    for line in printed(capsys, "sample", "--n", "10", "--json", "--varied").splitlines():
        drawn = json.loads(line)
        (tmp_path / "drawn.yaml").write_text(json.dumps(drawn.pop("scene")))  # JSON is YAML
        answer, status = answered(capsys, drawn.pop("sentence"), "--scene", str(tmp_path / "drawn.yaml"))
        assert (answer, status) == (drawn, 0)


def test_samples_repeat_with_the_seed_and_use_the_given_scene(capsys, scene):
    first = printed(capsys, "sample", "--n", "30", "--seed", "7", "--scene", scene)
    assert first == printed(capsys, "sample", "--n", "30", "--seed", "7", "--scene", scene)
    assert first != printed(capsys, "sample", "--n", "30", "--seed", "8", "--scene", scene)
    named = read_scene(scene)
    tasks = [parse(line, named.scene).steps[0] for line in first.splitlines()]
    assert {named.id(step.goal) for step in tasks if VERBS[step.task].effect == "goal"} <= {"t", None}


def test_sampling_an_impossible_instruction_is_refused(capsys, tmp_path):
    (tmp_path / "twins.yaml").write_text(TWINS)
    assert main(["sample", "--scene", str(tmp_path / "twins.yaml"), "--depth", "3"]) == 2
    assert "no instruction of 1 step with 3 nested relations can be said here" in capsys.readouterr().err

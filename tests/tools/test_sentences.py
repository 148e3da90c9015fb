"""Sentences of other people in files: formats, results, errors."""

import subprocess
import sys
from pathlib import Path

import pytest

from language import LanguageError
from language.scene_file import read_world
from tools.sentences import judged, read_sentences

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"


def test_every_expectation_of_the_example_is_met():
    sentences = read_sentences(EXAMPLES / "sentences.tsv")
    results = [judged(sentence, *read_world(sentence.scene))[0] for sentence in sentences]
    assert len(sentences) == 6
    assert set(results) == {"right", "understood"}
    assert results.count("right") == sum(bool(sentence.object) for sentence in sentences)


@pytest.mark.parametrize(
    ("expected", "result"),
    [(("r", "b"), "right"), (("r", "s"), "wrong"), (("b", ""), "wrong"), (("", ""), "understood")],
)
def test_an_understood_sentence_is_right_if_object_and_target_are_the_expected_ones(expected, result):
    sentence = read_sentences(EXAMPLES / "sentences.tsv")[0]._replace(text="put the red cube on the blue one")
    sentence = sentence._replace(object=expected[0], target=expected[1])
    assert judged(sentence, *read_world(EXAMPLES / "table.yaml"))[0] == result


def test_annotations_are_grouped_by_task():
    sentences = read_sentences(EXAMPLES / "annotations.yaml", EXAMPLES / "table.yaml")
    assert {sentence.group for sentence in sentences} == {"lift_red_block", "push_blue_block_left", "stack_block"}


def test_a_list_of_tasks_and_sentences_is_read_from_json(tmp_path):
    path = tmp_path / "list.json"
    path.write_text('[{"task": "lift", "sentence": "lift the red block"}]')
    (sentence,) = read_sentences(path, EXAMPLES / "table.yaml")
    assert (sentence.text, sentence.group) == ("lift the red block", "lift")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.tsv", "take it\n", "line 1 has 1 fields"),
        ("a.txt", "take it\n", "must end in .tsv"),
        ("a.json", "[1]", "entry 1 must be"),
        ("a.yaml", "[", "is not YAML"),
    ],
)
def test_an_error_names_file_and_line(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(LanguageError, match=rf"{name}.*{said}"):
        read_sentences(tmp_path / name, EXAMPLES / "table.yaml")


@pytest.mark.slow
def test_the_benchmark_prints_the_results():
    command = [sys.executable, "-m", "benchmarks.sentences", "--data", str(EXAMPLES / "sentences.tsv"), "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert '"right": 5, "wrong": 0' in done.stdout

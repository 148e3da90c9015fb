"""`interpret` on sentences as people write them: their outcomes, dialogues, and robustness."""

from collections import Counter

import numpy as np
import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal, board, interpret
from language.lattice import vocabulary
from language.normalise import normalised
from tests.helpers.people_sentences import CASES, judged

TABLE = Scene(
    [
        Object("cube", "red", (0.5, 0.15, 0.025)),
        Object("cube", "blue", (0.6, 0.0, 0.025)),
        Object("sphere", "green", (0.45, -0.15, 0.025)),
    ]
)


@pytest.mark.slow
def test_nine_of_ten_sentences_of_people_are_understood_as_expected_and_hardly_any_wrongly():
    results = Counter(judged(*case)[0] for case in CASES)
    assert len(CASES) == 200
    assert results["right"] >= 0.97 * len(CASES)
    assert results["wrong"] <= 0.01 * len(CASES)
    assert results["unhelpful"] == 0


def test_understood_steps_say_what_goes_where_and_on_what():
    outcome = interpret("put the red cube on the blue one", TABLE)
    assert isinstance(outcome, Plan)
    take, place = outcome.steps
    assert (take.verb, take.object) == ("lift", 0)
    assert (place.verb, place.object, place.place, place.goal) == ("stack", 0, (0.6, 0.0), 1)
    assert place.bottom == pytest.approx(0.05)
    assert outcome.result.below[0] == 1


@pytest.mark.parametrize(
    "sentence", ["what can you do", "What's this?", "who are you", "how many cubes are there", "help"]
)
def test_a_question_moves_nothing_even_where_a_command_went_before(sentence):
    dialogue = Dialogue()
    assert isinstance(interpret("move the blue cube to the left", TABLE, dialogue), Plan)
    outcome = interpret(sentence, TABLE, dialogue)
    assert isinstance(outcome, Answer)
    assert isinstance(interpret("what about the red one", TABLE, dialogue), Plan)


def test_a_colour_that_nothing_has_is_not_left_out():
    outcome = interpret("put a sphere next to the yellow one", TABLE)
    assert isinstance(outcome, Refusal)
    assert "yellow" in outcome.text


def test_an_ambiguous_phrase_is_asked_about_with_its_candidates():
    outcome = interpret("take the cube", TABLE)
    assert isinstance(outcome, Question)
    assert outcome.candidates == (0, 1)
    assert [choice.steps[0].object for choice in outcome.choices] == [0, 1]
    assert "red cube" in outcome.text
    assert "blue cube" in outcome.text


def test_a_refusal_says_why_and_what_could_be_said():
    outcome = interpret("put the red cube on the green ball", TABLE)
    assert isinstance(outcome, Refusal)
    assert (outcome.reason, outcome.text) == ("impossible", "nothing can stand on the green sphere")
    assert outcome.suggestions


def test_the_span_of_a_refusal_is_the_phrase_that_nothing_fits():
    sentence = "take the purple pyramid"
    outcome = interpret(sentence, TABLE)
    assert isinstance(outcome, Refusal)
    assert sentence[slice(*outcome.span)] == "purple pyramid"


def test_a_word_that_may_change_the_meaning_is_never_left_out():
    outcome = interpret("take the red cube frobnicated", TABLE)
    assert isinstance(outcome, Refusal)
    assert "frobnicated" in outcome.text
    assert isinstance(interpret("take the shiny red cube gently", TABLE), Plan)


def test_a_loose_colour_is_settled_by_the_scene_and_noted():
    outcome = interpret("take the purple block", board([("cube", "magenta", 1, 1, 0), ("cube", "blue", 2, 2, 0)]))
    assert isinstance(outcome, Plan)
    assert outcome.steps[0].object == 0
    assert outcome.notes == ("purple is taken for magenta",)


PAIRS = Scene([*TABLE, Object("cube", "red", (0.3, -0.15, 0.025)), Object("cube", "red", (0.3, 0.1, 0.025))])


@pytest.mark.parametrize(
    ("command", "things"),
    [
        ("sort the red cubes to the left", {0, 3, 4}),
        ("put red cubes next to the sphere", {0, 3, 4}),
        ("push the cubes to the right", {0, 1, 3, 4}),
        ("put the red ones behind the blue cube", {0, 3, 4}),
        ("move the blue cubes to the left", {1}),
    ],
)
def test_a_plural_means_all_things_that_fit(command, things):
    outcome = interpret(command, PAIRS)
    assert isinstance(outcome, Plan)
    assert {step.object for step in outcome.steps} == things


def test_of_a_plural_that_cannot_be_taken_at_once_one_is_asked_for():
    outcome = interpret("pick up the red cubes", PAIRS)
    assert isinstance(outcome, Question)
    assert set(outcome.candidates) == {0, 3, 4}


def test_on_a_board_a_plural_is_rather_the_stack():
    red = [("cube", "red", 2, 2, 0), ("cube", "red", 2, 2, 1), ("cube", "red", 5, 5, 0)]
    outcome = interpret("put the red cubes on the green cube", board([*red, ("cube", "green", 0, 0, 0)]))
    assert isinstance(outcome, Plan)
    assert {step.object for step in outcome.steps} == {1}


def test_the_viewpoint_decides_whose_left_is_meant():
    first, second = (
        interpret("put the red cube left of the blue cube", Scene(list(TABLE), viewpoint))
        for viewpoint in ("robot", "human")
    )
    assert first.steps[1].place[1] > 0 > second.steps[1].place[1]


def test_undo_brings_everything_back():
    dialogue = Dialogue()
    dialogue.answer("put the red cube on the blue cube", TABLE)
    outcome = dialogue.answer("undo")
    assert [(step.verb, step.object) for step in outcome.steps] == [("lift", 0), ("pick_and_place", 0)]
    assert outcome.steps[1].place == (0.5, 0.15)


@pytest.mark.parametrize(
    "sentence", ["", " ", "?!", "a" * 5000, "the " * 300, "take the red cube \0 \U0001f9f1", "\u0130"]
)
def test_strange_strings_are_refused_or_understood_without_an_exception(sentence):
    assert isinstance(interpret(sentence, TABLE), Plan | Question | Refusal | Answer | Signal)


def test_random_words_raise_nothing():
    rng, words, dialogue = np.random.default_rng(0), sorted(vocabulary()), Dialogue()
    for _ in range(60):
        sentence = " ".join(words[i] for i in rng.integers(len(words), size=rng.integers(1, 15)))
        assert isinstance(dialogue.answer(sentence, TABLE), Plan | Question | Refusal | Answer | Signal)


def test_an_empty_scene_is_no_error():
    assert isinstance(interpret("take the red cube", board([])), Refusal)


@pytest.mark.parametrize(
    "sentence",
    [
        "pls giv me the red cube",
        "bring me the red one",
        "i need the red one",
        "put the red cube into my hand",
    ],
)
def test_what_is_brought_to_a_person_goes_to_the_hand_that_they_hold_out(sentence):
    things = [Object("cube", "red", (0.4, 0.1, 0.025)), Object("palm", "pink", (0.5, -0.1, 0.12))]
    outcome = interpret(sentence, Scene(things))
    assert isinstance(outcome, Plan)
    place = outcome.steps[-1]
    assert (place.verb, place.object, place.goal, place.place) == ("hand_over", 0, 1, (0.5, -0.1))
    assert place.bottom == pytest.approx(0.12)
    far = interpret("bring me the red cube", Scene(things[:1]))
    assert far.steps[-1].goal is None


@pytest.mark.parametrize("before", ["", "press the button, ", "close it and then open it. "])
def test_a_wording_is_made_plain_wherever_its_clause_begins(before):
    for said, plain in (
        ("make the drawer empty", "empty drawer"),
        ("red and blue closer to each other", "move red towards blue"),
        ("could you please close the drawer", "close drawer"),
    ):
        words = [token.text for token in normalised(before + said)]
        assert " ".join(words[-len(plain.split()) :]) == plain

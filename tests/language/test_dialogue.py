"""Dialogues about one scene: instructions, questions and answers, corrections, nonsense."""

import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal

RED_CUBE, BLUE_CUBE, RED_BALL = range(3)
SCENE = Scene(
    [
        Object("cube", "red", (0.4, 0.1, 0.025)),
        Object("cube", "blue", (0.4, -0.1, 0.025)),
        Object("sphere", "red", (0.5, 0.2, 0.025)),
    ]
)


def result_of(*sentences, pointed=()):
    """The outcome of the last sentence."""
    dialogue = Dialogue()
    first, *others = sentences
    outcome = dialogue.answer(first, SCENE, pointed)
    for sentence in others:
        outcome = dialogue.answer(sentence, None, pointed)
    return outcome


def objects(result):
    assert isinstance(result, Plan), result
    return [step.object for step in result.steps]


@pytest.mark.parametrize(
    ("sentences", "expected"),
    [
        (["reach the blue cube"], [BLUE_CUBE]),
        (["reach the red cube", "no, the blue one"], [BLUE_CUBE]),
        (["reach the cube", "the blue one"], [BLUE_CUBE]),
        (["reach the cube", "blue"], [BLUE_CUBE]),
        (["reach the red object", "sphere"], [RED_BALL]),
        (["reach the cube", "reach the sphere"], [RED_BALL]),  # an instruction instead of an answer
        (["reach the cube", "the first one from the left"], [RED_CUBE]),
        (["reach the sphere then reach the red cube"], [RED_BALL, RED_CUBE]),
        (["reach the sphere", "the same with the blue cube"], [BLUE_CUBE]),
        (["reach the sphere", "again"], [RED_BALL]),
        (["reach the cube", "both"], [RED_CUBE, BLUE_CUBE]),
    ],
)
def test_the_last_sentence_of_a_dialogue_is_understood(sentences, expected):
    assert objects(result_of(*sentences)) == expected


def test_an_ambiguous_sentence_gets_a_question_that_names_its_candidates():
    result = result_of("reach the cube")
    assert isinstance(result, Question)
    assert result.text == "Do you mean the red cube, the blue cube, or something else?"
    assert result.candidates == (RED_CUBE, BLUE_CUBE)


def test_a_gesture_gives_the_referent_of_this():
    assert objects(result_of("reach this", pointed=[RED_BALL])) == [RED_BALL]


@pytest.mark.parametrize("sentence", ["hello", "reach the", "<script>alert(1)</script>", "reach the green cube", "\0"])
def test_a_sentence_that_asks_for_nothing_keeps_the_previous_one(sentence):
    dialogue = Dialogue()
    dialogue.answer("reach the red cube", SCENE)
    result = dialogue.answer(sentence, SCENE)
    assert isinstance(result, Answer | Refusal | Question)
    assert result.text
    assert objects(dialogue.answer("again", SCENE)) == [RED_CUBE]


def test_a_copy_of_a_dialogue_remembers_nothing_for_it():
    dialogue = Dialogue()
    dialogue.answer("reach the cube", SCENE)
    assert objects(dialogue.copy().answer("the red one", SCENE)) == [RED_CUBE]
    assert len(dialogue.turns) == 1


def test_a_sentence_that_is_too_long_is_refused():
    assert isinstance(result_of("reach " * 10_000), Refusal)


@pytest.mark.parametrize(
    ("sentence", "control"),
    [("stop!", "stop"), ("hold on a second", "wait"), ("carry on", "continue"), ("go faster please", "faster")],
)
def test_sentences_about_the_motion_are_signals(sentence, control):
    result = result_of("reach the sphere", sentence)
    assert isinstance(result, Signal)
    assert result.control == control


def test_a_wish_for_speed_is_answered_with_where_to_set_it():
    assert "under Time" in result_of("go faster please").text


def test_undo_brings_things_back_in_steps():
    result = result_of("put the red cube on the blue cube", "undo that")
    assert isinstance(result, Signal)
    assert [step.object for step in result.steps] == [RED_CUBE, RED_CUBE]
    assert result.steps[-1].place == (0.4, 0.1)


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("what do you see?", ["red cube", "red sphere"]),
        ("how many cubes are there?", ["two"]),
        ("where is the blue cube?", ["on the table"]),
        ("what are you holding?", ["nothing"]),
        ("is there a green cube?", ["no"]),
        ("what can you do?", ["pick things up"]),
        ("what did I say?", ["reach the sphere"]),
        ("why did you do that?", ["reach the sphere"]),
    ],
)
def test_questions_are_answered_from_the_world_and_the_history(question, words):
    result = result_of("reach the sphere", question)
    assert isinstance(result, Answer), result
    assert all(word in result.text for word in words), result.text


@pytest.mark.parametrize(
    ("sentence", "word"),
    [
        ("nimm bitte den roten Würfel", "Englisch"),
        ("polož červenou kostku na modrou", "anglicky"),
        ("pon el cubo rojo encima del azul", "inglés"),
        ("pose le cube rouge sur le cube bleu", "anglais"),
    ],
)
def test_another_language_is_told_in_it_that_english_is_understood(sentence, word):
    result = result_of(sentence)
    assert isinstance(result, Refusal)
    assert result.reason == "language"
    assert word in result.text
    assert result.suggestions

"""Dialogue about one scene: instructions, corrections, and answers to the parser's questions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from language import (
    Command,
    Correction,
    LanguageError,
    NotUnderstood,
    ObjectPhrase,
    Scene,
    SeveralFit,
    Understood,
    parse,
    say,
)
from language.verbs import HERE, POINTING

MAX_CHARACTERS = 300  # of a sentence; the rest is ignored

PointedObjects = Callable[[int], Sequence[int]]  # n -> the objects that the last n gestures single out


@dataclass(frozen=True)
class OpenQuestion:
    """A command in which one phrase fits several objects. phrase: the words of that phrase."""

    command: Command
    phrase: str


@dataclass(frozen=True)
class Interpretation:
    """The interpretation of a sentence.

    understood: None if it was not understood. message: the error, or the question to the person. position: index of
    the first character that does not fit, or of the ambiguous phrase. candidates: the objects that the phrase fits.
    """

    sentence: str
    understood: Understood | None
    message: str = ""
    position: int = 0
    candidates: tuple[int, ...] = ()


class Dialogue:
    """A dialogue about one scene. previous: the last understood command, which a correction changes."""

    def __init__(self) -> None:
        self.previous: Understood | None = None
        self._question: OpenQuestion | None = None

    def preview(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        """Interprets a sentence without changing the state of the dialogue. Never raises: errors are in the result."""
        return self._interpret(sentence, scene, pointed)[0]

    def hear(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        """Interprets a sentence. Later sentences can correct it, or answer the question that it raises."""
        interpretation, self._question = self._interpret(sentence, scene, pointed)
        self.previous = interpretation.understood or self.previous
        return interpretation

    def _interpret(
        self, sentence: str, scene: Scene, pointed: PointedObjects
    ) -> tuple[Interpretation, OpenQuestion | None]:
        """The interpretation, and the question that is open after it."""
        sentence = sentence[:MAX_CHARACTERS]
        try:
            meaning = parse(sentence)
        except NotUnderstood as error:
            answer = self._interpret_answer(sentence, scene) if self._question else None
            return answer or (Interpretation(sentence, None, str(error), error.position), self._question)
        try:
            previous = self._question.command if self._question else self.previous
            return Interpretation(sentence, parse(sentence, scene, pointed(count_gestures(meaning)), previous)), None
        except LanguageError as error:
            failure = _failure(sentence, error)
            if isinstance(error, SeveralFit) and not isinstance(meaning, Correction):
                return failure, OpenQuestion(meaning, _phrase_at(meaning, error.position))
            return failure, self._question

    def _interpret_answer(self, answer: str, scene: Scene) -> tuple[Interpretation, OpenQuestion | None] | None:
        """The command of the open question with this answer; None if the words are not an answer."""
        assert self._question is not None
        for words in (answer, f"the {answer}", f"the {answer} one"):
            try:  # an answer is parsed as a correction of the ambiguous phrase
                correction = f"not {self._question.phrase}, {words}"
                return Interpretation(answer, parse(correction, scene, (), self._question.command)), None
            except NotUnderstood:
                continue
            except LanguageError as error:
                failure = _failure(answer, error)
                return Interpretation(answer, None, failure.message, 0, failure.candidates), self._question
        return None


def count_gestures(meaning: Command | Correction) -> int:
    """The number of phrases that require a gesture ("this", "here")."""
    return sum(phrase.determiner in (*POINTING, *HERE) for phrase in _phrases(meaning))


def _phrases(meaning: Command | Correction) -> list[ObjectPhrase]:
    """All phrases, nested ones included."""
    steps = (meaning,) if isinstance(meaning, Correction) else meaning.steps
    phrases = [phrase for step in steps for phrase in (step.phrase, step.goal) if phrase is not None]
    return [part for phrase in phrases for part in phrase.parts()]


def _phrase_at(command: Command, position: int) -> str:
    """The words of the phrase that starts at this character."""
    phrases = (phrase for phrase in _phrases(command) if phrase.position == position)
    return say(next(phrases, command.steps[-1].phrase))


def _failure(sentence: str, error: LanguageError) -> Interpretation:
    message = getattr(error, "question", "") or str(error)
    return Interpretation(sentence, None, message, getattr(error, "position", 0), getattr(error, "candidates", ()))

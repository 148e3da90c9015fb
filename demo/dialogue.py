"""What somebody types, understood in the scene: instructions, corrections, and answers to the parser's questions."""

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

LONGEST = 300  # characters of a sentence that are looked at


@dataclass(frozen=True)
class Open:
    """What was asked back about. phrase: the words that left it open."""

    command: Command
    phrase: str


@dataclass(frozen=True)
class Heard:
    """What came of a sentence.

    understood: None where it is not. message: what is wrong with it, or what it asks back. place: the first character
    that does not belong, or the beginning of what stays open. candidates: the objects that it could mean.
    """

    sentence: str
    understood: Understood | None
    message: str = ""
    place: int = 0
    candidates: tuple[int, ...] = ()


class Talk:
    """A conversation about one scene. previous: what was last understood, which a correction revises."""

    def __init__(self) -> None:
        self.previous: Understood | None = None
        self._open: Open | None = None

    def listen(self, sentence: str, scene: Scene, pointed: Callable[[int], Sequence[int]]) -> Heard:
        """What the sentence would come to, and nothing is remembered.

        pointed: of so many gestures, the objects that they single out. Raises nothing: bad words are an answer too.
        """
        return self._heard(sentence, scene, pointed)[0]

    def hear(self, sentence: str, scene: Scene, pointed: Callable[[int], Sequence[int]]) -> Heard:
        """The same, remembered: what comes next can correct it, or answer what it left open."""
        heard, self._open = self._heard(sentence, scene, pointed)
        self.previous = heard.understood or self.previous
        return heard

    def _heard(self, sentence: str, scene: Scene, pointed: Callable[[int], Sequence[int]]) -> tuple[Heard, Open | None]:
        sentence = sentence[:LONGEST]
        try:
            meaning = parse(sentence)
        except NotUnderstood as error:
            answer = self._answered(sentence, scene) if self._open else None
            return answer or (Heard(sentence, None, str(error), error.position), self._open)
        try:
            previous = self._open.command if self._open else self.previous
            return Heard(sentence, parse(sentence, scene, pointed(gestures(meaning)), previous)), None
        except LanguageError as error:
            failed = _failed(sentence, error)
            if isinstance(error, SeveralFit) and not isinstance(meaning, Correction):
                return failed, Open(meaning, _phrase_at(meaning, error.position))
            return failed, self._open

    def _answered(self, answer: str, scene: Scene) -> tuple[Heard, Open | None] | None:
        """The question's instruction with this answer; None where the words are no answer either."""
        assert self._open is not None
        for words in (answer, f"the {answer}", f"the {answer} one"):
            try:  # an answer is a correction of what was left open
                correction = f"not {self._open.phrase}, {words}"
                return Heard(answer, parse(correction, scene, (), self._open.command)), None
            except NotUnderstood:
                continue
            except LanguageError as error:
                failed = _failed(answer, error)
                return Heard(answer, None, failed.message, 0, failed.candidates), self._open
        return None


def gestures(meaning: Command | Correction) -> int:
    """How many of its words need somebody to point."""
    return sum(part.determiner in (*POINTING, *HERE) for part in _parts(meaning))


def _parts(meaning: Command | Correction) -> list[ObjectPhrase]:
    steps = (meaning,) if isinstance(meaning, Correction) else meaning.steps
    phrases = [phrase for step in steps for phrase in (step.phrase, step.goal) if phrase is not None]
    return [part for phrase in phrases for part in phrase.parts()]


def _phrase_at(command: Command, position: int) -> str:
    """The words of the phrase that begins there."""
    return next((say(part) for part in _parts(command) if part.position == position), say(command.steps[-1].phrase))


def _failed(sentence: str, error: LanguageError) -> Heard:
    message = getattr(error, "question", "") or str(error)
    return Heard(sentence, None, message, getattr(error, "position", 0), getattr(error, "candidates", ()))

"""Dialogue about one scene: instructions, corrections, and answers to the parser's questions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from demo.spelling import tidied
from language import (
    Command,
    Correction,
    LanguageError,
    NotUnderstood,
    ObjectPhrase,
    Scene,
    SeveralFit,
    Understood,
    commands,
    parse,
    say,
)
from language.verbs import HERE, POINTING

SPEED = "the clock has a speed, under Time; the arm keeps its own"
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

    understood: of an instruction or a correction; else None. actions: of any other sentence that was understood.
    message: the error, the question to the person, or a choice that the scene settled. position: index of the
    first character that does not fit, or of the ambiguous phrase. candidates: the objects that the phrase fits.
    """

    sentence: str
    understood: Understood | None
    message: str = ""
    position: int = 0
    candidates: tuple[int, ...] = ()
    actions: tuple[commands.Action, ...] = ()


class Dialogue:
    """A dialogue about one scene. previous: the last understood command, which a correction changes.

    spoken: the objects of the last sentence that was understood, the likeliest of "it" first.
    """

    def __init__(
        self,
        default: str | None = None,
        surroundings: dict[str, Any] | None = None,
        held: Callable[[], int | None] = lambda: None,
    ) -> None:
        """default: the kind of step that is meant where only an object is named; None: none.

        surroundings: of the scene, as `language.commands.Dialogue` takes them. held: gives the index of what the
        gripper holds, or None.
        """
        self._held = held
        self._default = default
        self.previous: Understood | None = None
        self.spoken: tuple[int, ...] = ()
        self._question: OpenQuestion | None = None
        self._commands = commands.Dialogue(surroundings=surroundings or {})

    def preview(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        """Interprets a sentence without changing the state of the dialogue. Never raises: errors are in the result."""
        sentence = sentence[:MAX_CHARACTERS]
        found, _ = self._interpret_instruction(sentence, scene, pointed)
        if _is_settled(found):  # pages preview at every key press: the rest would be dropped
            return found
        wide = replace(self._commands, history=[*self._commands.history])
        wide.surroundings["held"] = self._held()
        outcome = wide.answer(sentence, scene, _gestures(sentence, pointed))
        return self._tidied(outcome, scene, pointed) or self._beyond(found, outcome)

    def hear(self, sentence: str, scene: Scene, pointed: PointedObjects) -> Interpretation:
        """Interprets a sentence. Later sentences can correct it, or answer the question that it raises."""
        sentence = sentence[:MAX_CHARACTERS]
        found, self._question = self._interpret_instruction(sentence, scene, pointed)
        self._commands.surroundings["held"] = self._held()
        outcome = self._commands.answer(sentence, scene, _gestures(sentence, pointed))  # it remembers every sentence
        if not _is_settled(found):
            found = self._tidied(outcome, scene, pointed) or self._beyond(found, outcome)
        self.previous = found.understood or self.previous
        self.spoken = _objects(found) or self.spoken
        return found

    def _tidied(self, outcome: commands.Outcome, scene: Scene, pointed: PointedObjects) -> Interpretation | None:
        """The interpretation of a refused sentence by the instruction grammar, without typing errors; None: none."""
        if not isinstance(outcome, commands.Refusal):
            return None
        found, _ = self._interpret_instruction(tidied(outcome.sentence), scene, pointed)
        return replace(found, sentence=outcome.sentence) if found.understood is not None else None

    def _beyond(self, found: Interpretation, outcome: commands.Outcome) -> Interpretation:
        """The interpretation of a sentence that the instruction grammar does not settle."""
        is_open = isinstance(outcome, commands.Question) and not outcome.choices and len(outcome.candidates) == 1
        if is_open and self._default:
            assert isinstance(outcome, commands.Question)
            action = commands.Action(self._default, outcome.candidates[0])
            return Interpretation(found.sentence, None, actions=(action,))
        return of_outcome(outcome, found)

    def _interpret_instruction(
        self, sentence: str, scene: Scene, pointed: PointedObjects
    ) -> tuple[Interpretation, OpenQuestion | None]:
        """The interpretation by the instruction grammar, and the question that is open after it."""
        try:
            meaning = parse(sentence)
        except NotUnderstood as error:
            answer = self._interpret_answer(sentence, scene) if self._question else None
            return answer or (Interpretation(sentence, None, str(error), error.position), self._question)
        try:
            previous = self._question.command if self._question else self.previous
            held = self._held()
            spoken = self.spoken if held is None else (held, *self.spoken)
            gestures = pointed(count_gestures(meaning))
            return Interpretation(sentence, parse(sentence, scene, gestures, previous, spoken)), None
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


def _objects(found: Interpretation) -> tuple[int, ...]:
    """The objects of the last step that was understood, the one that is moved or acted on first."""
    if found.understood is not None:
        return found.understood.steps[-1].objects
    named = [(action.object, action.on) for action in found.actions[-1:]]
    return tuple(each for pair in named for each in pair if each is not None)


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


def _gestures(sentence: str, pointed: PointedObjects) -> Sequence[int]:
    """The objects of the gestures that the sentence needs; () where none was made."""
    count = sum(word.strip(".,!?") in (*POINTING, *HERE) for word in sentence.lower().split())
    try:
        return pointed(count) if count else ()
    except LanguageError:
        return ()


def _is_settled(found: Interpretation) -> bool:
    """Whether the instruction grammar understood the sentence, or knows what to ask."""
    return found.understood is not None or bool(found.candidates)


def of_outcome(outcome: commands.Outcome, failure: Interpretation) -> Interpretation:
    """The outcome of a sentence beyond the instruction grammar. failure: of the instruction grammar."""
    start = outcome.span[0]
    if isinstance(outcome, commands.Understood):
        notes = [*outcome.notes, *(SPEED for step in outcome.steps if step.kind in ("faster", "slower"))]
        return Interpretation(outcome.sentence, None, "; ".join(notes), actions=outcome.steps)
    if isinstance(outcome, commands.Question):
        return Interpretation(outcome.sentence, None, outcome.text, start, outcome.candidates)
    assert isinstance(outcome, commands.Refusal)
    return failure if outcome.reason == "syntax" else Interpretation(outcome.sentence, None, outcome.text, start)


def _failure(sentence: str, error: LanguageError) -> Interpretation:
    message = getattr(error, "question", "") or str(error)
    return Interpretation(sentence, None, message, getattr(error, "position", 0), getattr(error, "candidates", ()))

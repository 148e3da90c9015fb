"""Answers of the command line to a sentence: as a dict for JSON, and as text."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from typing import Any

from language.dialogue import Dialogue
from language.errors import NothingFits, NotUnderstood, SeveralFit
from language.instruction import Correction, Meaning, say
from language.outcomes import Answer as Told
from language.outcomes import Outcome, Plan, Question, Refusal, Signal, Step
from language.scene_file import NamedScene
from language.understanding import Understood, parse

ERRORS = {NotUnderstood: "syntax", NothingFits: "nothing", SeveralFit: "ambiguous"}
_CONTEXT = 60  # characters of the sentence shown before and after the position of an error

Answer = dict[str, Any]


class CommandLine:
    """Answers sentences about one scene in sequence; a correction revises the last understood instruction.

    previous: the last understood instruction, with its corrections; None before the first.
    """

    def __init__(self, named: NamedScene | None, pointed: Sequence[int] = ()) -> None:
        """Start the dialogue.

        named: the scene; None: sentences are parsed without a scene.
        pointed: the referent of each gesture, in order.
        """
        self._named, self._pointed = named, tuple(pointed)
        self.previous: Understood | None = None
        self._precise, self._wide = "", Dialogue()

    def answer(self, sentence: str) -> Answer:
        """Return the steps that the sentence asks for, or the error.

        A sentence outside the precise grammar is interpreted as a command that people write, if there is a scene.
        """
        try:
            answer = self._understood(sentence)
            self._precise = sentence
            return answer
        except (NotUnderstood, NothingFits, SeveralFit) as error:
            return self._widely(sentence, error)

    def _widely(self, sentence: str, error: NotUnderstood | NothingFits | SeveralFit) -> Answer:
        """Return the answer of the wide grammar, or the error of the precise one if that says more."""
        told = _error(error, self._named)
        if self._named is None or isinstance(error, SeveralFit):
            return told
        if self._precise:  # what the sentence may refer to
            self._wide.answer(self._precise, self._named.scene, self._pointed)
            self._precise = ""
        outcome = self._wide.answer(sentence, self._named.scene, self._pointed)
        answer = outcome_as_answer(outcome, self._named)
        if isinstance(outcome, Refusal) and outcome.reason == "syntax":
            return told | {key: answer[key] for key in ("outcome", "suggestions")}
        return answer if isinstance(error, NotUnderstood) or isinstance(outcome, Plan | Signal | Told) else told

    def _understood(self, sentence: str) -> Answer:
        if self._named is None:
            return _tree(parse(sentence))
        understood = parse(sentence, self._named.scene, self._pointed, self.previous)
        self.previous = understood
        return grounded(understood, self._named)


def outcome_as_answer(outcome: Outcome, named: NamedScene) -> Answer:
    """Return an outcome of people's words.

    "outcome" is "plan", "question", "refusal", "answer" or "control"; questions and refusals have "error", as other
    answers. "span" is the part of the sentence that it is about, in characters; "candidates" are ids of objects;
    "choices" are the steps that each answer to a question leads to; "suggestions" can be carried out.
    """
    unused = {"unused": list(outcome.unused)} if outcome.unused else {}
    if isinstance(outcome, Plan):
        notes = {"notes": list(outcome.notes)} if outcome.notes else {}
        steps = [_step(step, named) for step in outcome.steps]
        return {"outcome": "plan", "steps": steps, "confidence": outcome.confidence, **unused, **notes}
    if isinstance(outcome, Signal):
        return {"outcome": "control", "control": outcome.control, "steps": [_step(s, named) for s in outcome.steps]}
    if isinstance(outcome, Told):
        return {"outcome": "answer", "message": outcome.text, "steps": []}
    about = {"position": outcome.span[0], "span": list(outcome.span)}
    if isinstance(outcome, Question):
        names = [named.ids[index] for index in outcome.candidates]
        choices = [[_step(step, named) for step in choice.steps] for choice in outcome.choices]
        asked = {"outcome": "question", "error": "question", "message": outcome.text, **about}
        return {**asked, "candidates": names, "choices": choices, **unused}
    assert isinstance(outcome, Refusal)
    refused = {"outcome": "refusal", "error": outcome.reason, "message": outcome.text, **about, "candidates": []}
    return {**refused, "suggestions": list(outcome.suggestions), **unused}


def _step(step: Step, named: NamedScene) -> Answer:
    place = None if step.place is None else [round(x, 4) for x in step.place]
    height = None if step.bottom is None else round(step.bottom, 4)
    goal = named.id(step.goal)
    return {"verb": step.verb, "object": named.id(step.object), "goal": goal, "place": place, "height": height}


def grounded(understood: Understood, named: NamedScene) -> Answer:
    """Return the steps with the ids of their objects; the first step is repeated at the top level."""
    steps = [
        {
            "task": step.task,
            "init": named.id(step.init),
            "goal": named.id(step.goal),
            "reward": step.reward,
            "networks": step.networks,
        }
        for step in understood.steps
    ]
    return {**steps[0], "steps": steps}


def _tree(meaning: Meaning) -> Answer:
    """Return the steps with the phrases of their objects and places; without a scene these have no ids."""
    if isinstance(meaning, Correction):
        phrases = {"object": meaning.phrase, "place": meaning.goal, "rejected": meaning.rejected}
        return {"task": None, **{key: said and say(said) for key, said in phrases.items()}, "steps": []}
    steps = [
        {"task": step.task, "object": say(step.phrase), "place": step.goal and say(step.goal)} for step in meaning.steps
    ]
    return {**steps[0], "steps": steps}


def _error(error: NotUnderstood | NothingFits | SeveralFit, named: NamedScene | None) -> Answer:
    candidates = error.candidates if isinstance(error, SeveralFit) and named else ()
    answer = {
        "error": ERRORS[type(error)],
        "message": str(error),
        "position": error.position,
        "candidates": [named.ids[index] for index in candidates] if named else [],
    }
    return answer | ({"expected": list(error.expected)} if isinstance(error, NotUnderstood) else {})


def as_text(answer: Answer, understood: Understood | None) -> str:
    """Return the steps of an answer without error as lines, in the scene with the sentence of each step."""
    if "outcome" in answer:
        return _understood_as_text(answer)
    if not answer["steps"]:
        return f"correction: {_pairs(answer)}"
    if understood is None:
        return "\n".join(_pairs(step) for step in answer["steps"])
    both = zip(understood.instructions, answer["steps"], strict=True)
    return "\n".join(f"{say(instruction)}\n    {_pairs(step)}" for instruction, step in both)


def _understood_as_text(answer: Answer) -> str:
    """Return the steps of the wide grammar as lines."""
    if "confidence" not in answer:
        return answer.get("message") or f"control: {answer['control']}"
    lines = [f"understood, confidence {answer['confidence']:.2f}", *(f"    {_pairs(step)}" for step in answer["steps"])]
    lines += [f"not used: {', '.join(answer['unused'])}"] if "unused" in answer else []
    return "\n".join([*lines, *answer.get("notes", ())])


def _pairs(said: Answer) -> str:
    return ", ".join(f"{key} {value}" for key, value in said.items() if key != "steps" and value is not None)


def error_as_text(answer: Answer, sentence: str) -> str:
    """Return the sentence, carets under the part in question, the message, and candidates or suggestions."""
    kind = "question" if answer["error"] == "question" else "error"
    start, end = answer.get("span", (answer["position"],) * 2)
    lines = [*underlined(sentence, start, end), f"{kind}: {answer['message']}"]
    for key in ("candidates", "unused", "suggestions"):
        if answer.get(key):
            lines.append(f"{'not used' if key == 'unused' else key}: {', '.join(answer[key])}")
    return "\n".join(lines)


def underlined(sentence: str, position: int, end: int = 0) -> tuple[str, str]:
    """Return the sentence around the position, without control characters, and a line with carets under it.

    end: of what is underlined, in characters; at least the character at the position is.
    """
    start = max(0, position - _CONTEXT)
    before = [_printable(letter) for letter in sentence[start:position]]
    after = [_printable(letter) for letter in sentence[position : position + _CONTEXT]]
    opening = "..." if start else ""
    closing = "..." if position + _CONTEXT < len(sentence) else ""
    width = len(opening) + sum(map(_width, before))
    marked = sum(map(_width, after[: max(end - position, 1)]))
    return f"{opening}{''.join(before + after)}{closing}", " " * width + "^" * max(marked, 1)


def _printable(letter: str) -> str:
    if letter.isspace():
        return " "
    return letter if letter.isprintable() or unicodedata.combining(letter) else "\N{REPLACEMENT CHARACTER}"


def _width(letter: str) -> int:
    """The number of terminal columns that the character takes."""
    if unicodedata.combining(letter):
        return 0
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1

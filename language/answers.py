"""What the command line answers to a sentence: as a dict for JSON, and in lines that a person reads."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from typing import Any

from language.errors import NothingFits, NotUnderstood, SeveralFit
from language.instruction import Command, Correction, Meaning, say
from language.scene_file import NamedScene
from language.understanding import Understood, parse

ERRORS = {NotUnderstood: "syntax", NothingFits: "nothing", SeveralFit: "ambiguous"}
_SHOWN = 60  # characters of the sentence that are repeated before and after the place of an error

Answer = dict[str, Any]


class Dialogue:
    """Answers one sentence after another about the same scene; a correction revises the last one understood.

    named: None to check the words alone. pointed: the object that each gesture singles out, in their order.
    previous: the last instruction that was understood, as the correction left it.
    """

    def __init__(self, named: NamedScene | None, pointed: Sequence[int] = ()) -> None:
        self._named, self._pointed = named, tuple(pointed)
        self.previous: Understood | None = None

    def answer(self, sentence: str) -> Answer:
        """What the sentence asks for, or what is wrong with it."""
        try:
            return self._understood(sentence)
        except (NotUnderstood, NothingFits, SeveralFit) as error:
            return _error(error, self._named)

    def _understood(self, sentence: str) -> Answer:
        if self._named is None:
            return _tree(parse(sentence))
        understood = parse(sentence, self._named.scene, self._pointed, self.previous)
        self.previous = understood
        return grounded(understood, self._named)


def grounded(understood: Understood, named: NamedScene) -> Answer:
    """The steps with the ids of their objects; the first step stands at the top as well."""
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
    """The steps with the phrases for their objects and places, as nothing tells which objects these are."""
    if isinstance(meaning, Correction):
        words = {"object": meaning.phrase, "place": meaning.goal, "rejected": meaning.rejected}
        return {"task": None, **{key: said and say(said) for key, said in words.items()}, "steps": []}
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


def in_words(answer: Answer, command: Command | None) -> str:
    """The steps of an answer that is no error; each in plain words first, where the command is known."""
    if not answer["steps"]:
        return f"correction: {_pairs(answer)}"
    if command is None:
        return "\n".join(_pairs(step) for step in answer["steps"])
    both = zip(command.steps, answer["steps"], strict=True)
    return "\n".join(f"{say(instruction)}\n    {_pairs(step)}" for instruction, step in both)


def _pairs(said: Answer) -> str:
    return ", ".join(f"{key} {value}" for key, value in said.items() if key != "steps" and value is not None)


def error_in_words(answer: Answer, sentence: str) -> str:
    """The sentence, a caret under the place of the error, and the message."""
    lines = [*underlined(sentence, answer["position"]), f"error: {answer['message']}"]
    if answer["candidates"]:
        lines.append(f"candidates: {', '.join(answer['candidates'])}")
    return "\n".join(lines)


def underlined(sentence: str, position: int) -> tuple[str, str]:
    """The sentence around the position, with nothing that moves a cursor, and a line with a caret under it."""
    start = max(0, position - _SHOWN)
    before = [_printable(letter) for letter in sentence[start:position]]
    after = [_printable(letter) for letter in sentence[position : position + _SHOWN]]
    opening = "..." if start else ""
    closing = "..." if position + _SHOWN < len(sentence) else ""
    width = len(opening) + sum(map(_width, before))
    return f"{opening}{''.join(before + after)}{closing}", " " * width + "^"


def _printable(letter: str) -> str:
    if letter.isspace():
        return " "
    return letter if letter.isprintable() or unicodedata.combining(letter) else "\N{REPLACEMENT CHARACTER}"


def _width(letter: str) -> int:
    """Columns that the character takes."""
    if unicodedata.combining(letter):
        return 0
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1

"""From the children of each rule of the grammar to a meaning."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from operator import itemgetter
from typing import Any

from language.errors import LanguageError, NotUnderstood
from language.instruction import Chain, Correction, Instruction, Meaning, ObjectPhrase
from language.lexicon import Lexicon
from language.relations import RELATIONS


class MeaningBuilder:
    """Lark transformer that builds meanings during parsing.

    positioned: the categories whose words are kept with their position in the sentence.
    """

    def __init__(self, words: Lexicon, positioned: Sequence[str]) -> None:
        for category, meanings in words.categories.items():
            means = {form: meaning for meaning, forms in meanings.items() for form in forms}
            plain = category in positioned
            setattr(self, category, itemgetter(0) if plain else partial(self._meaning, means))
        self._spots = {form: word for word, forms in words.categories["spot"].items() for form in forms}
        for task in words.templates:
            setattr(self, f"task_{task}", partial(self._step, task))

    @staticmethod
    def _meaning(means: dict[str, Any], children: list) -> Any:
        return means[children[0]]

    @staticmethod
    def _step(task: str, children: list) -> Instruction:
        phrases = [child for child in children if isinstance(child, ObjectPhrase)]
        try:
            return Instruction(task, *phrases)
        except LanguageError as error:  # "every" where one object is meant
            raise NotUnderstood(str(error), phrases[0].position) from None

    def named(self, children: list) -> ObjectPhrase:
        determiner, superlative, size, role, color, noun, side, excluded, where = children
        relation, anchors = where or (None, ())
        if superlative is not None and side is not None:
            message = f"{superlative!r} and {side!r} are said of one object: say one of them"
            raise NotUnderstood(message, determiner.start_pos)
        side, position = superlative or side, determiner.start_pos
        return ObjectPhrase(noun, color, relation, anchors, size, role, side, excluded, str(determiner), position)

    def superlative_alone(self, children: list) -> ObjectPhrase:
        the, superlative, where = children
        relation, anchors = where or (None, ())
        return ObjectPhrase(None, None, relation, anchors, superlative=superlative, position=the.start_pos)

    def alone(self, children: list) -> ObjectPhrase:
        return ObjectPhrase(determiner=str(children[0]), position=children[0].start_pos)

    def not_color(self, children: list) -> ObjectPhrase:
        return ObjectPhrase(color=children[1])

    def not_size(self, children: list) -> ObjectPhrase:
        return ObjectPhrase(size=children[1])

    def not_role(self, children: list) -> ObjectPhrase:
        return ObjectPhrase(role=children[1])

    def not_noun(self, children: list) -> ObjectPhrase:
        excluding, _, size, role, color, noun = children
        if (size, role, color, noun) == (None,) * 4:
            raise NotUnderstood(
                "everything is an object: say a color or a shape that is not meant", excluding.start_pos
            )
        return ObjectPhrase(noun, color, size=size, role=role)

    def where(self, children: list) -> tuple[str, tuple[ObjectPhrase, ...]]:
        words = [child for child in children if not isinstance(child, ObjectPhrase)]
        relation = next(word for word in words if word in RELATIONS)
        return relation, tuple(child for child in children if isinstance(child, ObjectPhrase))

    def object(self, children: list) -> ObjectPhrase:
        last = children[-1]
        if isinstance(last, ObjectPhrase):
            return last
        return ObjectPhrase(determiner=self._spots[last], position=last.start_pos)

    goal = base = object

    def corrected_phrase(self, children: list) -> Correction:
        return Correction(children[0])

    def corrected_goal(self, children: list) -> Correction:
        return Correction(goal=children[0])

    def rejection(self, children: list) -> Correction:
        rejected, meant = (child for child in children if isinstance(child, ObjectPhrase))
        return Correction(meant, rejected=rejected)

    def chain(self, children: list) -> Instruction | Chain:
        steps = [step for child in children if isinstance(child, Instruction | Chain) for step in child.steps]
        return steps[0] if len(steps) == 1 else Chain(tuple(steps))

    def start(self, children: list) -> Meaning:
        return next(child for child in children if isinstance(child, Instruction | Chain | Correction))

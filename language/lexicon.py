"""All the words there are, read from the registries as they stand now; how a sentence falls into words."""

from __future__ import annotations

import re
from typing import NamedTuple

from language.colors import COLORS
from language.errors import NotUnderstood
from language.objects import ANY_NOUN, NOUNS
from language.relations import RELATIONS
from language.templates import POLITE, SLOT, TEMPLATES

LONGEST_SENTENCE = 1000  # characters; what is longer is no instruction, and is refused before any work

# What is meant, and the phrases that mean it, ours first.
Meanings = tuple[tuple[str | None, tuple[str, ...]], ...]

_WORD_OR_MARK = re.compile(r"\w+|[^\w\s]")


class Lexicon(NamedTuple):
    """What can be meant and how it can be said. Hashable: what is built from it can be kept beside it."""

    tasks: Meanings
    colors: Meanings
    nouns: Meanings
    relations: Meanings
    polite: tuple[str, ...]

    def words(self) -> tuple[str, ...]:
        """Every word once, in the order of the registries."""
        phrases = ["the", *self.polite]
        for meanings in (self.tasks, self.colors, self.nouns, self.relations):
            phrases += [phrase for _, forms in meanings for phrase in forms]
        return tuple(dict.fromkeys(word for phrase in phrases for word in phrase.split() if word != SLOT))


class Word(NamedTuple):
    """A word in lower case, or a single mark, and its offset in the sentence in characters from 0."""

    text: str
    position: int


def lexicon() -> Lexicon:
    """The registries as they stand now."""
    return Lexicon(
        tasks=tuple(TEMPLATES.items()),
        colors=tuple((name, (name,)) for name in COLORS),
        nouns=((None, ANY_NOUN), *((noun, (noun, *synonyms)) for noun, synonyms in NOUNS.items())),
        relations=tuple((known.phrase, (known.phrase, *known.synonyms)) for known in RELATIONS.values()),
        polite=POLITE,
    )


def split(sentence: str) -> list[Word]:
    """The sentence's words and marks. Raises NotUnderstood where it is longer than LONGEST_SENTENCE."""
    if len(sentence) > LONGEST_SENTENCE:
        message = f"the sentence has {len(sentence)} characters; at most {LONGEST_SENTENCE} are read"
        raise NotUnderstood(message, LONGEST_SENTENCE)
    return [Word(found.group().lower(), found.start()) for found in _WORD_OR_MARK.finditer(sentence)]

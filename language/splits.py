"""Held-out words and pairs of words, which measure generalisation: declared in YAML, enforced by the generator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.lexicon import lexicon
from language.objects import NOUNS, Scene
from language.relations import RELATIONS, Relation
from language.verbs import VERBS

SPLITS = ("all", "train", "test_composition", "test_paraphrase", "test_length")


@dataclass(frozen=True)
class HeldOut:
    """Words and pairs of words that the split "train" never contains.

    color_noun: pairs such as ("red", "cube"), in one phrase, of the referent or of an anchor.
    relation_noun: pairs such as ("left of", "cube"), a relation of an object that is named by this noun.
    phrases: synonyms and templates ("ball", "to the left of", "touch {object}"), never the first of their meaning.

    Raises LanguageError for words that are not in the registries.
    """

    color_noun: tuple[tuple[str, str], ...] = ()
    relation_noun: tuple[tuple[str, str], ...] = ()
    phrases: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for color, noun in self.color_noun:
            check_known("color", color, COLORS)
            check_known("noun", noun, NOUNS)
        for relation, noun in self.relation_noun:
            check_known("relation", relation, RELATIONS)
            check_known("noun", noun, NOUNS)
        spoken = _spoken() if self.phrases else {}
        for phrase in self.phrases:
            check_known("phrase", phrase, spoken)
            if spoken[phrase] == 0:
                raise LanguageError(
                    f"{phrase!r} is the standard phrase, which training always needs: hold out a synonym of it"
                )


@dataclass(frozen=True)
class Split:
    """A part of the language.

    name: one of SPLITS:
        all: everything.
        train: nothing that is held out.
        test_length: nothing that is held out; used with longer phrases than in training.
        test_composition: always a held-out pair.
        test_paraphrase: always a held-out phrase, never a held-out pair.
    held_out: what "train" leaves out.

    Raises LanguageError for an unknown name, and for a test split without anything held out.
    """

    name: str = "all"
    held_out: HeldOut = HeldOut()

    def __post_init__(self) -> None:
        check_known("split", self.name, SPLITS)
        if self.name == "test_composition" and not (self.held_out.color_noun or self.held_out.relation_noun):
            raise LanguageError("split=test_composition needs color_noun or relation_noun pairs that are held out")
        if self.name == "test_paraphrase" and not self.held_out.phrases:
            raise LanguageError("split=test_paraphrase needs phrases that are held out")

    def keep(self, named: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Return which expressions belong to the split.

        Args:
            named: bool array, whether an expression exists.
            held: bool array that broadcasts with `named`, whether it contains a held-out pair.
        """
        if self.name == "all":
            return named
        return named & held if self.name == "test_composition" else named & ~held

    def avoid(self, named: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Like `keep`, for expressions in which another part may contain the pair that test_composition requires."""
        return named if self.name in ("all", "test_composition") else named & ~held

    def held_heads(self, scene: Scene, both: np.ndarray) -> np.ndarray:
        """Return (H, K) bool: whether a head contains a held-out pair.

        both: (H,), whether the head contains both colour and noun.
        """
        return both[:, None] & self._pairs[scene.colors, scene.nouns]

    def held_relations(self, scene: Scene, says_noun: np.ndarray, relations: Sequence[Relation]) -> np.ndarray:
        """Return (H, K, R) bool: whether head and relation form a held-out pair.

        says_noun: (H,), whether the head contains the noun.
        """
        table = np.zeros((len(NOUNS), len(relations)), dtype=bool)
        for relation, noun in self.held_out.relation_noun:
            table[list(NOUNS).index(noun)] |= [known.phrase == relation for known in relations]
        return says_noun[:, None, None] & table[scene.nouns]

    @property
    def _pairs(self) -> np.ndarray:
        pairs = np.zeros((len(COLORS), len(NOUNS)), dtype=bool)
        for color, noun in self.held_out.color_noun:
            pairs[list(COLORS).index(color), list(NOUNS).index(noun)] = True
        return pairs


def _spoken() -> dict[str, int]:
    """Return every phrase with its index among the phrases of the same meaning."""
    by_meaning = [forms for meanings in lexicon().categories.values() for forms in meanings.values()]
    by_meaning += [lexicon().forms("task", (task, has_goal)) for task in VERBS for has_goal in (False, True)]
    return {phrase: place for forms in by_meaning for place, phrase in enumerate(forms)}

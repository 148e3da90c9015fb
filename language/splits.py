"""What is kept out of training, so that generalisation can be measured: declared in YAML, held by the generator."""

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
    """What "train" never says.

    color_noun: pairs ("red", "cube"): the two words of one phrase, of the referent or of an anchor.
    relation_noun: pairs ("left of", "cube"): the relation of a thing that is called by this noun.
    phrases: synonyms and templates ("ball", "to the left of", "touch {object}"); never the first of their kind.
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
                raise LanguageError(f"{phrase!r} is the only phrase that is sure to be known: hold out a synonym of it")


@dataclass(frozen=True)
class Split:
    """One part of what can be said: a name of SPLITS, and what "train" leaves to the others.

    all: everything. train, test_length: nothing that is held out; test_length is asked for longer phrases.
    test_composition: always a held-out pair. test_paraphrase: always a held-out phrase, never a held-out pair.
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
        """Those expressions that the split says; held: whether one holds a pair. Bool arrays that broadcast."""
        if self.name == "all":
            return named
        return named & held if self.name == "test_composition" else named & ~held

    def avoid(self, named: np.ndarray, held: np.ndarray) -> np.ndarray:
        """The same for expressions of which a part may hold the pair that test_composition asks for."""
        return named if self.name in ("all", "test_composition") else named & ~held

    def held_heads(self, scene: Scene, both: np.ndarray) -> np.ndarray:
        """(H, K) bool: the head, where it says both (H,) colour and noun, says a held-out pair."""
        return both[:, None] & self._pairs[scene.colors, scene.nouns]

    def held_relations(self, scene: Scene, says_noun: np.ndarray, relations: Sequence[Relation]) -> np.ndarray:
        """(H, K, R) bool: the relation of a head that says the noun, where says_noun (H,), is a held-out pair."""
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
    """Every phrase with its place among those that say the same."""
    by_meaning = [forms for meanings in lexicon().categories.values() for forms in meanings.values()]
    by_meaning += [lexicon().forms("task", (task, has_goal)) for task in VERBS for has_goal in (False, True)]
    return {phrase: place for forms in by_meaning for place, phrase in enumerate(forms)}

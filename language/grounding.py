"""Grounding: which objects of a scene a phrase fits, and which single object it refers to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from language.colors import COLORS
from language.errors import LanguageError, NothingFits, SeveralFit, listed, shorten
from language.instruction import Instruction, ObjectPhrase
from language.objects import NOUNS, SIZES, Object, Scene
from language.relations import ABSENT, HOLDS, RELATIONS, SUPERLATIVES
from language.verbs import EVERY


def matches(phrase: ObjectPhrase, scene: Scene, pointed: Sequence[int] = ()) -> np.ndarray:
    """Return (K,) bool: which objects of the scene the phrase fits.

    Args:
        phrase: the phrase.
        scene: K objects.
        pointed: the object of each gesture, in the order of the words that need one. If there are more such words
            than gestures, the last gesture serves for the rest.

    Raises:
        NothingFits, SeveralFit: the phrase of an anchor fits no object or several.
    """
    return PhraseResolver(scene, pointed).fits(phrase)


def ground(instruction: Instruction, scene: Scene, pointed: Sequence[int] = ()) -> int:
    """Return the index of the one object that the instruction's phrase fits. Raises NothingFits or SeveralFit."""
    return PhraseResolver(scene, pointed).resolve(instruction.phrase)


class PhraseResolver:
    """Resolves the phrases of a sentence in order, so that gestures are matched to their words.

    Attributes:
        scene: the scene; assign it to resolve later steps in a later scene.
        it: the object that "it" refers to, or None.
    """

    def __init__(self, scene: Scene, pointed: Sequence[int] = (), it: int | None = None) -> None:
        self.scene, self.it = scene, it
        self._gestures = list(pointed)
        self._contradicted: int | None = None  # the object of a gesture that the words do not fit
        if not all(0 <= shown < len(scene) for shown in self._gestures):
            raise LanguageError(f"pointed={self._gestures} is out of range: the scene has {len(scene)} objects")

    def resolve(self, phrase: ObjectPhrase, among: np.ndarray | None = None) -> int:
        """Return the index of the one object that the phrase fits.

        Args:
            phrase: to resolve.
            among: (K,) bool, the objects that are considered; None: all.

        Raises:
            NothingFits, SeveralFit: the phrase fits no object, or several.
        """
        fits = self.fits(phrase, among)
        candidates = fits.nonzero()[0].tolist()
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            raise self._several(phrase, candidates)
        raise self._nothing(phrase, among)

    def resolve_all(self, phrase: ObjectPhrase, among: np.ndarray | None = None) -> list[int]:
        """Return the indices of all objects that the phrase fits, at least one. Raises NothingFits.

        among: (K,) bool, the objects that are considered; None: all.
        """
        candidates = self.fits(phrase, among).nonzero()[0].tolist()
        if candidates:
            return candidates
        raise self._nothing(phrase, among)

    def fits(self, phrase: ObjectPhrase, among: np.ndarray | None = None) -> np.ndarray:
        """Return (K,) bool: which objects the phrase fits, of those in `among`."""
        fits = self._head(phrase)
        if among is not None:
            fits &= among
        if phrase.determiner not in ("the", EVERY):
            shown = self._shown(phrase)
            self._contradicted = None if fits[shown] else shown
            fits &= np.arange(len(self.scene)) == shown
        if phrase.relation is not None:
            anchors = [self.resolve(anchor) for anchor in phrase.anchors]
            fits = self._related(phrase.relation, fits, anchors)
        if phrase.superlative is not None:
            fits = self._superlative(phrase.superlative, fits)
        return fits

    def _head(self, phrase: ObjectPhrase) -> np.ndarray:
        scene = self.scene
        fits = np.ones(len(scene), dtype=bool)
        if phrase.noun is not None:
            fits &= scene.nouns == list(NOUNS).index(phrase.noun)
        if phrase.color is not None:
            fits &= scene.colors == list(COLORS).index(phrase.color)
        if phrase.size is not None:
            size = SIZES[phrase.size]
            fits &= (scene.sizes > size.low) & (scene.sizes < size.high)
        if phrase.role is not None:
            fits &= scene.targets == (phrase.role == "target")
        if phrase.excluded is not None:
            fits &= ~self._head(phrase.excluded)
        return fits

    def _shown(self, phrase: ObjectPhrase) -> int:
        """Return the object that "it" or a gesture refers to."""
        if phrase.determiner == "it":
            if self.it is None:
                raise NothingFits("'it' refers to nothing: no object was named before", "it", phrase.position)
            return self.it
        if not self._gestures:
            message = f"'{phrase}' needs a gesture that shows which one; point at it, or name it"
            raise NothingFits(message, phrase.determiner, phrase.position)
        return self._gestures.pop(0) if len(self._gestures) > 1 else self._gestures[0]

    def _related(self, name: str, fits: np.ndarray, anchors: list[int]) -> np.ndarray:
        known, seen = RELATIONS[name], self.scene.seen
        margin = known.margin(seen, *(seen[anchor] for anchor in anchors))
        fits[anchors] = False  # no object is its own referent, whatever the relation's function returns
        if len(set(anchors)) < known.anchors:
            return np.zeros_like(fits)  # two anchors must be different objects
        return _best(fits, margin, ABSENT) if known.best else fits & (margin > HOLDS)

    def _superlative(self, name: str, fits: np.ndarray) -> np.ndarray:
        known = SUPERLATIVES[name]
        return _best(fits, known.score(self.scene.seen, self.scene.sizes), known.tie)

    def _several(self, phrase: ObjectPhrase, candidates: list[int]) -> SeveralFit:
        from language.describing import question

        asked = question(self.scene, candidates)
        message = f"'{shorten(str(phrase))}' may be any of {len(candidates)}. {asked}"
        return SeveralFit(message, tuple(candidates), phrase.position, asked)

    def _nothing(self, phrase: ObjectPhrase, among: np.ndarray | None) -> NothingFits:
        part = self._failing_part(phrase, among)
        things = list(self.scene)
        present = listed([f"a {thing_words(thing)}" for thing in things]) or "nothing at all"
        said = shorten(str(phrase))
        if self._contradicted is not None:
            shown = f"the gesture shows the {thing_words(things[self._contradicted])}"
            unmovable = among is not None and not among[self._contradicted]
            why = ", which only marks a place and cannot be moved" if unmovable else ""
            return NothingFits(f"nothing fits '{said}': {shown}{why}", part, phrase.position)
        hint = _suggestion(phrase, [t for k, t in enumerate(things) if among is None or among[k]])
        message = f"nothing fits '{said}': there is no {shorten(part)}{hint}; there is {present}"
        return NothingFits(message, part, phrase.position)

    def _failing_part(self, phrase: ObjectPhrase, among: np.ndarray | None) -> str:
        """Return the fewest words of the phrase that no object fits."""
        parts = (
            ObjectPhrase(color=phrase.color),
            ObjectPhrase(noun=phrase.noun),
            ObjectPhrase(phrase.noun, phrase.color),
            ObjectPhrase(phrase.noun, phrase.color, size=phrase.size),
            ObjectPhrase(phrase.noun, phrase.color, size=phrase.size, role=phrase.role),
        )
        for part in parts:
            if not self._head(part).any():
                return part.label
        if among is not None and not (self._head(phrase) & among).any():
            return f"{phrase.label} that can be moved"
        return str(phrase).partition(" ")[2] or str(phrase)


def thing_words(thing: Object) -> str:
    """Return an object's role, colour and noun: "transparent red cube"."""
    return ObjectPhrase(thing.noun, thing.color, role="target" if thing.role == "target" else None).label


def _best(fits: np.ndarray, score: np.ndarray, tie: float) -> np.ndarray:
    """Return a mask of the fitting objects whose score is within `tie` of the greatest."""
    score = np.where(fits, score, -np.inf)
    return fits & (score >= score.max(initial=-np.inf) - tie)


def _suggestion(phrase: ObjectPhrase, things: list[Object]) -> str:
    """Return a question about the objects that share most words with the phrase.

    Return "" if none shares a word, or one shares all of them.
    """
    shared = [(phrase.noun == thing.noun) + (phrase.color == thing.color) for thing in things]
    most, said = max(shared, default=0), (phrase.noun is not None) + (phrase.color is not None)
    if most in (0, said):
        return ""
    near = dict.fromkeys(f"the {thing_words(t)}" for t, n in zip(things, shared, strict=True) if n == most)
    return f" (did you mean {' or '.join(list(near)[:3])}?)"

"""Which words to choose: the sentences of a task, and the plain name of a thing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from language.errors import LanguageError, check_known, listed
from language.generator import KINDS, ReferringExpressions
from language.instruction import Instruction, ObjectPhrase
from language.objects import Object, Scene
from language.splits import Split

DEFAULT_KINDS = ("color", "shape", "color_shape", "relation")  # the kinds that are said where nobody chooses
MAX_NAMED_OBJECTS = (
    24  # objects: in a larger scene nobody is told apart by relations, which take time that grows with its cube
)
_PREFERRED = ("color_shape", "shape", "color", "size", "superlative", "relation", "negation")


class Describer:
    """Draws phrases of the allowed kinds, each of which names exactly one object.

    kinds: some of KINDS. split: what may be said of all that. redundant: more words are said even of what has a name
    without them. Raises LanguageError for an unknown kind, or none.
    """

    def __init__(
        self, kinds: Sequence[str] = DEFAULT_KINDS, split: Split | None = None, redundant: bool = False
    ) -> None:
        for kind in kinds:
            check_known("kind of instruction", kind, KINDS)
        if not kinds:
            raise LanguageError(f"kinds is empty; choose from {', '.join(KINDS)}")
        self.kinds = tuple(dict.fromkeys(kinds))
        self.split, self._redundant = split or Split(), redundant
        self._expressions: ReferringExpressions | None = None

    def nameable(self, scene: Scene) -> np.ndarray:
        """(K,) bool, which objects some allowed kind of phrase names uniquely."""
        expressions = self.expressions(scene)
        named = np.zeros(len(scene), dtype=bool)
        for kind in self.kinds:
            if not named.all():
                named |= expressions.names(kind)
        return named

    def describe(self, scene: Scene, referent: int, rng: np.random.Generator, task: str = "reach") -> Instruction:
        """An instruction, of a task without a goal, that names the referent alone. Raises LanguageError."""
        return Instruction(task, self.phrase(scene, referent, rng))

    def phrase(self, scene: Scene, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        """A phrase that names the referent alone.

        A kind is drawn among those that can name it, then one of its expressions, both uniformly. Raises
        LanguageError where no allowed kind can.
        """
        expressions = self.expressions(scene)
        for number in rng.permutation(len(self.kinds)):  # the first that can: only so many kinds are worked out
            if expressions.names(self.kinds[number])[referent]:
                return expressions.draw(self.kinds[number], referent, rng)
        thing = scene[referent]
        raise LanguageError(
            f"no {' or '.join(self.kinds)} names the {thing.color} {thing.noun}, object {referent}, alone"
        )

    def expressions(self, scene: Scene) -> ReferringExpressions:
        """All that can be said of the scene."""
        if self._expressions is None or self._expressions.scene is not scene:  # one look serves several questions
            self._expressions = ReferringExpressions(scene, self.split, self._redundant)
        return self._expressions


def describe(thing: Object | int, scene: Scene) -> str:
    """The plainest name that the object, or the object of this index, has to itself: "the red cube".

    Raises LanguageError where the scene lacks it, or where no words tell it from its like.
    """
    return str(plain_name(_index(thing, scene), ReferringExpressions(scene, Split())))


def plain_name(index: int, expressions: ReferringExpressions) -> ObjectPhrase:
    """The first phrase of the plainest kind that names the object alone. Raises LanguageError."""
    for kind in _PREFERRED:
        for phrase in expressions.all(kind, index):
            return phrase
    thing = expressions.scene[index]
    raise LanguageError(f"no words tell the {thing.color} {thing.noun}, object {index}, from its like")


def question(scene: Scene, candidates: Sequence[int]) -> str:
    """What would settle which of the candidates is meant: "Do you mean the red cube or the one left of it?"."""
    return f"Do you mean {listed(distinguishing_names(scene, candidates), ' or ')}?"


def distinguishing_names(scene: Scene, candidates: Sequence[int]) -> list[str]:
    """A name for each candidate; with its place in metres where words alone do not tell it apart."""
    if len(scene) > MAX_NAMED_OBJECTS:
        return [_placed(scene, index) for index in candidates]
    expressions = ReferringExpressions(scene, Split())
    names: list[str] = []
    for index in candidates:
        try:
            names.append(str(plain_name(index, expressions)))
        except LanguageError:
            names.append(_placed(scene, index))
    return names


def _placed(scene: Scene, index: int) -> str:
    thing = scene[index]
    x, y, z = thing.position
    return f"the {thing.color} {thing.noun} at ({x:.2f}, {y:.2f}, {z:.2f})"


def _index(thing: Object | int, scene: Scene) -> int:
    if isinstance(thing, Object):
        for index, other in enumerate(scene):
            if other == thing:
                return index
        raise LanguageError(f"the {thing.color} {thing.noun} at {thing.position} is not in the scene")
    if not 0 <= thing < len(scene):
        raise LanguageError(f"object {thing} is out of range: the scene has {len(scene)} objects")
    return thing

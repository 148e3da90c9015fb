"""From an object of a scene to a sentence that names it and nothing else.

Everything is worked out for all objects at once, as arrays: an environment asks at every reset. Their axes
are called h (one of four heads), r (a relation), i (the referent), j (the anchor), k (any object).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from language.colors import COLORS
from language.errors import LanguageError, check_known
from language.instruction import Instruction, ObjectPhrase
from language.objects import NOUNS, Scene
from language.relations import RELATIONS, Relation

KINDS = ("color", "shape", "color_shape", "relation")

CLEAR = 0.05  # metres: a relation is said of an object only beyond this margin ...
ABSENT = 0.01  # ... and only while everything else it could be taken for stays below this one

# The four heads by whether they say noun and colour: "object", "color object", "noun", "color noun".
_SAYS_NOUN = (False, False, True, True)
_SAYS_COLOR = (False, True, False, True)
_PLAIN_KINDS = {"color": 1, "shape": 2, "color_shape": 3}  # each kind's place among the heads


class _View:
    """A scene, as far as names go."""

    def __init__(self, scene: Scene, relations: Sequence[Relation]) -> None:
        self.scene = scene
        self._relations = relations
        count = len(scene)
        self.heads = np.ones((4, count, count), dtype=np.float32)  # h, i, k: the head made for i fits k
        self.heads[1] = scene.colors[:, None] == scene.colors
        self.heads[2] = scene.nouns[:, None] == scene.nouns
        np.multiply(self.heads[1], self.heads[2], out=self.heads[3])
        self.sharing = self.heads.sum(axis=2)  # h, i: how many objects the head fits
        self.unique = self.sharing == 1  # h, i

    @cached_property
    def by_relation(self) -> np.ndarray:
        """(h, r, i, j) bool: "head of i, relation, j" names i clearly, and the head alone would not."""
        positions = self.scene.positions
        margins = np.array([known.margin(positions[:, None], positions) for known in self._relations])
        diagonal = np.arange(len(positions))
        margins[:, diagonal, diagonal] = -np.inf  # r, i, j; nothing is beside itself
        possible = (margins >= ABSENT).astype(np.float32)
        fitting = self.heads[:, None] @ possible  # h, r, i, j: a count, i included where clear
        names = (fitting == 1) & (margins > CLEAR)
        names &= (self.sharing > 1)[:, None, :, None]
        names &= self.unique[3]  # an anchor has a name of its own
        return names


class Describer:
    """Draws sentences of the allowed kinds, each of which names exactly one object.

    kinds: some of KINDS. The registries are read now: what is registered later is not said.
    Raises LanguageError for an unknown kind, or none.
    """

    def __init__(self, kinds: Sequence[str] = KINDS) -> None:
        for kind in kinds:
            check_known("kind of instruction", kind, KINDS)
        if not kinds:
            raise LanguageError(f"kinds is empty; choose from {', '.join(KINDS)}")
        self.kinds = tuple(dict.fromkeys(kinds))
        self._plain = [_PLAIN_KINDS[kind] for kind in self.kinds if kind != "relation"]
        self._relations = tuple(RELATIONS.values()) if "relation" in self.kinds else ()
        self._nouns, self._colors = list(NOUNS), list(COLORS)
        self._view: _View | None = None

    def nameable(self, scene: Scene) -> np.ndarray:
        """(K,) bool, which objects some allowed kind of phrase names uniquely."""
        view = self._look(scene)
        named = view.unique[self._plain].any(axis=0)
        if self._relations and not named.all():
            named |= view.by_relation.any(axis=(0, 1, 3))
        return named

    def describe(self, scene: Scene, referent: int, rng: np.random.Generator, task: str = "reach") -> Instruction:
        """An instruction that names the referent alone.

        A kind is drawn among those that can name it, then one of its expressions, both uniformly. Raises
        LanguageError where no allowed kind can.
        """
        view = self._look(scene)
        possible = [kind for kind in self.kinds if self._can(kind, view, referent)]
        if not possible:
            thing = scene[referent]
            raise LanguageError(
                f"no {' or '.join(self.kinds)} names the {thing.color} {thing.noun}, object {referent}, alone"
            )
        kind = possible[rng.integers(len(possible))]
        if kind == "relation":
            return Instruction(task, self._related(view, referent, rng))
        return Instruction(task, self._name(scene, referent, _PLAIN_KINDS[kind]))

    def _look(self, scene: Scene) -> _View:
        if self._view is None or self._view.scene is not scene:  # `nameable` and `describe` share one look
            self._view = _View(scene, self._relations)
        return self._view

    def _can(self, kind: str, view: _View, referent: int) -> bool:
        if kind == "relation":
            return bool(self._relations) and bool(view.by_relation[:, :, referent].any())
        return bool(view.unique[_PLAIN_KINDS[kind], referent])

    def _related(self, view: _View, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        # h, r, j, and the heads that name the anchor
        names = view.by_relation[:, :, referent, :, None] & view.unique[1:].T
        expressions = np.flatnonzero(names)
        drawn = expressions[rng.integers(len(expressions))]
        head, relation, anchor, anchor_head = np.unravel_index(drawn, names.shape)
        said = self._name(view.scene, referent, head)
        seen_from = self._name(view.scene, anchor, anchor_head + 1)
        return ObjectPhrase(said.noun, said.color, self._relations[relation].phrase, seen_from)

    def _name(self, scene: Scene, index: int, head: int) -> ObjectPhrase:
        noun = self._nouns[scene.nouns[index]] if _SAYS_NOUN[head] else None
        color = self._colors[scene.colors[index]] if _SAYS_COLOR[head] else None
        return ObjectPhrase(noun, color)

"""Generation of referring expressions: phrases that fit one object of a scene and no other.

Everything is computed for all objects at once, as arrays, since an environment needs it at every reset. The axes of
the arrays are named in the docstrings:
    h  the head: which of noun, colour, size and role are said
    r  the relation; s  the superlative; e  the excluded property
    i  the referent; j, l  the anchors; k  any object
    a, b  the heads of the anchors
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from language.colors import COLORS
from language.errors import LanguageError
from language.instruction import ObjectPhrase
from language.objects import NOUNS, ROLES, SIZES, Scene
from language.relations import ABSENT, CLEAR, RELATIONS, SUPERLATIVES
from language.splits import Split

KINDS = ("color", "shape", "color_shape", "size", "superlative", "negation", "relation", "nested")
MAX_DEPTH = 3  # nested relations in a generated phrase

# Heads are numbered by bits for colour, noun, size and role: "object", "color object", "noun", "color noun", ...
_COLOR, _NOUN, _SIZE, _ROLE = ((np.arange(16) >> bit) % 2 == 1 for bit in range(4))
_HEADS_OF_KIND = {"color": (1, 9), "shape": (2, 10), "color_shape": (3, 11), "size": (4, 5, 6, 7, 12, 13, 14, 15)}
_ANCHOR_HEADS = slice(1, 4)  # heads of phrases for anchors


class ReferringExpressions:
    """All expressions that fit exactly one object of a scene, as a bool array per kind.

    Attributes (axes as in the module's docstring):
        scene: the scene.
        heads: (h, i, k), whether the head made for i fits k.
        sharing: (h, i), how many objects the head fits.
        unique: (h, i), whether the head fits i alone.
        held: (h, i), whether the split holds the head's pair of words out.
    """

    def __init__(self, scene: Scene, split: Split, redundant: bool = False) -> None:
        """Compute the heads.

        redundant: whether relations, superlatives and negations are added to heads that are unique without them.
        """
        self.scene, self._split = scene, split
        self._relations = [known for known in RELATIONS.values() if known.anchors == 1]
        self._betweens = [known for known in RELATIONS.values() if known.anchors == 2]
        self._superlatives = list(SUPERLATIVES.values())
        self._named: dict[str, np.ndarray] = {}
        self._by_depth: dict[int, np.ndarray] = {}
        heads = head_matches(scene)
        count = len(heads)
        self._noun, self._color, self._size, self._role = _NOUN[:count], _COLOR[:count], _SIZE[:count], _ROLE[:count]
        self.heads = heads
        self.sharing = heads.sum(axis=2)
        self.unique = self.sharing == 1
        self._extendable = self.sharing > (0 if redundant else 1)  # h, i: whether more words may be added
        self.held = split.held_heads(scene, self._noun & self._color)

    def arrays(self, kind: str) -> list[np.ndarray]:
        """Return the kind's arrays, masked by the split; their second axis is i."""
        if kind in _HEADS_OF_KIND:
            return self._heads_alone(kind)
        return getattr(self, kind)

    def names(self, kind: str) -> np.ndarray:
        """Return (K,) bool: which objects have an expression of this kind."""
        if kind not in self._named:
            arrays = self.arrays(kind)
            self._named[kind] = np.any([array.any(axis=(0, *range(2, array.ndim))) for array in arrays], axis=0)
        return self._named[kind]

    def draw(self, kind: str, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        """Return a random expression of the kind for the referent: first its word, then its anchors, each uniformly.

        Raises LanguageError if there is none.
        """
        if kind == "nested":
            return self.draw_nested(2, referent, rng)
        arrays = [array[:, referent] for array in self.arrays(kind)]
        if kind in _HEADS_OF_KIND:
            arrays = [array[:, None] for array in arrays]
        words = [(number, word) for number, array in enumerate(arrays) for word in _available_words(array)]
        if not words:
            raise LanguageError(f"no {kind} names object {referent} alone")
        number, word = words[rng.integers(len(words))]
        places = np.argwhere(arrays[number][:, word])
        head, *rest = places[rng.integers(len(places))].tolist()
        return self.phrase(kind, number, referent, (head, word, *rest))

    def all(self, kind: str, referent: int) -> Iterator[ObjectPhrase]:
        """Yield every expression of the kind for the referent, those with colour and noun first."""
        if kind == "nested":
            yield from self._all_nested(referent)
            return
        for number, array in enumerate(self.arrays(kind)):
            places = np.argwhere(array[:, referent]).tolist()
            for place in places if kind in _HEADS_OF_KIND else sorted(places, key=_head_rank):
                yield self.phrase(kind, number, referent, tuple(place))

    def phrase(self, kind: str, number: int, referent: int, place: tuple[int, ...]) -> ObjectPhrase:
        """Return the expression at an index of array `number` of the kind; the index omits the referent's axis."""
        if kind == "superlative":
            return self.head(place[0], referent, superlative=self._superlatives[place[1]].phrase)
        if kind == "negation":
            return self.head(place[0], referent, excluded=_excludable()[place[1]])
        if kind == "relation":
            known = (self._relations, self._betweens)[number][place[1]]
            count = known.anchors
            anchors = zip(place[2 : 2 + count], place[2 + count :], strict=True)
            named = tuple(self.head(head + _ANCHOR_HEADS.start, anchor) for anchor, head in anchors)
            return self.head(place[0], referent, relation=known.phrase, anchors=named)
        return self.head(_HEADS_OF_KIND[kind][place[0]], referent)

    def head(self, number: int, index: int, **more) -> ObjectPhrase:
        """Return the phrase of head `number` for an object; more: further fields of the phrase."""
        thing = self.scene
        return ObjectPhrase(
            noun=list(NOUNS)[thing.nouns[index]] if self._noun[number] else None,
            color=list(COLORS)[thing.colors[index]] if self._color[number] else None,
            size=size_words(thing)[index] if self._size[number] else None,
            role=ROLES[int(thing.targets[index])] if self._role[number] else None,
            **more,
        )

    def _heads_alone(self, kind: str) -> list[np.ndarray]:
        """Axes h, i, with h over the kind's own heads: whether the head alone fits only i."""
        heads = [head for head in _HEADS_OF_KIND[kind] if head < len(self.heads)]
        return [self._split.keep(self.unique[heads], self.held[heads])]

    @cached_property
    def superlative(self) -> list[np.ndarray]:
        """Axes h, i, s: whether i clearly leads among the objects that its head fits."""
        scene = self.scene
        score = np.array([known.score(scene.seen, scene.sizes) for known in self._superlatives])  # s, i
        clear = np.array([known.clear for known in self._superlatives])
        lead = self._lead(score[:, :, None], self.heads)[..., 0]  # h, i, s
        return [self._split.keep((lead > clear) & self._extendable[..., None], self.held[..., None])]

    def _lead(self, score: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Return (h, i, s, j), the lead of i over all other objects that its head fits.

        score: (s, k, j). heads: (h, i, k).
        """
        rivals = heads.copy()
        everyone = np.arange(len(self.scene))
        rivals[:, everyone, everyone] = 0
        score = np.where(np.isfinite(score), score, -1e9)
        beaten = np.where(rivals[:, :, None, :, None] > 0, score, -1e9).max(axis=3)
        own = np.moveaxis(score, 0, 1)  # i, s, j
        return own - np.where(beaten <= -1e9, -10.0, beaten)  # without a rival the lead is large

    @cached_property
    def negation(self) -> list[np.ndarray]:
        """Axes h, i, e: whether "the head of i that is not e" fits i alone."""
        scene, colors, nouns = self.scene, len(COLORS), len(NOUNS)
        out = np.zeros((colors + nouns, len(scene)), dtype=bool)  # e, k
        out[scene.colors, np.arange(len(scene))] = True
        out[colors + scene.nouns, np.arange(len(scene))] = True
        left = self.heads @ (~out).astype(np.float32).T  # h, i, e: number of remaining objects
        sensible = np.concatenate(
            (np.repeat(~self._color[:, None], colors, 1), np.repeat(~self._noun[:, None], nouns, 1)), axis=1
        )
        named = (left == 1) & ~out.T & out.any(axis=1) & sensible[:, None]
        return [self._split.keep(named & self._extendable[..., None], self.held[..., None])]

    @cached_property
    def relation(self) -> list[np.ndarray]:
        """Axes h, i, r, j, a and h, i, r, j, l, a, b: whether the relation to j (and l) singles out i clearly.

        The anchors are named by their heads a and b.
        """
        held_relation = self._split.held_relations(self.scene, self._noun, self._relations)[..., None]  # h, i, r, j
        one = self.one_anchor & self._extendable[..., None, None]
        held = self.held[..., None, None] | held_relation
        named, anchor_held = self.unique[_ANCHOR_HEADS].T, self.held[_ANCHOR_HEADS].T  # j, a
        arrays = [self._split.keep(one[..., None] & named, held[..., None] | anchor_held)]
        if self._betweens:
            held_relation = self._split.held_relations(self.scene, self._noun, self._betweens)[..., None, None]
            two = self.two_anchors & self._extendable[..., None, None, None]
            both = named[:, None, :, None] & named[:, None]  # j, l, a, b
            held_both = anchor_held[:, None, :, None] | anchor_held[:, None]
            held = (self.held[..., None, None, None] | held_relation)[..., None, None]
            arrays.append(self._split.keep(two[..., None, None] & both, held | held_both))
        return arrays

    @cached_property
    def one_anchor(self) -> np.ndarray:
        """Axes h, i, r, j: whether the relation to j singles out i among all objects that its head fits."""
        seen, everyone = self.scene.seen, np.arange(len(self.scene))
        margins = np.array([known.margin(seen[:, None], seen) for known in self._relations])
        margins[:, everyone, everyone] = -np.inf  # r, i, j; no object is its own anchor
        names = _singled_out(self.heads, margins)
        best = [number for number, known in enumerate(self._relations) if known.best]
        if best:
            names[:, :, best] = (self._lead(margins[best], self.heads) > CLEAR) & np.isfinite(
                margins[best].swapaxes(0, 1)
            )
        return names

    @cached_property
    def two_anchors(self) -> np.ndarray:
        """Axes h, i, r, j, l: the same for relations with two anchors."""
        seen, everyone = self.scene.seen, np.arange(len(self.scene))
        margins = np.array([known.margin(seen[:, None, None], seen[:, None], seen) for known in self._betweens])
        margins[:, everyone, everyone] = margins[:, everyone, :, everyone] = -np.inf
        margins[:, :, everyone, everyone] = -np.inf  # r, i, j, l are three different objects
        flat = margins.reshape(len(margins), len(seen), -1)
        return _singled_out(self.heads, flat).reshape(*self.heads.shape[:2], *margins.shape[:1], *margins.shape[2:])

    @cached_property
    def nested(self) -> list[np.ndarray]:
        """Axes h, i, r, j: the same for an anchor that is named by a relation of its own."""
        return [self._outer(2)]

    def _outer(self, depth: int) -> np.ndarray:
        """Axes h, i, r, j: the outermost of `depth` nested relations."""
        if depth not in self._by_depth:
            inner = self.names("relation") if depth == 2 else self._outer(depth - 1).any(axis=(0, 2, 3))
            held = self._split.held_relations(self.scene, self._noun, self._relations) | self.held[..., None]
            named = self.one_anchor & self._extendable[..., None, None] & inner
            self._by_depth[depth] = np.asarray(self._split.avoid(named, held[..., None]))
        return self._by_depth[depth]

    def draw_nested(self, depth: int, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        """Return a random phrase of `depth` nested relations. Raises LanguageError if there is none."""
        if depth == 1:
            return self.draw("relation", referent, rng)
        outer = self._outer(depth)[:, referent]
        places = np.flatnonzero(outer)
        if not len(places):
            raise LanguageError(f"no phrase of {depth} relations names object {referent} alone")
        head, relation, anchor = map(int, np.unravel_index(places[rng.integers(len(places))], outer.shape))
        named = self.draw_nested(depth - 1, anchor, rng)
        return self.head(head, referent, relation=self._relations[relation].phrase, anchors=(named,))

    def _all_nested(self, referent: int) -> Iterator[ObjectPhrase]:
        for head, relation, anchor in sorted(np.argwhere(self._outer(2)[:, referent]).tolist(), key=_head_rank):
            for named in self.all("relation", anchor):
                yield self.head(head, referent, relation=self._relations[relation].phrase, anchors=(named,))

    def nameable_nested(self, depth: int) -> np.ndarray:
        """Return (K,) bool: which objects have a phrase of `depth` nested relations."""
        if depth == 1:
            return self.names("relation")
        return np.asarray(self._outer(depth).any(axis=(0, 2, 3)))


def _head_rank(place: list[int]) -> tuple[int, list[int]]:
    """Sort key: colour and noun first, then noun alone, colour alone, neither, and heads with more words."""
    head, *rest = place
    return (3 - head if head < 4 else head), rest


def _available_words(array: np.ndarray) -> list[int]:
    """Return the indices along axis 1 with at least one expression."""
    return np.flatnonzero(array.any(axis=(0, *range(2, array.ndim)))).tolist()


def _singled_out(heads: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """Return (h, i, r, j): whether the relation holds clearly for i and not for any other object its head fits.

    heads: (h, i, k). margins: (r, i, j).
    """
    possible = (margins >= ABSENT).astype(np.float32)
    fitting = np.moveaxis(heads[:, None] @ possible, 1, 2)  # number of objects, including i
    return (fitting == 1) & (np.moveaxis(margins, 0, 1) > CLEAR)


def _excludable() -> list[ObjectPhrase]:
    return [ObjectPhrase(color=color) for color in COLORS] + [ObjectPhrase(noun) for noun in NOUNS]


def head_matches(scene: Scene) -> np.ndarray:
    """Return (H, K, K) float32: whether the head made for one object fits another; 0 if the head does not exist.

    Heads are numbered by bits for colour, noun, size and role; H is 4, 8 or 16, as far as the scene needs the bits.
    """
    count = len(scene)
    same = np.ones((4, count, count), dtype=np.float32)
    same[1] = scene.colors[:, None] == scene.colors
    same[2] = scene.nouns[:, None] == scene.nouns
    np.multiply(same[1], same[2], out=same[3])
    words = size_words(scene)
    if any(words):
        sized = np.array([[word == other and word is not None for other in words] for word in words])
        same = np.concatenate((same, same * sized))
    if scene.targets.any():
        if not any(words):
            same = np.concatenate((same, np.zeros_like(same)))
        same = np.concatenate((same, same * (scene.targets[:, None] == scene.targets)))
    return same


def size_words(scene: Scene) -> list[str | None]:
    """Return each object's size as a word, None if no word fits."""
    return [
        next((word for word, size in SIZES.items() if size.low < x < size.high), None) for x in scene.sizes.tolist()
    ]

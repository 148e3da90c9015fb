"""From an object of a scene to a phrase that names it and nothing else.

Everything is worked out for all objects at once, as arrays: an environment asks at every reset. Their axes
are called h (a head: which of noun, colour, size and role are said), r (a relation), s (a superlative), e (what is
excluded), i (the referent), j and l (the anchors), k (any object), a and b (the anchors' heads).
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
MAX_DEPTH = 3  # relations within relations that are ever said

# The heads by what they say: bits for colour, noun, size and role. "object", "color object", "noun", "color noun", ...
_COLOR, _NOUN, _SIZE, _ROLE = ((np.arange(16) >> bit) % 2 == 1 for bit in range(4))
_PLAIN = {"color": (1, 9), "shape": (2, 10), "color_shape": (3, 11), "size": (4, 5, 6, 7, 12, 13, 14, 15)}
_ANCHORS = slice(1, 4)  # the heads that an anchor is named by


class ReferringExpressions:
    """What could be said of the objects of a scene: for each kind, a bool array of who is named by what.

    redundant: relations, superlatives and negations are said even of what has a name without them.
    """

    def __init__(self, scene: Scene, split: Split, redundant: bool = False) -> None:
        self.scene, self._split = scene, split
        self._relations = [known for known in RELATIONS.values() if known.anchors == 1]
        self._betweens = [known for known in RELATIONS.values() if known.anchors == 2]
        self._superlatives = list(SUPERLATIVES.values())
        self._named: dict[str, np.ndarray] = {}
        self._by_depth: dict[int, np.ndarray] = {}
        heads = _heads(scene)
        count = len(heads)
        self._noun, self._color, self._size, self._role = _NOUN[:count], _COLOR[:count], _SIZE[:count], _ROLE[:count]
        self.heads = heads  # h, i, k: the head made for i fits k
        self.sharing = heads.sum(axis=2)  # h, i: how many objects the head fits
        self.unique = self.sharing == 1  # h, i
        self._helps = self.sharing > (0 if redundant else 1)  # h, i: more words may be said
        self.held = split.held_heads(scene, self._noun & self._color)  # h, i: the split holds the combination back

    def of(self, kind: str) -> list[np.ndarray]:
        """The kind's arrays, whose second axis is i, masked by the split."""
        if kind in _PLAIN:
            return self._plain(kind)
        return getattr(self, kind)

    def names(self, kind: str) -> np.ndarray:
        """(K,) bool, who is named by an expression of this kind."""
        if kind not in self._named:
            arrays = self.of(kind)
            self._named[kind] = np.any([array.any(axis=(0, *range(2, array.ndim))) for array in arrays], axis=0)
        return self._named[kind]

    def draw(self, kind: str, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        """An expression of the kind for the referent: its word evenly, then its anchors. Raises LanguageError."""
        if kind == "nested":
            return self.draw_nested(2, referent, rng)
        arrays = [array[:, referent] for array in self.of(kind)]
        if kind in _PLAIN:
            arrays = [array[:, None] for array in arrays]
        words = [(number, word) for number, array in enumerate(arrays) for word in _said(array)]
        if not words:
            raise LanguageError(f"no {kind} names object {referent} alone")
        number, word = words[rng.integers(len(words))]
        places = np.argwhere(arrays[number][:, word])
        head, *rest = places[rng.integers(len(places))].tolist()
        return self.phrase(kind, number, referent, (head, word, *rest))

    def all(self, kind: str, referent: int) -> Iterator[ObjectPhrase]:
        """Every expression of the kind for the referent, those first that say most of the thing itself."""
        if kind == "nested":
            yield from self._all_nested(referent)
            return
        for number, array in enumerate(self.of(kind)):
            places = np.argwhere(array[:, referent]).tolist()
            for place in places if kind in _PLAIN else sorted(places, key=_plainest):
                yield self.phrase(kind, number, referent, tuple(place))

    def phrase(self, kind: str, number: int, referent: int, place: tuple[int, ...]) -> ObjectPhrase:
        """The expression at a place of the kind's array of this number, the referent's axis left out."""
        if kind == "superlative":
            return self.head(place[0], referent, superlative=self._superlatives[place[1]].phrase)
        if kind == "negation":
            return self.head(place[0], referent, excluded=_excludable()[place[1]])
        if kind == "relation":
            known = (self._relations, self._betweens)[number][place[1]]
            count = known.anchors
            anchors = zip(place[2 : 2 + count], place[2 + count :], strict=True)
            named = tuple(self.head(head + _ANCHORS.start, anchor) for anchor, head in anchors)
            return self.head(place[0], referent, relation=known.phrase, anchors=named)
        return self.head(_PLAIN[kind][place[0]], referent)

    def head(self, number: int, index: int, **more) -> ObjectPhrase:
        """The object's head of this number, with what else is said."""
        thing = self.scene
        return ObjectPhrase(
            noun=list(NOUNS)[thing.nouns[index]] if self._noun[number] else None,
            color=list(COLORS)[thing.colors[index]] if self._color[number] else None,
            size=_size_words(thing)[index] if self._size[number] else None,
            role=ROLES[int(thing.targets[index])] if self._role[number] else None,
            **more,
        )

    def _plain(self, kind: str) -> list[np.ndarray]:
        """h, i, h counting the kind's own heads: the head alone names i."""
        heads = [head for head in _PLAIN[kind] if head < len(self.heads)]
        return [self._split.keep(self.unique[heads], self.held[heads])]

    @cached_property
    def superlative(self) -> list[np.ndarray]:
        """h, i, s: "the superlative head of i" is clearly i."""
        scene = self.scene
        score = np.array([known.score(scene.seen, scene.sizes) for known in self._superlatives])  # s, i
        clear = np.array([known.clear for known in self._superlatives])
        lead = self._lead(score[:, :, None], self.heads)[..., 0]  # h, i, s
        return [self._split.keep((lead > clear) & self._helps[..., None], self.held[..., None])]

    def _lead(self, score: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """How far i is ahead of everything else its head fits: score (s, k, j) and heads (h, i, k) to (h, i, s, j)."""
        rivals = heads.copy()
        everyone = np.arange(len(self.scene))
        rivals[:, everyone, everyone] = 0
        score = np.where(np.isfinite(score), score, -1e9)
        beaten = np.where(rivals[:, :, None, :, None] > 0, score, -1e9).max(axis=3)
        own = np.moveaxis(score, 0, 1)  # i, s, j
        return own - np.where(beaten <= -1e9, -10.0, beaten)  # without a rival, ahead by metres

    @cached_property
    def negation(self) -> list[np.ndarray]:
        """h, i, e: "the head of i that is not e" fits i alone."""
        scene, colors, nouns = self.scene, len(COLORS), len(NOUNS)
        out = np.zeros((colors + nouns, len(scene)), dtype=bool)  # e, k
        out[scene.colors, np.arange(len(scene))] = True
        out[colors + scene.nouns, np.arange(len(scene))] = True
        left = self.heads @ (~out).astype(np.float32).T  # h, i, e: how many remain, i included where it does
        sensible = np.concatenate(
            (np.repeat(~self._color[:, None], colors, 1), np.repeat(~self._noun[:, None], nouns, 1)), axis=1
        )
        named = (left == 1) & ~out.T & out.any(axis=1) & sensible[:, None]
        return [self._split.keep(named & self._helps[..., None], self.held[..., None])]

    @cached_property
    def relation(self) -> list[np.ndarray]:
        """h, i, r, j, a and h, i, r, j, l, a, b: "head of i, relation, head a of j (and head b of l)" is clearly i."""
        held_relation = self._split.held_relations(self.scene, self._noun, self._relations)[..., None]  # h, i, r, j
        one = self.one_anchor & self._helps[..., None, None]
        held = self.held[..., None, None] | held_relation
        named, anchor_held = self.unique[_ANCHORS].T, self.held[_ANCHORS].T  # j, a
        arrays = [self._split.keep(one[..., None] & named, held[..., None] | anchor_held)]
        if self._betweens:
            held_relation = self._split.held_relations(self.scene, self._noun, self._betweens)[..., None, None]
            two = self.two_anchors & self._helps[..., None, None, None]
            both = named[:, None, :, None] & named[:, None]  # j, l, a, b
            held_both = anchor_held[:, None, :, None] | anchor_held[:, None]
            held = (self.held[..., None, None, None] | held_relation)[..., None, None]
            arrays.append(self._split.keep(two[..., None, None] & both, held | held_both))
        return arrays

    @cached_property
    def one_anchor(self) -> np.ndarray:
        """h, i, r, j: the relation to j singles out i among all that its head fits."""
        seen, everyone = self.scene.seen, np.arange(len(self.scene))
        margins = np.array([known.margin(seen[:, None], seen) for known in self._relations])
        margins[:, everyone, everyone] = -np.inf  # r, i, j; nothing is beside itself
        names = _names(self.heads, margins)
        best = [number for number, known in enumerate(self._relations) if known.best]
        if best:
            names[:, :, best] = (self._lead(margins[best], self.heads) > CLEAR) & np.isfinite(
                margins[best].swapaxes(0, 1)
            )
        return names

    @cached_property
    def two_anchors(self) -> np.ndarray:
        """h, i, r, j, l: the same for what lies between j and l."""
        seen, everyone = self.scene.seen, np.arange(len(self.scene))
        margins = np.array([known.margin(seen[:, None, None], seen[:, None], seen) for known in self._betweens])
        margins[:, everyone, everyone] = margins[:, everyone, :, everyone] = -np.inf
        margins[:, :, everyone, everyone] = -np.inf  # r, i, j, l: three different things
        flat = margins.reshape(len(margins), len(seen), -1)
        return _names(self.heads, flat).reshape(*self.heads.shape[:2], *margins.shape[:1], *margins.shape[2:])

    @cached_property
    def nested(self) -> list[np.ndarray]:
        """h, i, r, j: the relation's anchor is named by a relation of its own."""
        return [self._outer(2)]

    def _outer(self, depth: int) -> np.ndarray:
        """h, i, r, j: the outermost of `depth` relations, whose anchor is named by one less."""
        if depth not in self._by_depth:
            inner = self.names("relation") if depth == 2 else self._outer(depth - 1).any(axis=(0, 2, 3))
            held = self._split.held_relations(self.scene, self._noun, self._relations) | self.held[..., None]
            named = self.one_anchor & self._helps[..., None, None] & inner
            self._by_depth[depth] = np.asarray(self._split.avoid(named, held[..., None]))
        return self._by_depth[depth]

    def draw_nested(self, depth: int, referent: int, rng: np.random.Generator) -> ObjectPhrase:
        """A phrase of `depth` relations, each seen from the next. Raises LanguageError where there is none."""
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
        for head, relation, anchor in sorted(np.argwhere(self._outer(2)[:, referent]).tolist(), key=_plainest):
            for named in self.all("relation", anchor):
                yield self.head(head, referent, relation=self._relations[relation].phrase, anchors=(named,))

    def nameable_nested(self, depth: int) -> np.ndarray:
        """(K,) bool, who is named by a phrase of `depth` relations."""
        if depth == 1:
            return self.names("relation")
        return np.asarray(self._outer(depth).any(axis=(0, 2, 3)))


def _plainest(place: list[int]) -> tuple[int, list[int]]:
    """Colour and noun before the noun alone, the colour alone, neither, and heads with more."""
    head, *rest = place
    return (3 - head if head < 4 else head), rest


def _said(array: np.ndarray) -> list[int]:
    """The words, axis 1, of which some expression names something."""
    return np.flatnonzero(array.any(axis=(0, *range(2, array.ndim)))).tolist()


def _names(heads: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """heads (h, i, k) and margins (r, i, j) to (h, i, r, j): i alone is clearly so, of all that its head fits."""
    possible = (margins >= ABSENT).astype(np.float32)
    fitting = np.moveaxis(heads[:, None] @ possible, 1, 2)  # a count, i included where clear
    return (fitting == 1) & (np.moveaxis(margins, 0, 1) > CLEAR)


def _heads(scene: Scene) -> np.ndarray:
    """(H, K, K) float32: whether the head made for one object fits another; 0 where it cannot be made."""
    count = len(scene)
    same = np.ones((4, count, count), dtype=np.float32)
    same[1] = scene.colors[:, None] == scene.colors
    same[2] = scene.nouns[:, None] == scene.nouns
    np.multiply(same[1], same[2], out=same[3])
    words = _size_words(scene)
    if any(words):
        sized = np.array([[word == other and word is not None for other in words] for word in words])
        same = np.concatenate((same, same * sized))
    if scene.targets.any():
        if not any(words):
            same = np.concatenate((same, np.zeros_like(same)))
        same = np.concatenate((same, same * (scene.targets[:, None] == scene.targets)))
    return same


def _size_words(scene: Scene) -> list[str | None]:
    """Each object's size in a word, None where no word fits."""
    return [
        next((word for word, size in SIZES.items() if size.low < x < size.high), None) for x in scene.sizes.tolist()
    ]


def _excludable() -> list[ObjectPhrase]:
    return [ObjectPhrase(color=color) for color in COLORS] + [ObjectPhrase(noun) for noun in NOUNS]

"""The lattice of a sentence: for each word, the phrases of the lexicon that begin there, with their costs."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

from rapidfuzz import process
from rapidfuzz.distance import OSA

from language import asides, costs, words
from language.errors import NotUnderstood, check_known
from language.normalise import known_words, normalised, spelling, wordings
from language.remarks import command, naming
from language.scanning import Token, inflections, said, scan, verb_words
from language.verbs import KNOWN, Act
from language.words import FILLERS, TABLE, colors, phrases

DOUBLED = 0.5  # wrong letters that a double letter typed once, or a single one typed twice, counts as
MOST_RELATIONS = 12  # tokens where a relation begins; commands that people wrote have up to 8
TABLES: dict[str, dict[str, str]] = {  # category -> meaning -> phrases
    "region": words.REGIONS,
    "role": words.TABLE["roles"],
    "relation": words.TABLE["relations"],
    "mutual": words.TABLE["mutual"],
    "direction": words.TABLE["directions"],
    "side": words.TABLE["sides"],
    "superlative": words.TABLE["superlatives"],
    "unit": words.TABLE["units"],
    "order": words.TABLE["orders"],
}
LIMITING = frozenset(phrases(TABLE["limiting"]))  # words that no reading may leave out
FLOORS = frozenset(phrases(TABLE["floors"]))
HARMLESS = FILLERS | frozenset(TABLE["harmless"].split())  # words of phrases that alone change nothing
BARE_PLACES = ("into", "home", "elsewhere")  # where a thing goes, in words that name nothing else
STRANGERS = words.UNRELATED | LIMITING  # words that are no misspelling of another
CONTENT = frozenset(
    phrases(
        "noun, color, role, superlative, stack, region, number, ordinal, verb, "
        "done, pronoun, every, both, other, never, not, if, else, order"
    )
)
_PRONOUNS = ("that", "this", "them", "these", "those")
_BEFORE_PRONOUN = ("of", "on", "in", "to", "from", "with", "behind", "under", "near", "beside", "over", "between")


class Edge(NamedTuple):
    """A phrase of the lexicon: the index of the token after it, its category and meaning, and its cost."""

    end: int
    category: str
    value: Any
    cost: float


class Item(NamedTuple):
    """A part of a reading: the token after it, its meaning, its cost, and a bit for each token that it leaves out."""

    end: int
    value: Any
    cost: float
    skipped: int = 0


class Lattice:
    """The tokens of a sentence and, for each, the edges that begin there, by category.

    unknown: indices of tokens that are no words of the lexicon, however spelt. bare: of words that mean something only
        within phrases, none of which is said.
    gestures: how many accompany the sentence; if there are none, no word needs one.
    """

    def __init__(
        self, sentence: str | list[Token], gestures: int = 0, acts: Collection[Act] = frozenset(Act), table: bool = True
    ) -> None:
        """sentence: as typed, or its plain words. acts: of verbs that can mean something in the scene. table: no board.

        Raises NotUnderstood if the sentence is too long.
        """
        self.gestures, self._acts, self.table = gestures, acts, table
        self.tokens = _split_up(normalised(sentence) if isinstance(sentence, str) else sentence)
        texts = [token.text for token in self.tokens]
        self.variants = [() if table and is_floor(texts, i) else spellings(text) for i, text in enumerate(texts)]
        self.unknown = {i for i, variants in enumerate(self.variants) if not variants}
        self.edges: list[dict[str, list[Edge]]] = [self._edges(i) for i in range(len(self.tokens))]
        self._gaps: dict[int, list[Item]] = {}
        self._asides: dict[int, list[Item]] = {}
        self.bare = self._bare()
        if sum("relation" in edges for edges in self.edges) > MOST_RELATIONS:
            raise NotUnderstood("the sentence says more than one can keep apart; say it in several sentences")

    def __len__(self) -> int:
        return len(self.tokens)

    def get(self, index: int, category: str) -> list[Edge]:
        """Return the edges of a category that begin at the token with this index."""
        return self.edges[index].get(category, []) if index < len(self.tokens) else []

    def text(self, index: int) -> str:
        """Return the token's word; "" after the end."""
        return self.tokens[index].text if index < len(self.tokens) else ""

    def _edges(self, start: int) -> dict[str, list[Edge]]:
        found: dict[str, dict[tuple, Edge]] = {}
        open_nodes = [(start, trie(), 0.0)]
        while open_nodes:
            at, node, cost = open_nodes.pop()
            for category, value in node.get(None, ()):
                key = (at, value)
                if category in ("inflected", "done") and not self.table:
                    continue
                category = "verb" if category == "inflected" else category
                if category in ("verb", "done"):
                    verb = KNOWN[value]
                    if verb.act not in self._acts or self._tells_how(start):
                        continue
                    key = (at, (verb.act, verb.pulls))
                elif not self.table and (category in BARE_PLACES or value in ("toward", "away", "spot_of")):
                    continue
                same = found.setdefault(category, {})
                if key not in same or same[key].cost > cost:
                    same[key] = Edge(at, category, value, cost)
            if at < len(self.tokens):
                for word, extra in self.variants[at]:
                    if word in node:
                        open_nodes.append((at + 1, node[word], cost + extra))
        if not self.gestures:
            found.pop("pointing", None)
        if self.text(start) == "next" and self.text(start + 1) == "to":  # is no "then"
            found.pop("join", None)
        edges = {category: list(same.values()) for category, same in found.items()}
        if self.text(start) == "right" and start and self.text(start - 1) in ("on", "at", "from"):
            # "the cube on the right into the drawer" does not go right into it.
            edges["relation"] = [edge for edge in edges.get("relation", ()) if edge.value == "right"]
        number = _number(self.tokens[start].text)
        if number is not None:
            edges.setdefault("number", []).append(Edge(start + 1, "number", number, 0.0))
        return edges

    def _tells_how(self, index: int) -> bool:
        """Whether a word that is also a verb tells how something is: "too close", "close to the edge"."""
        degree = index > 0 and self.tokens[index - 1].text in ("too", "very", "way")
        return degree or (self.tokens[index].text == "close" and self.text(index + 1) == "to")

    # ---- Words that are left out between phrases

    def gaps(self, start: int) -> list[Item]:
        """Return where the next phrase may begin. Fillers are left out at no cost, one other word at one."""
        if start not in self._gaps:
            found = [Item(at, None, 0.0) for at in self._free(start)]
            for item in list(found):
                if item.end < len(self):
                    cost = self.skip_cost(item.end)
                    found += [Item(at, None, cost, 1 << item.end) for at in self._free(item.end + 1)]
            best: dict[int, Item] = {}
            for item in found:
                if item.end not in best or item.cost < best[item.end].cost:
                    best[item.end] = item
            self._gaps[start] = list(best.values())
        return self._gaps[start]

    def _free(self, start: int) -> list[int]:
        """Return the positions from a token on that are reached by leaving out fillers."""
        positions = [start]
        while start < len(self) and self.is_filler(start):
            start += 1
            positions.append(start)
        return positions

    def _bare(self) -> set[int]:
        """Return the tokens that are words of the lexicon only within phrases that are not said here."""
        covered = {
            i
            for at, edges in enumerate(self.edges)
            for each in edges.values()
            for edge in each
            for i in range(at, edge.end)
        }
        return {
            i
            for i, token in enumerate(self.tokens)
            if i not in covered | self.unknown
            and not (self.is_corrected(i) or token.text in HARMLESS or token.text.endswith(("ly", "'s")))
        }

    # ---- Clauses and phrases that ask for nothing

    def asides(self, start: int) -> list[Item]:
        """Return the asides that begin at a token; there are none on a board."""
        if start not in self._asides:
            phrase = [Item(edge.end, None, asides.PHRASE) for edge in self.get(start, "aside")] if self.table else []
            texts = [token.text for token in self.tokens] if self.table else []
            ends = asides.clause_ends(texts, start, self._names)
            clauses = [Item(end, None, asides.CLAUSE + asides.WORD * (end - start)) for end in ends]
            self._asides[start] = [*phrase, *clauses]
        return self._asides[start]

    def _names(self, index: int) -> bool:
        edges = self.edges[index]
        nouns = {edge.value for edge in edges.get("noun", ())}
        acts = any(edge.cost == 0.0 for edge in edges.get("verb", ()))
        return asides.is_content(edges.keys(), self.text(index), nouns, acts)

    def is_filler(self, index: int) -> bool:
        """Whether a word adds nothing: one of a table, or an adverb that is not known."""
        word = self.tokens[index].text
        if word in _PRONOUNS and index and self.tokens[index - 1].text in _BEFORE_PRONOUN:  # "on top of that"
            after = self.edges[index + 1].keys() if index + 1 < len(self.tokens) else set()
            return bool({"noun", "color", "size", "side", "number", "superlative", "stack"} & after)
        if self.is_relative(index):
            return False
        return word in FILLERS or (index in self.unknown and len(word) > 4 and word.endswith("ly"))

    def is_corrected(self, index: int) -> bool:
        """Whether a word is no word of the lexicon, but similar to some."""
        return any(cost for _, cost in self.variants[index])

    def names_absent(self, index: int, here: Collection[str]) -> bool:
        """Whether a word is a colour that nothing has, before a kind of thing: "the purple cube". here: the colours."""
        if index + 1 == len(self) or "noun" not in self.edges[index + 1] or "color" not in self.edges[index]:
            return False
        return colors().get(self.text(index), ("",))[0] not in here

    def is_call(self, index: int) -> bool:
        """Whether a word that is not known calls somebody: marks part it from all others, "the red one, chief"."""
        word, ends = self.text(index), ("", ",", ".", "!", "?")
        apart = (index == 0 or self.text(index - 1) == ",") and self.text(index + 1) in ends and len(self) > 2
        return apart and index in self.unknown and word not in STRANGERS

    def is_head(self, index: int) -> bool:
        """Whether a word names a colour, a kind of thing or all of several."""
        nouns = {edge.value for edge in self.get(index, "noun")} - {"cube", "thing"}
        return not self.is_corrected(index) and bool(nouns or {"color", "both", "every"} & self.edges[index].keys())

    def is_relative(self, index: int) -> bool:
        """Whether a word begins a relative clause of what somebody does: "the spot from which you lifted it"."""
        return self.text(index) == "which" and self.text(index + 1) in ("i", "you", "we")

    def skip_cost(self, index: int) -> float:
        """Return the cost of leaving out a token."""
        if self.is_filler(index):
            return 0.0
        if index in self.unknown:
            return costs.SKIPPED["unknown"]
        if "color" in self.edges[index]:
            return costs.SKIPPED["color"]
        return costs.SKIPPED["content" if CONTENT & self.edges[index].keys() else "function"]


def is_floor(words: Sequence[str], index: int) -> bool:
    """Whether a word names what is below the table, where nothing is put: "on the floor"."""
    return words[index] in FLOORS and index > 0 and words[index - 1] in ("on", "onto", "to", "at", "off")


def _split_up(found: list[Token]) -> list[Token]:
    """Return the words; those that are two known words run together are split."""
    split: list[Token] = []
    for token in found:
        parts = _two_words(token.text) if len(token.text) > 4 and not _is_known(token.text) else None
        if parts is None:
            split.append(token)
        else:
            middle = token.start + len(parts[0])
            pair = Token(parts[0], token.start, middle), Token(parts[1], middle, token.end)
            split += [each for each in pair if each.text not in ("the", "teh")]
    return split


@cache
def _two_words(word: str) -> tuple[str, str] | None:
    """Return two known words that a word consists of; None: it does not, or is a known word with an error."""
    if word in STRANGERS:
        return None
    joined = word.startswith(("the", "in", "to", "on", "of"))
    if not joined and any(cost <= costs.SPELLING for _, cost in spellings(word)):
        return None
    for at in range(2, len(word) - 1):
        one, other = word[:at], word[at:]
        short = ("in", "on", "to", "of", "at", "up", "it", "me")
        if all((len(part) > 2 and (part == "the" or part in vocabulary())) or part in short for part in (one, other)):
            return one, other
    return None


def _is_known(word: str) -> bool:
    return word in vocabulary() or _number(word) is not None


def spellings(word: str) -> tuple[tuple[str, float], ...]:
    """Return the known words that a word may be, with their costs; () if it is similar to none."""
    if _is_known(word):
        return ((word, 0.0),)
    if len(word) < 3 or len(word) > 20 or not word.isalpha() or word in STRANGERS:
        return ()
    return _corrected(word)


@cache
def _corrected(word: str) -> tuple[tuple[str, float], ...]:
    most = 1 if len(word) < 7 else 2
    found = process.extract(word, _choices(), scorer=OSA.distance, processor=None, score_cutoff=most, limit=None)
    once = undoubled(word)
    near = [
        (known, cost * (DOUBLED if undoubled(known) == once else 1.0) + 0.3 * (known[0] != word[0]))
        for known, cost, _ in found
        if cost < len(known) - 1 and (len(word) > 3 or known[0] == word[0])
    ]
    best = min((cost for _, cost in near), default=0.0)
    return tuple((known, costs.SPELLING * cost) for known, cost in near if cost <= max(best + 0.3, 1.0))[:8]


@cache
def undoubled(word: str) -> str:
    """Return a word with its double letters typed once."""
    return re.sub(r"(.)\1", r"\1", word)


@cache
def _choices() -> tuple[str, ...]:
    return tuple(sorted(word for word in vocabulary() if len(word) > 2))


def _number(word: str) -> float | None:
    try:
        return float(word.replace(",", ".")) if word[0].isdecimal() else None
    except ValueError:
        return None


@cache
def vocabulary() -> frozenset[str]:
    """Return every single word of the lexicon."""
    found: set[str] = set(FILLERS)
    nodes = [trie()]
    while nodes:
        node = nodes.pop()
        for word, below in node.items():
            if word is not None:
                found.add(word)
                nodes.append(below)
    return frozenset(found)


@cache
def trie() -> dict:
    """Return the phrases as nested dicts; under None, the categories and meanings of the phrase that ends there."""
    root: dict = {}
    for category, value, phrase in _entries():
        node = root
        for token in scan(phrase):
            node = node.setdefault(token.text, {})
        ends = node.setdefault(None, [])
        if node is not root and (category, value) not in ends:
            ends.append((category, value))
    root.pop(None, None)
    return root


def _entries() -> Iterator[tuple[str, Any, str]]:
    """Yield (category, meaning, phrase) for every phrase of the lexicon."""
    for phrase, names in words.colors().items():
        yield "color", names, phrase
    for kind, nouns in words.nouns().items():
        yield from (("noun", kind, phrase) for phrase in nouns)
    for phrase, size in words.sizes().items():
        yield "size", size, phrase
    for category, table in TABLES.items():
        for value, text in table.items():
            yield from ((category, value, phrase) for phrase in phrases(text))
    for category, text in words.TABLE["singles"].items():
        yield from ((category, phrase, phrase) for phrase in phrases(text))
    yield from (("aside", "aside", phrase) for phrase in phrases(TABLE["asides"]))
    for phrase, amount in words.NUMBERS.items():
        yield "number", amount, phrase
    for phrase, rank in words.ORDINALS.items():
        yield "ordinal", rank, phrase
    for name, verb in KNOWN.items():
        for phrase in said(verb):
            yield "verb", name, phrase
            yield from inflections(name, phrase)


def teach(category: str, meaning: str, phrase: str) -> None:
    """Add a phrase to the lexicon: `teach("relation", "near", "hard by")`, `teach("verb", "lift", "snatch up")`.

    Args:
        category: "verb" or a key of TABLES.
        meaning: a verb of `language.verbs`, or a key of that table.
        phrase: one or more words.

    Raises:
        LanguageError: an unknown category or meaning.
    """
    check_known("category", category, ("verb", *TABLES))
    table = KNOWN if category == "verb" else TABLES[category]
    check_known(category, meaning, table)
    if category == "verb":
        object.__setattr__(KNOWN[meaning], "words", ", ".join(filter(None, (KNOWN[meaning].words, phrase))))
    else:
        TABLES[category][meaning] += f", {phrase}"
    forget_caches()


def forget_caches() -> None:
    """Clear the caches of the lexicon after its tables were changed."""
    of_lexicon = (trie, command, naming, vocabulary, _choices, _corrected, _two_words)
    for cached in (*of_lexicon, verb_words, wordings, known_words, spelling):
        cached.cache_clear()

"""The parser: from a sentence to its meaning. The grammar is generated from the tables that `say` uses.

A fixed phrase ("to the left of", "and place it", ", then") is one token. The longest phrase that fits is tried first;
if the grammar does not accept it at this point, or the rest of the sentence, the next shorter one is tried.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from language.errors import LanguageError, NotUnderstood, closest, quote
from language.instruction import Meaning
from language.lexicon import Lexicon, Word, lexicon, split
from language.meaning_builder import MeaningBuilder
from language.verbs import BASE, GOAL, OBJECT

if TYPE_CHECKING:  # lark is slow to import and needed for parsing only
    from lark import Lark
    from lark.parsers.lalr_interactive_parser import InteractiveParser

_MARKS = {",": "_COMMA", ".": "_STOP", "!": "_STOP", "?": "_STOP"}
_AFTER_COMMA = {"then", "closing", "but"}  # categories whose phrases may include a comma before them
_SLOTS = {OBJECT: "object", GOAL: "goal", BASE: "base"}
_POSITIONED = (
    "the",
    "every",
    "pointing",
    "it",
    "spot",
    "excluding",
)  # categories whose position in the sentence is kept
_END = "$END"  # lark's name for the end of the sentence
_RETRIES = 8  # shorter phrases that are tried in place of longer ones, after which the rest is not understood
_LISTED = 12  # expected phrases that a message lists
_GRAMMAR = """\
start: _opening* _body _closing* _STOP*
_opening: opening _COMMA?
_closing: closing
_body: chain | _contrary chain | _contrary correction | rejection
_contrary: (no _COMMA?)+
chain: step (_link step)* | after step (then step)* _COMMA step (_link step)*
_link: then | _COMMA
correction: phrase -> corrected_phrase | goal -> corrected_goal
rejection: _contrary? not phrase _instead phrase
_instead: _COMMA | but
object: phrase | each | spot
base: phrase | spot
goal: place phrase | spot
each: every [superlative] [size] [role] [color] noun [side] [exclusion] [where] -> named
phrase: (the | pointing) [superlative] [size] [role] [color] noun [side] [exclusion] [where] -> named
    | the superlative [where] -> superlative_alone
    | (pointing | it) -> alone
exclusion: excluding color -> not_color | excluding size -> not_size | excluding role -> not_role
    | excluding a [size] [role] [color] noun -> not_noun
where: which_is? relation phrase | which_is? between phrase and phrase
"""


class _Grammar(NamedTuple):
    parser: Lark
    phrases: dict[str, list[tuple[tuple[str, ...], str, str]]]  # first word -> (words, phrase, terminal), longest first
    terminals: dict[str, str]  # phrase -> name of its terminal


def parse_words(sentence: str) -> Meaning:
    """Return the meaning of a sentence. Capitals, extra spaces, polite words and final punctuation are ignored.

    Raises NotUnderstood with the position at which the sentence leaves the grammar and the phrases accepted there.
    """
    words, grammar = split(sentence), _compile(lexicon())
    refused: set[tuple[int, int]] = set()  # (word, length) of phrases after which no reading was found
    first: NotUnderstood | None = None
    for _ in range(1 + _RETRIES):
        taken: list[tuple[int, int]] = []  # those that a shorter phrase could replace
        try:
            return _read(words, grammar, len(sentence), refused, taken)
        except NotUnderstood as error:
            first = first or error
            if not taken:
                break
            refused = {place for place in refused if place[0] <= taken[-1][0]} | {taken[-1]}
    assert first is not None
    raise first


def _read(
    words: list[Word], grammar: _Grammar, end: int, refused: set[tuple[int, int]], taken: list[tuple[int, int]]
) -> Meaning:
    """Read the words once, without the phrases in `refused`. Adds those that have a shorter alternative to `taken`."""
    parser = grammar.parser.parse_interactive()
    at = 0
    while at < len(words):
        known = [phrase for phrase in _phrases_at(grammar, words, at) if (at, phrase[0]) not in refused]
        length = _feed(parser, grammar, words[at], known)[0]
        if length > min((phrase[0] for phrase in known), default=length):
            taken.append((at, length))
        at += length
    return _feed(parser, grammar, Word("", end), [(0, "", _END)])[1]


def _phrases_at(grammar: _Grammar, words: list[Word], at: int) -> list[tuple[int, str, str]]:
    """Return the fixed phrases that begin at a word, the longest first: number of words, phrase and terminal."""
    return [
        (len(phrase), said, terminal)
        for phrase, said, terminal in grammar.phrases.get(words[at].text, ())
        if len(phrase) == 1 or tuple(word.text for word in words[at : at + len(phrase)]) == phrase
    ]


def _feed(
    parser: InteractiveParser, grammar: _Grammar, word: Word, known: list[tuple[int, str, str]]
) -> tuple[int, Any]:
    """Feed the parser the first phrase that it accepts.

    Returns:
        The number of words used, and the meaning of the sentence if it ends here.
    """
    from lark import Token, UnexpectedToken

    for length, text, terminal in known:
        try:
            return length, parser.feed_token(Token(terminal, text, start_pos=word.position))
        except UnexpectedToken:  # the grammar does not accept this phrase here
            continue
    accepted = parser.accepts()
    expected = tuple(phrase for phrase, terminal in grammar.terminals.items() if terminal in accepted)
    raise _not_understood(word, bool(known), expected, _END in accepted)


def _not_understood(word: Word, known: bool, expected: tuple[str, ...], may_end: bool) -> NotUnderstood:
    where = f"at character {word.position + 1}"
    what = f"{quote(word.text)} is not understood" if word.text else "the sentence ends too early"
    near = _completion(word.text, expected, known) or (None if known else closest(word.text, expected))
    hint = f"; did you mean {near!r}?" if near else "."
    listed = [*expected[:_LISTED], *(["..."] if len(expected) > _LISTED else [])]
    here = ", ".join((*listed, "the end of the sentence") if may_end else listed)
    return NotUnderstood(f"{what} {where}{hint} Expected here: {here}", word.position, expected)


def _completion(word: str, expected: tuple[str, ...], known: bool) -> str | None:
    """Return the first expected phrase that begins with the word, or with a similar one if the word is unknown."""
    begins = {phrase.split()[0]: phrase for phrase in reversed(expected)}
    near = word if known else closest(word, begins)
    return begins.get(near) if near else None


@lru_cache(maxsize=8)
def _compile(words: Lexicon) -> _Grammar:
    """Return the parser for this state of the registries. They rarely change, so it is usually built once."""
    from lark import Lark

    categories = _categories(words)
    terminals = {phrase: _terminal(within) for phrase, within in categories.items()}
    members: dict[str, list[str]] = {}
    for phrase, within in categories.items():
        for category in within:
            members.setdefault(category, []).append(terminals[phrase])
    lines = [
        _GRAMMAR,
        *(f"{category}: {' | '.join(dict.fromkeys(members[category]))}" for category in words.categories),
        "step: " + "\n    | ".join(_step_rules(words, terminals)),
        "_COMMA: /,/\n_STOP: /[.]/",
        *(f"{terminal}: /{number}/" for number, terminal in enumerate(dict.fromkeys(terminals.values()))),
    ]
    parser = Lark(
        "\n".join(lines),
        parser="lalr",
        lexer="basic",
        maybe_placeholders=True,
        transformer=MeaningBuilder(words, _POSITIONED),
    )
    return _Grammar(parser, _by_first_word(categories, terminals), terminals)


def _by_first_word(
    categories: dict[str, tuple[str, ...]], terminals: dict[str, str]
) -> dict[str, list[tuple[tuple[str, ...], str, str]]]:
    pieces = [(tuple(phrase.split()), phrase, terminal) for phrase, terminal in terminals.items()]
    pieces += [
        ((",", *phrase.split()), phrase, terminals[phrase])
        for phrase in terminals
        if _AFTER_COMMA & {*categories[phrase]}
    ]
    pieces += [
        ((".", *phrase.split()), phrase, terminals[phrase]) for phrase in terminals if "then" in categories[phrase]
    ]
    pieces += [((mark,), mark, terminal) for mark, terminal in _MARKS.items()]
    found: dict[str, list[tuple[tuple[str, ...], str, str]]] = {}
    for piece in sorted(pieces, key=lambda piece: -len(piece[0])):
        found.setdefault(piece[0][0], []).append(piece)
    return found


def _categories(words: Lexicon) -> dict[str, tuple[str, ...]]:
    """Return the categories of each phrase; each piece of a template is a category of its own."""
    belongs: dict[str, list[str]] = {}
    for phrase in words.phrases():
        if not all(part.isascii() and part.islower() and part.replace("'", "").isalpha() for part in phrase.split()):
            raise LanguageError(f"{phrase!r} cannot be a phrase of the grammar: write it with the letters a to z")
    for piece in _pieces(words):
        belongs.setdefault(piece, []).append("verb_" + piece.replace(" ", "_").replace("'", ""))
    for category, meanings in words.categories.items():
        for forms in meanings.values():
            for phrase in forms:
                belongs.setdefault(phrase, []).append(category)
    return {phrase: tuple(dict.fromkeys(categories)) for phrase, categories in belongs.items()}


def _pieces(words: Lexicon) -> Iterator[str]:
    for cuts in words.templates.values():
        for pieces in cuts:
            yield from (piece for piece in pieces if piece not in _SLOTS)


def _terminal(categories: tuple[str, ...]) -> str:
    return "__".join(categories).upper()


def _step_rules(words: Lexicon, terminals: dict[str, str]) -> Iterator[str]:
    """Yield a grammar alternative for each template; its alias names the task."""
    for task, cuts in words.templates.items():
        for pieces in cuts:
            yield " ".join(_SLOTS.get(piece) or terminals[piece] for piece in pieces) + f" -> task_{task}"

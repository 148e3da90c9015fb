"""From a sentence to what it means. The grammar is written from the same tables that `say` reads."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from language.errors import LanguageError, NotUnderstood, closest, quote
from language.instruction import Instruction, ObjectPhrase
from language.lexicon import Lexicon, Meanings, Word, lexicon, split
from language.templates import SLOT

if TYPE_CHECKING:  # lark is slow to import, and only parsing needs it
    from lark import Lark, Tree
    from lark.parsers.lalr_interactive_parser import InteractiveParser

_MARKS = {",": "_COMMA", ".": "_STOP", "!": "_STOP", "?": "_STOP"}
_END = "$END"  # lark's name for the end of the sentence
_HEAD = """\
start: _opening? instruction _closing? _STOP*
_opening: _polite _COMMA?
_closing: _COMMA? _polite
phrase: _THE [color] noun [relation phrase]
_COMMA: ","
_STOP: "."
"""


class _Grammar(NamedTuple):
    parser: Lark
    terminals: dict[str, str]  # a word or mark -> the name of its terminal
    meanings: dict[str, str | None]  # a rule's alias -> what it means


def parse(sentence: str) -> Instruction:
    """What the sentence asks for. Capitals, spaces, a "please" and final marks make no difference.

    Raises NotUnderstood, which says where the sentence leaves the grammar and what could stand there.
    """
    words = split(sentence)
    grammar = _compile(lexicon())
    parser = grammar.parser.parse_interactive()
    for word in words:
        _feed(parser, grammar, word, grammar.terminals.get(word.text, "UNKNOWN"))
    tree = _feed(parser, grammar, Word("", len(sentence)), _END)
    task = tree.children[0]
    return Instruction(_meaning(grammar, task), _phrase(grammar, task.children[0]))


def _feed(parser: InteractiveParser, grammar: _Grammar, word: Word, terminal: str) -> Tree:
    from lark import Token, UnexpectedToken

    try:
        return parser.feed_token(Token(terminal, word.text))
    except UnexpectedToken:
        raise _not_understood(word, _expected(parser, grammar), _END in parser.accepts()) from None


def _expected(parser: InteractiveParser, grammar: _Grammar) -> tuple[str, ...]:
    possible = parser.accepts() - set(_MARKS.values())
    return tuple(word for word, terminal in grammar.terminals.items() if terminal in possible)


def _not_understood(word: Word, expected: tuple[str, ...], may_end: bool) -> NotUnderstood:
    where = f"at character {word.position + 1}"
    what = f"{quote(word.text)} is not understood" if word.text else "the sentence ends too early"
    near = closest(word.text, expected)
    hint = f"; did you mean {near!r}?" if near else "."
    here = ", ".join((*expected, "the end of the sentence") if may_end else expected)
    return NotUnderstood(f"{what} {where}{hint} Expected here: {here}", word.position, expected)


def _phrase(grammar: _Grammar, tree: Tree) -> ObjectPhrase:
    color, noun, relation, anchor = tree.children
    return ObjectPhrase(
        noun=_meaning(grammar, noun),
        color=_meaning(grammar, color),
        relation=_meaning(grammar, relation),
        anchor=None if anchor is None else _phrase(grammar, anchor),
    )


def _meaning(grammar: _Grammar, tree: Tree | None) -> Any:
    return None if tree is None else grammar.meanings[tree.data]


@lru_cache(maxsize=8)
def _compile(words: Lexicon) -> _Grammar:
    """The parser for the registries in this state. They rarely change, so it is built about once."""
    from lark import Lark

    terminals = {word: _terminal(word) for word in words.words()}
    meanings: dict[str, str | None] = {}
    lines = [
        _HEAD + "_polite: " + " | ".join(map(_terminal, words.polite)),
        _rule("instruction", words.tasks, meanings),
        _rule("color", words.colors, meanings),
        _rule("noun", words.nouns, meanings),
        _rule("relation", words.relations, meanings),
        *(f'{terminal}: "{word}"' for word, terminal in terminals.items()),
    ]
    parser = Lark("\n".join(lines), parser="lalr", lexer="basic", maybe_placeholders=True)
    return _Grammar(parser, terminals | _MARKS, meanings)


def _rule(name: str, known: Meanings, meanings: dict[str, str | None]) -> str:
    """One rule with an alternative for each phrase; notes in `meanings` what each alias means."""
    alternatives = []
    for number, (meaning, phrases) in enumerate(known):
        alias = f"{name}_{number}"
        meanings[alias] = meaning
        alternatives += [f"{' '.join(map(_terminal, phrase.split()))} -> {alias}" for phrase in phrases]
    return f"{name}: " + "\n    | ".join(alternatives)


def _terminal(word: str) -> str:
    if word == SLOT:
        return "phrase"
    if not (word.isascii() and word.isalpha() and word.islower()):
        raise LanguageError(f"{word!r} cannot be a word of the grammar: write it with the letters a to z")
    return f"_{word.upper()}"

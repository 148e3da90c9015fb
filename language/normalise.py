"""Text as it is typed and heard: from a sentence to plain words, each with its place in the sentence.

Rules are pairs of a pattern over the words, which single spaces separate, and their replacement; they run in order.
A rule for a wording ("give X a push") names no verb of the robot: it says the same in a plainer order.
"""

from __future__ import annotations

import itertools
import json
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from rapidfuzz.distance import OSA

from core.safe_files import read_yaml
from language.arrangements import arranged
from language.colors import COLORS
from language.errors import NotUnderstood
from language.objects import NOUNS
from language.ordering import ordered, repeated
from language.remarks import without_remarks
from language.scanning import COLOR, MARKS, Token, inflections, said, scan, text_of, verb_words
from language.spoken import without_restarts
from language.verbs import KNOWN, Act
from language.whereabouts import plain_regions
from language.words import FILLERS, TABLE, names, phrases

LONGEST_SENTENCE, MOST_WORDS = 600, 80  # characters as typed; words
RULES = Path(__file__).with_name("wordings.yaml")
REWRITES = 8  # times that one rule may change one sentence

_BULLET = re.compile(
    r"(^|[\n;.,!?]|\s)\s*(?:\(?\d{1,2}[.):](?!\d)|[*\u2022\u25cf\u25e6\u00b7]|\(?[a-h]\)|step "
    r"\d{1,2}\s?[:.)]?)(?=\s)",
    re.I,
)
_ELLIPSIS = re.compile(r"\.{2,}|\u2026")  # a speaker hesitates: "next to... next to the red one"


def normalised(sentence: str) -> list[Token]:
    """Return the plain words of a sentence. Raises NotUnderstood if it is too long."""
    if len(sentence) > LONGEST_SENTENCE:
        raise NotUnderstood(f"the sentence has {len(sentence)} characters; use at most {LONGEST_SENTENCE}")
    text = _BULLET.sub(lambda m: m[1] + ";".rjust(len(m[0]) - len(m[1])), sentence)
    found = scan(_ELLIPSIS.sub(lambda m: ",".ljust(len(m[0])), text))
    if len(found) > 2 * MOST_WORDS:
        raise NotUnderstood(f"the sentence has {len(found)} words; use at most {MOST_WORDS}")
    while found and found[0].text in MARKS:
        del found[0]
    found = _undoubled(_of_program(sentence, _spelled(_trimmed(without_restarts(found)))))
    found = _unframed(arranged(rewritten(plain_regions(found), wordings()["early"])))
    found = repaired(rewritten(found, wordings()["repairs"]))
    found = _unframed(without_remarks(ordered(found)))
    found = repeated(rewritten(found, wordings()["plain"]))
    if len(found) > MOST_WORDS:
        raise NotUnderstood(f"the sentence has {len(found)} words; use at most {MOST_WORDS}")
    return _trimmed(found)


@cache
def _named() -> frozenset[str]:
    """Return the plainest words that name things, their colours and places."""
    kinds = {*NOUNS, "block", "brick", "thing", "tower", "table", "corner", "middle"}
    return frozenset(word for word in (*kinds, *(f"{kind}s" for kind in kinds), *COLORS) if len(word) > 3)


@cache
def known_words() -> frozenset[str]:
    """Return the words of the tables and of the rules, and the forms of verbs: these are spelled as they are meant."""
    table = read_yaml(RULES)
    rules = " ".join((*table.pop("parts").values(), *table.values()))
    rules = re.sub(r"\\[a-z]|<[A-Z_]+>", " ", rules)  # neither "\b" nor names of parts
    forms = (each[2] for name, verb in KNOWN.items() for phrase in said(verb) for each in inflections(name, phrase))
    return frozenset(re.findall(r"[a-z]+", " ".join([json.dumps(TABLE), rules, *names(), *forms, verb_words()])))


@cache
def spelling(word: str) -> str:
    """Return what a word surely is that has a letter too many or too few, or two letters swapped; "blok": "block"."""
    if len(word) < 4 or not word.isalpha() or word in known_words():
        return word
    near = [name for name in _named() if name[0] == word[0] and OSA.distance(name, word, score_cutoff=1) == 1]
    near = [name for name in near if len(name) != len(word) or sorted(name) == sorted(word)]
    return near[0] if len(near) == 1 else word


def _spelled(found: list[Token]) -> list[Token]:
    """Return the words with the names of things and colours as they are spelled, so that every rule knows them."""
    return [token._replace(text=spelling(token.text)) for token in found]


_CALL = re.compile(r"\w\(|\w\[|_\w|\b(?:drawer|fridge|table|cube|gripper|button|lever|wheel|hand|arm|robot)\.\w")


@cache
def _joining() -> dict[str, str]:
    """Return, for each phrase of a verb that has a goal, the preposition before that."""
    words = {"on": "on", "goal": "on", "in": "in", "out": "from"}
    found: dict[str, str] = {}
    for verb in KNOWN.values():
        joined = "from" if verb.act is Act.UNSTACK else words.get(verb.effect or "")
        for phrase in [*said(verb), *(each.split(" {")[0] for each in verb.templates)] if joined else ():
            found.setdefault(phrase, str(joined))
    return found


def _of_program(sentence: str, found: list[Token]) -> list[Token]:
    """Return the words of a sentence that is written like a program, "stack(red, cube.blue)", as of plain words."""
    if not _CALL.search(sentence):
        return found
    kept: list[Token] = []
    verb, relation = "", None
    for token in found:
        if token.text in ("on", "in") and sentence[token.end : token.end + 1] == "(":  # "on(gray, blue)"
            relation = token
            continue
        if token.text == "," and relation is not None:
            token, relation = token._replace(text=relation.text), None
        pair = f"{kept[-1].text} {token.text}" if kept else ""
        verb = next((each for each in (pair, token.text) if each in _joining()), "" if token.text in ";." else verb)
        inner = sentence[max(token.start - 1, 0) : token.end + 1]
        if token.text == "." and not re.search(r"\s", inner):
            continue
        if token.text == "," and verb and sentence[: token.start].count("(") > sentence[: token.start].count(")"):
            box = re.match(r"\W*(?:drawer|fridge|refrigerator)", sentence[token.end :])
            token = token._replace(text="in" if box and _joining()[verb] == "on" else _joining()[verb])
        if token.text in ("gripper", "arm", "robot") and sentence[token.end : token.end + 1] == ".":
            continue
        kept.append(token)
    return kept


def _is_begun(word: str, whole: str) -> bool:
    """Whether a word is the beginning of the name of a thing or colour after it: "but button"."""
    short = (
        "to",
        "or",
        "in",
        "on",
        "a",
        "at",
        "be",
        "so",
        "i",
        "do",
        "go",
        "no",
        "the",
        "that",
        "this",
        "cube",
        "block",
        "thing",
    )
    begun = word not in short and word.isalpha() and whole != word and whole.startswith(word)
    return begun and (whole in _named() or (len(word) < 3 and whole in verb_words().split("|")))


def _undoubled(found: list[Token]) -> list[Token]:
    """Return the words without stutters: "the the", "i want i want", "the but the button"."""
    begun = [_is_begun(token.text, after.text) for token, after in itertools.pairwise(found)]
    found = [token for token, is_begun in zip(found, [*begun, False], strict=False) if not is_begun]
    for size in (3, 2, 1):
        at = 0
        while at + 2 * size <= len(found):
            one, two = ([token.text for token in found[i : i + size]] for i in (at, at + size))
            if size > 1 and two[0] in ("please", "yeah", "okay") and one[0] != two[0]:  # "move it please move it"
                two = [token.text for token in found[at + size + 1 : at + 2 * size + 1]]
            if (
                one == two
                and one[0].isalpha()
                and not any(word in ",.;!?" for word in one[1:-1])  # "it in the drawer. shut the drawer. shut ..."
                and "very" not in one
                and not (size == 1 and one[0] in ("no", "stop", "chop"))
            ):
                del found[at : at + size]
            else:
                at += 1
    return found


def _unframed(found: list[Token]) -> list[Token]:
    """Return the words without the frames before commands."""
    for _ in range(3):
        shorter = rewritten(found, wordings()["frames"])
        if shorter == found:
            break
        found = shorter
    return found


def _trimmed(found: list[Token]) -> list[Token]:
    """Return the words without marks at both ends and after other marks."""
    kept: list[Token] = []
    for token in found:
        if token.text in MARKS and (not kept or kept[-1].text in MARKS):
            if kept and token.text != ",":
                kept[-1] = token
            continue
        kept.append(token)
    return kept


def plain_start(text: str) -> str:
    """Return plain words without the frames before a command."""
    return text_of(_trimmed(_unframed(scan(text))))


class Rule(NamedTuple):
    """A pattern and its replacement. anchor: a pattern of the places where it is tried; "": anywhere."""

    pattern: re.Pattern[str]
    replacement: str
    anchor: str


def rewritten(found: list[Token], rules: tuple[Rule, ...]) -> list[Token]:
    """Return the words after some rules. New words stand for all words that the pattern matched."""
    text, places = text_of(found), {}
    for pattern, replacement, anchor in rules:
        for _ in range(REWRITES):
            if anchor and anchor not in places:
                places[anchor] = [place.start() for place in re.finditer(anchor, text)]
            tried = (pattern.match(text, at) for at in places[anchor]) if anchor else [pattern.search(text)]
            match = next(filter(None, tried), None)
            if match is None:
                break
            after = _replaced(found, match, replacement)
            if after == found:
                break
            found = after
            text, places = text_of(found), {}
    return found


def _replaced(found: list[Token], match: re.Match[str], replacement: str) -> list[Token]:
    at, places = 0, []
    for token in found:
        places.append(at)
        at += len(token.text) + 1

    def within(start: int, end: int) -> list[Token]:
        return [token for token, place in zip(found, places, strict=True) if start <= place < end]

    whole = within(match.start(), match.end())
    start, end = (whole[0].start, whole[-1].end) if whole else (0, 0)
    new: list[Token] = []
    for piece in replacement.split():
        if piece[0] == "\\":
            new += within(*match.span(int(piece[1:])))
        else:
            new.append(Token(piece, start, end))
    return [*within(0, match.start()), *new, *within(match.end(), 1 << 30)]


def repaired(found: list[Token]) -> list[Token]:
    """Return the words without what a speaker took back: "the blue no wait the orange cube"."""
    text = text_of(found)
    for match in _REPAIR.finditer(text):
        first = text[: match.start()].count(" ")
        before, after = found[:first], found[first + len(match[0].split()) :]
        if (
            not before
            or not after
            or (len(before) < 2 and not re.fullmatch(rf"{verb_words()}|{COLOR}", before[0].text))
        ):
            continue
        cut = _taken_back(before, after)
        if cut is not None:
            return repaired([*before[:cut], *after])
    return found


_TAKING_BACK = (
    r"(?:no actually|actually(?= (?:just|only)\b)|no hang on|no hold on|wait hold on|hang on no|well no|or no|oh no"
    r"|no not|no wait|wait no|no no"
    r"|no sorry|sorry no|i mean|i meant|or rather|sorry|no|wait|scratch that|make that|oops|actually no|no i mean"
    r"|hold on(?! to)|hang on(?! to)|wait actually"
    r"|no make it|make it|better make it|no better|better|correction|(?<!i )(?<!you )(?<!what )meant)"
)
_SEVERAL = re.compile(r"\b(?:(?:both|all|each|two)(?: of)?(?: them| these| those)?|them|those|these)(?: ,| well)*$")
_REPAIR = re.compile(rf"(?<= )(?:[,.;] )?{_TAKING_BACK}(?:(?: ,)? (?:{_TAKING_BACK}|actually))*(?: ,)?(?= )")


def _taken_back(before: list[Token], after: list[Token]) -> int | None:
    """Return from which word on the words before a repair are taken back; None: it repairs nothing."""
    words = [token.text for token in before]
    while after and after[-1].text in ".!?;":
        after = after[:-1]
    same = 0  # "the red is for her, sorry, the blue is for her"
    while same < min(len(words), len(after)) and words[-1 - same] == after[-1 - same].text:
        same += 1
    if 1 < same < min(len(words), len(after)):
        return _taken_back(before[:-same], after)
    first = next(
        (token.text for token in after if token.text not in ("just", "only", "please", "rather", "here", "over")), ""
    )
    start = max((i + 1 for i, word in enumerate(words) if word in ".;!?"), default=0)
    if re.fullmatch(verb_words(), first):
        verbs = [i for i in range(start, len(words)) if re.fullmatch(verb_words(), words[i])]
        whole = start if words[start:] and words[-1] in ("it", "that", "them") else None  # "into the drawer with it"
        return verbs[-1] if verbs else whole
    prepositions = set(phrases("in, on, into, to, onto, behind, under, near, left, right, from, between, next, out"))
    heads = names()
    if first in prepositions:
        starts = [i for i in range(start, len(words)) if words[i] in prepositions]
        return starts[-1] if starts else None
    if not any(token.text in heads for token in after[:4]):
        return None
    verbs = [i for i in range(start, len(words)) if re.fullmatch(verb_words(), words[i])]
    if verbs and prepositions & set(words[verbs[-1] + 1 :]) and prepositions & {token.text for token in after[1:4]}:
        return verbs[-1] + 1  # "stack red on blue no wait blue on red"
    at = len(words)
    while at > start and (words[at - 1] in heads or words[at - 1] in FILLERS | {"a", "an", ",", "one"}):
        at -= 1
    if at == len(words) and (several := _SEVERAL.search(" ".join(words[start:]))):
        return len(words) - len(several[0].split())
    if at == len(words) > start + 1 and words[-1] not in prepositions and not re.fullmatch(verb_words(), words[-1]):
        at -= 1  # "press the bottom I mean the button"
    return at if at < len(words) else None


@cache
def wordings() -> dict[str, tuple[Rule, ...]]:
    """Return the rules of `wordings.yaml`, a tuple for each of its sections but "parts"."""
    table = read_yaml(RULES)
    parts = {**table["parts"], "V": f"(?:{verb_words()})", "COLOR": f"(?:{COLOR})"}
    for name in ("frames", "early", "repairs", "plain", "forms", "questions"):
        for part in (*parts, *parts):  # parts may name parts
            table[name] = table[name].replace(f"<{part}>", parts[part])
    frames = "\n".join(f"{parts['START']}(?:{line})(?: [,:])?(?= |$) ==> " for line in table["frames"].splitlines())
    swapped = (line.split(" ==> ", 1) for line in table["questions"].splitlines())
    asking = "\n".join(f"{pattern} ==> {kind}" for kind, pattern in swapped)
    split = (line.split(" ==> ", 1) for line in table["forms"].splitlines())
    whole = "\n".join(f"^{pattern}$ ==> {plain}" for pattern, plain in split)
    rules = {"frames": frames, **{name: table[name] for name in ("early", "repairs", "plain")}}
    found = {name: _rules(lines, ("^", parts["START"])) for name, lines in rules.items()}
    return {**found, "forms": _rules(whole, ()), "questions": _rules(asking, ())}


def questions() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Return the kinds of answers, each with the pattern of the questions that it answers."""
    return tuple((kind, pattern) for pattern, kind, _ in wordings()["questions"])


def _rules(lines: str, anchors: tuple[str, ...]) -> tuple[Rule, ...]:
    """Return the rules of some lines. One whose pattern begins with an anchor is tried where that matches alone."""
    found = []
    for line in lines.splitlines():
        pattern, _, replacement = line.partition(" ==>")
        anchor = next((each for each in anchors if pattern.startswith(each)), "")
        found.append(Rule(re.compile(pattern.removeprefix(anchor)), replacement.strip(), anchor))
    return tuple(found)

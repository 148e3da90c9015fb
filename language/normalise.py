"""Text as it is typed and heard: from a sentence to plain words, each with its place in the sentence.

Rules are pairs of a pattern over the words, which single spaces separate, and their replacement; they run in order.
A rule for a wording ("give X a push") names no verb of the robot: it says the same in a plainer order.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from core.safe_files import read_yaml
from language.errors import NotUnderstood
from language.verbs import KNOWN, OBJECT, Act
from language.words import phrases

LONGEST_SENTENCE, MOST_WORDS = 600, 80  # characters as typed; words
REWRITES = 8  # times that one rule may change one sentence


class Token(NamedTuple):
    """A word in lower case or a mark, and its offsets in the sentence in characters."""

    text: str
    start: int
    end: int


_WORD = re.compile(
    r"[-=~]+>|[\u2190-\u21ff\u2794\u27a1]|\d+(?:[.,]\d+)?(?:st|nd|rd|th)?(?=\W|$|[a-z])"
    r"|[^\W\d_]+(?:['\u2019][^\W\d_]+)*|[.,;:!?&+/()*@-]|_|\d+"
)
_LONG = re.compile(r"([a-z])\1{2,}")  # "nooo"
_BULLET = re.compile(
    (
        r"(^|[\n;.,!?]|\s)\s*(?:\(?\d{1,2}[.):](?!\d)|[*\u2022\u25cf\u25e6\u00b7]|\(?[a-h]\)|step "
        r"\d{1,2}\s?[:.)]?)(?=\s)"
    ),
    re.I,
)
_DROPPED = frozenset({"-", '"', "*", "(", ")", "_", "the", "teh", "hte", "th", "tha"})
_SHORT = {  # without an apostrophe
    "dont": "do not",
    "cant": "can not",
    "wont": "will not",
    "doesnt": "does not",
    "isnt": "is not",
    "arent": "are not",
    "didnt": "did not",
    "couldnt": "could not",
    "shouldnt": "should not",
    "wouldnt": "would not",
    "whats": "what is",
    "wheres": "where is",
    "thats": "that is",
    "theres": "there is",
    "im": "i am",
    "ive": "i have",
    "youre": "you are",
    "youve": "you have",
    "lets": "let us",
    "gonna": "going to",
    "wanna": "want to",
    "gotta": "have to",
    "cannot": "can not",
    "gimme": "give me",
    "lemme": "let me",
    "pls": "please",
    "plz": "please",
    "plse": "please",
    "pleas": "please",
    "thx": "thanks",
    "u": "you",
    "ur": "your",
    "r": "are",
    "n": "and",
    "w": "with",
    "outta": "out of",
    "dunno": "do not know",
    "kinda": "kind of",
    "approx": "about",
    "ca": "about",
    "cuz": "because",
    "cos": "because",
    "ok": "okay",
    "k": "okay",
}
_CLITICS = {"ll": "will", "re": "are", "ve": "have", "m": "am", "d": "would"}
_BE = [
    "that",
    "there",
    "here",
    "what",
    "where",
    "who",
    "it",
    "how",
    "he",
    "she",
    "everything",
    "something",
    "nothing",
    "when",
    "why",
    "this",
]
_HUMS = frozenset(
    [
        "uh",
        "um",
        "erm",
        "er",
        "ah",
        "eh",
        "hm",
        "hmm",
        "hmmm",
        "uhm",
        "umm",
        "uhh",
        "ehm",
        "huh",
        "oh",
        "aha",
        "ahem",
        "euh",
        "ähm",
        "hmpf",
        "phew",
    ]
)


def scan(text: str) -> list[Token]:
    """Return the words and marks of a text: contractions written out; without articles, emoji and doubled words."""
    lowered = text.lower() if len(text.lower()) == len(text) else text
    found: list[Token] = []
    for match in _WORD.finditer(lowered):
        for word in _written_out(_LONG.sub(r"\1", match[0].replace("\u2019", "'"))):
            if not word or word in _DROPPED or word in _HUMS:
                continue
            found.append(Token(word, match.start(), match.end()))
    return found


def _written_out(word: str) -> list[str]:
    if word[-1] in ">\u2192\u2794\u27a1":
        return ["to"]
    if word in _SHORT:
        return _SHORT[word].split()
    stem, mark, tail = word.partition("'")
    if not mark:
        return ["and"] if word in "&+" else [","] if word == "/" else ["at"] if word == "@" else [word]
    if word.endswith("n't"):
        return [{"ca": "can", "wo": "will", "sha": "shall"}.get(word[:-3], word[:-3]), "not"]
    if tail in _CLITICS:
        return [stem, _CLITICS[tail]]
    if tail == "s":
        return [stem, "us" if stem == "let" else "is"] if stem in (*_BE, "let") else [stem, "'s"]
    return [stem] if tail == "" else [word]


def normalised(sentence: str) -> list[Token]:
    """Return the plain words of a sentence. Raises NotUnderstood if it is too long."""
    if len(sentence) > LONGEST_SENTENCE:
        raise NotUnderstood(f"the sentence has {len(sentence)} characters; use at most {LONGEST_SENTENCE}")
    text = (
        _BULLET.sub(lambda m: m[1] + ";".rjust(len(m[0]) - len(m[1])), sentence)
        if _BULLET.search(sentence)
        else sentence
    )
    found = scan(text)
    if len(found) > 2 * MOST_WORDS:
        raise NotUnderstood(f"the sentence has {len(found)} words; use at most {MOST_WORDS}")
    while found and found[0].text in ".,;:!?":
        del found[0]
    found = _undoubled(_of_program(sentence, found))
    found = repaired(rewritten(_unframed(found), wordings()["repairs"]))
    for name in ("misheard", "plain"):
        found = rewritten(found, wordings()[name])
    found = without_remarks(found)
    if len(found) > MOST_WORDS:
        raise NotUnderstood(f"the sentence has {len(found)} words; use at most {MOST_WORDS}")
    return _trimmed(found)


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
    verb = ""
    for token in found:
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


def _undoubled(found: list[Token]) -> list[Token]:
    """Return the words without stutters: "the the", "i want i want"."""
    for size in (3, 2, 1):
        at = 0
        while at + 2 * size <= len(found):
            one, two = ([token.text for token in found[i : i + size]] for i in (at, at + size))
            if one == two and one[0].isalpha() and "very" not in one and not (size == 1 and one[0] in ("no", "stop")):
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


_REMARK = re.compile(
    r"^(?:but |and |so |because |since )?(?:i|he|she|they|we|it|there|that|this|someone|somebody|everyone|everybody"
    r"|nobody|(?:my|his|her|our|your|a|an) \w+|\w+(?: \w+)?)"
    r" (?:'s|is|are|was|were|am|has|have|had|will|would|likes?|loves?|hates?|forgot|put"
    r"|placed|bought|found|saw|changed|left|feels?|looks?|seems?"
    r"|thinks?|came|went|want|wants|needs? a|"
    r"do not|does not|did not|can not|could not|went|told|said|promise|hope|know)\b(?!.*\b(?:should|must|belongs|goes"
    r"|ought|shall|supposed)\b)"
)


def without_remarks(found: list[Token]) -> list[Token]:
    """Return the words without clauses that only remark something: "the light is off, press the button"."""
    parts: list[list[Token]] = [[]]
    for token in found:
        parts[-1].append(token)
        if token.text in ",.;!:":
            parts.append([])
    texts = [" ".join(token.text for token in part).rstrip(" ,.;!:") for part in parts]
    commands = [
        bool(re.match((rf"(?:and |then |so |please |to |you |just |now )*(?:{verb_words()})\b"), text))
        for text in texts
    ]
    if not any(commands):
        return found
    scene = re.compile(
        rf"\b(?:{COLOR}|cubes?|blocks?|one|drawer|fridge|refrigerator)\b.* (?:in|on|next|to|at|behind|under|left"
        rf"|right|between|be)\b"
    )
    asks = re.compile(
        rf"^(?:and |but |then )*(?:on|in|at|to|into|onto|next|near|behind|under|between|from|by|over|with)\b"
        rf"|\b(?:{verb_words()})\b.*\b(?:{COLOR}|button|lever|wheel|switch|drawer|fridge|lid|cube|block)s?\b"
    )
    kept: list[Token] = []
    for part, text, command in zip(parts, texts, commands, strict=True):
        if command or not _REMARK.match(text) or scene.search(text) or asks.search(text):
            kept += part
        elif (named := _NAMED.search(text)) and not kept:  # what "it" means afterwards
            first = text[: named.start()].count(" ")
            kept += [*part[first : first + len(named[0].split())], Token(",", part[-1].start, part[-1].end)]
    return kept or found


_NAMED = re.compile(
    r"\b(?:(?:red|blue|yellow|orange|cyan|gray|grey) (?:cube|block|one|box|brick)"
    r"|drawer|fridge|refrigerator|button|lever|wheel)\b"
)


def _trimmed(found: list[Token]) -> list[Token]:
    """Return the words without marks at both ends and after other marks."""
    kept: list[Token] = []
    for token in found:
        if token.text in ",;:.!?" and (not kept or kept[-1].text in ",;:.!?"):
            if kept and token.text != ",":
                kept[-1] = token
            continue
        kept.append(token)
    return kept


def plain_start(text: str) -> str:
    """Return plain words without the frames before a command."""
    return " ".join(token.text for token in _trimmed(_unframed(scan(text))))


Rule = tuple[re.Pattern[str], str]


def rewritten(found: list[Token], rules: tuple[Rule, ...]) -> list[Token]:
    """Return the words after some rules. New words stand for all words that the pattern matched."""
    text = " ".join(token.text for token in found)
    for pattern, replacement in rules:
        for _ in range(REWRITES):
            match = pattern.search(text)
            if match is None:
                break
            after = _replaced(found, match, replacement)
            if after == found:
                break
            found = after
            text = " ".join(token.text for token in found)
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


@cache
def verb_words() -> str:
    """Return a pattern for the first words of all verbs, as they are or inflected."""
    words = {phrase.split()[0] for verb in KNOWN.values() for phrase in said(verb)}
    return "|".join(
        sorted(words - {"i", "can", "could", "may", "we", "let", "have", "over", "show"}, key=len, reverse=True)
    )


def said(verb) -> list[str]:
    """Return the phrases of a verb: the words before the object in its templates, and its further words."""
    own = [template.removesuffix(f" {OBJECT}") for template in verb.templates if template.endswith(OBJECT)]
    own = [phrase for phrase in own if "{" not in phrase and verb.act is not Act.HOLD]
    return list(dict.fromkeys([*own, *(phrases(verb.words) if verb.words else [])]))


def repaired(found: list[Token]) -> list[Token]:
    """Return the words without what a speaker took back: "the blue no wait the orange cube"."""
    text = " ".join(token.text for token in found)
    for match in _REPAIR.finditer(text):
        first = text[: match.start()].count(" ")
        before, after = found[:first], found[first + len(match[0].split()) :]
        if not before or not after or len(before) < 2:
            continue
        cut = _taken_back(before, after)
        if cut is not None:
            return repaired([*before[:cut], *after])
    return found


_REPAIR = re.compile(
    r"(?<= )(?:, )?(?:no actually|no hang on|hang on no|well no|or no|oh no|no not|no wait|"
    r"wait no|no no|no sorry|sorry no|i mean|i meant|or rather|sorry|no|wait|scratch that|make "
    r"that|oops"
    r"|no actually|actually no|no i mean|no make it|correction)(?: ,)?(?= )"
)


def _taken_back(before: list[Token], after: list[Token]) -> int | None:
    """Return from which word on the words before a repair are taken back; None: it repairs nothing."""
    first, words = after[0].text, [token.text for token in before]
    start = max((i + 1 for i, word in enumerate(words) if word in ".;!?"), default=0)
    if re.fullmatch(verb_words(), first):
        verbs = [i for i in range(start, len(words)) if re.fullmatch(verb_words(), words[i])]
        return verbs[-1] if verbs else None
    from language.words import FILLERS, colors, nouns

    prepositions = {
        "in",
        "on",
        "into",
        "to",
        "onto",
        "behind",
        "under",
        "near",
        "left",
        "right",
        "from",
        "between",
        "next",
    }
    heads = {noun for kinds in nouns().values() for noun in kinds} | set(colors())
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
    return at if at < len(words) else None


@cache
def wordings() -> dict[str, tuple[Rule, ...]]:
    """Return the rules of `wordings.yaml`: "frames", "misheard" and "plain"."""
    table = read_yaml(Path(__file__).with_name("wordings.yaml"))
    parts = {**table["parts"], "V": f"(?:{verb_words()})"}
    for name in ("frames", "repairs", "misheard", "plain", "questions"):
        for part in (*parts, *parts):  # parts may name parts
            table[name] = table[name].replace(f"<{part}>", parts[part])
    frames = "\n".join(f"{parts['START']}(?:{line})(?: [,:])?(?= |$) ==> " for line in table["frames"].splitlines())
    swapped = (line.split(" ==> ", 1) for line in table["questions"].splitlines())
    asking = "\n".join(f"{pattern} ==> {kind}" for kind, pattern in swapped)
    names = ("repairs", "misheard", "plain")
    return {"frames": _rules(frames), "questions": _rules(asking), **{name: _rules(table[name]) for name in names}}


def questions() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Return the kinds of answers, each with the pattern of the questions that it answers."""
    return tuple((kind.strip(), pattern) for pattern, kind in wordings()["questions"])


def _rules(lines: str) -> tuple[Rule, ...]:
    found = []
    for line in lines.splitlines():
        pattern, _, replacement = re.sub(r"(?<![a-z])the ", "", line).partition(" ==>")
        found.append((re.compile(pattern), replacement))
    return tuple(found)


COLOR = "red|blue|yellow|orange|cyan|gray|grey|green|pink|purple|white"

"""What the words of a turn do beside naming things: signals about the motion, short replies, small talk, questions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

from rapidfuzz.distance import OSA

from language.costs import SPELLING
from language.embedded import TELLING, direct
from language.lattice import STRANGERS, spellings, undoubled, vocabulary
from language.normalise import plain_start, wordings
from language.remarks import command, is_chat
from language.scanning import COLOR, MARKS, THING, Token, scan, text_of, verb_words
from language.signalling import BETTER_BEFORE, PLACES, STARTING, plainest
from language.words import CONTROLS, FILLERS, TABLE, names, phrases

_JOINS = (",", "and", "then", ";")
JOINING = frozenset(("and", "then", "another", "do", "now"))  # beside how often something is done once more
IDLE = ("social", "yes", "stop", "wait", "continue", "faster", "slower")  # these change no command that they go with
_HOME = re.compile(rf"\b(?:{STARTING}) (?:{PLACES}|configuration|stance)\b")
_A_BIT_BACK = re.compile(  # "too far, move it back a little"
    r"^(?:too (?:far|much) )?(?:(?:now |please )*(?:come|go|move|bring|put|push|pull|take)(?: it| that)? )?"
    r"(?:back(?: by)?(?: just)? (?:a )?(?:tiny |little |small )*(?:bit|little|tad|touch|notch|smidge)"
    r"|(?:a )?(?:tiny |little |small )*(?:bit|little) back)(?: please| again)*$"
)
_ADVERBS = frozenset(
    phrases("so, too, very, pretty, really, actually, just, simply, honestly, quite, even, totally, literally")
)
SIGNALS = ("stop", "wait", "continue", "home", "undo", "again", "faster", "slower")
_NEGATED = re.compile(
    r"(?:(?:please|no|but|and|oh|you|just) )*(?:need not|do not (?:have|need) to|no need to"
    r"|do not|never(?! mind)|must not|should not|shall not)(?: (?:ever|please|you dare))? (?P<rest>.+)"
)
BITS = frozenset(("bit", "little", "tad", "touch", "notch", "smidge", "slightly", "further"))
MOST_OF_SIGNAL = 16  # words of a signal that is said as a wish
MOST_MISSPELT = 5  # words of a signal or a reply of which one may be misspelt


class Part(NamedTuple):
    """The words between two marks, their characters in the sentence, and what they do that say nothing else.

    act: a key of `CONTROLS` or of the replies in `words.yaml`, or "social"; None: they say something else. mark: after
    it.
    """

    start: int
    end: int
    words: tuple[str, ...]
    act: str | None
    mark: str = ""


_EMPTY = Part(0, 0, (), None)


@cache
def _phrases() -> dict[tuple[str, ...], str]:
    """Return the phrases of signals, replies and small talk, each with what it does."""
    social = f"{TABLE['social']}, {TABLE['invitations']}"
    tables = {**CONTROLS, **TABLE["replies"], "social": social, "polite": TABLE["polite"]}
    found = ((act, _plain(t.text for t in scan(p))) for act, text in reversed(tables.items()) for p in phrases(text))
    return {words: act for act, words in found if words}


def _plain(words: Iterable[str]) -> tuple[str, ...]:
    """Return words without adverbs, and with one name for the place where the arm rests."""
    text = re.sub(r"\btoo (?=(?:fast|quick)\b)", "too-", " ".join(words))
    text = re.sub(r"\bmuch (?=(?:nicer?|good|prettier|tidier|neater|easier|clearer)\b)", "", text)
    text = re.sub(r"\bless (?:quick(?:ly)?|fast)\b", "slower", text)
    text = re.sub(r"\b(further|farther|more) (?:still|yet)\b|\b(?:still|yet) (?=a (?:bit|little)\b)", r"\1", text)
    text = _A_BIT_BACK.sub("back a bit", text)
    text = _HOME.sub("home position", " ".join(word for word in text.split() if word not in _ADVERBS))
    text = re.sub(r"^(?:but )?(?:you|that) (?:have |did )?\w+ (?:it )?(?:in |on |at )?wrong \w+$", "wrong one", text)
    return tuple(re.sub(r"\b(?:stop|quit|cease) \w+ing\b(?: it| that)?$", "stop", text).split())


@cache
def _corrected(word: str) -> str:
    """Return the word of a signal or a reply that is typed with one wrong letter; any other word as it is."""
    said = {each for phrase in _phrases() for each in phrase if len(each) > 3}
    if len(word) < 4 or word in vocabulary() or word in STRANGERS or word in said:
        return word
    near = [each for each in said if each[0] == word[0] and OSA.distance(each, word) == 1]
    swapped = [each for each in near if sorted(each) == sorted(word)]
    near = swapped or [each for each in near if undoubled(each) == undoubled(word)] or near
    close = {each for each, cost in spellings(word) if cost <= SPELLING}
    named = names() & close
    return near[0] if len(near) == 1 and not named else word


def act_of(words: Sequence[str]) -> str | None:
    """Return what words do that consist of signals, replies and small talk; None if they say something else."""
    said = " ".join(words)
    if (negated := _NEGATED.match(said)) and _plain(words) not in _phrases():  # "do not go home", "don't stop"
        act = act_of(negated["rest"].split())
        if act in SIGNALS:
            return "continue" if act in ("stop", "wait", "continue") else "social"
        return None if (act := _act_of(tuple(words))) in SIGNALS and act != "stop" else act
    if BETTER_BEFORE.match(said):  # before its "first place" is read as where the arm rests
        return "undo"
    if (act := _act_of(tuple(words))) is not None or len(words) > MOST_OF_SIGNAL:
        return act
    act = _act_of(tuple(plain.split())) if (plain := plainest(said)) != said else None
    if act in SIGNALS:
        return act
    praised = (end for end in range(len(words) - 1, 0, -1) if _act_of(tuple(words[:end])) == "social")
    after = act_of(words[end:]) if (end := next(praised, 0)) else None  # "better, undo the last one"
    return after if after in SIGNALS else None


@lru_cache(maxsize=4096)  # parts of a sentence are asked for several times
def _act_of(words: tuple[str, ...]) -> str | None:
    known, words = _phrases(), _plain(words[1:] if len(words) > 1 and words[0] == "and" else words)
    words = words if len(words) > MOST_MISSPELT else tuple(map(_corrected, words))
    count = len(words)
    longest = max(map(len, known))
    best: list[tuple[int, tuple[str, ...]] | None] = [None] * count + [(0, ())]
    for at in range(count - 1, -1, -1):
        for end in range(min(count, at + longest), at, -1):
            rest, act = best[end], known.get(tuple(words[at:end]))
            if act and rest and (best[at] is None or rest[0] + 1 < best[at][0]):  # type: ignore[index]
                best[at] = rest[0] + 1, (act, *rest[1])
    acts = [act for act in (best[0] or (0, ()))[1] if act != "polite"]
    told = {"said", "meant", "mean", "far"} & {*words} or words[-2:-1] == ("no",)
    if words[-1:] == ("right",) and (told or BITS & {*words}):  # "I said right", "a bit right" tell a side
        return None
    strong = [act for act in acts if act not in ("social", "sorry", "yes", "no")]
    if "no" in acts and strong == ["again"]:
        return "wrong"
    if "undo" in strong:
        return "undo"
    return next(iter([*strong[-1:], *(act for act in ("no", "yes", "sorry", "social") if act in acts)]), None)


def says(sentence: str, table: str) -> bool:
    """Whether a sentence has a phrase of a table of `words.yaml`, such as "greetings"."""
    text = text_of(scan(sentence))
    return any(re.search(rf"\b{re.escape(phrase)}\b", text) for phrase in phrases(TABLE[table]))


def parts_of(sentence: str) -> list[Part]:
    """Return the parts of a sentence between its marks."""
    found: list[Part] = []
    words: list[Token] = []
    for token in [*scan(sentence.replace(" - ", " , ")), Token(".", len(sentence), len(sentence))]:
        if token.text not in MARKS:
            words.append(token)
        elif words:
            texts = tuple(word.text for word in words)
            found.append(Part(words[0].start, words[-1].end, texts, act_of(texts), token.text))
            words = []
    sided = [  # "no, right", "right, not left"
        part.words == ("right",) and (before.act == "no" or after.words[:1] == ("not",))
        for before, part, after in zip([_EMPTY, *found], found, [*found[1:], _EMPTY], strict=False)
    ]
    return [part._replace(act=None) if side else part for part, side in zip(found, sided, strict=True)]


_LEFT = re.compile(
    r"(?:(?:or|no|wait|hang on|hold on|actually|but|just|please|better|rather|well|oh|hm|on second thoughts?) )*"
    r"(?:(?:leave|keep|let) (?:it|that|them|everything|things)"
    r"(?: (?:(?:where|as|how|like) (?:it|they|that|things) (?:is|are|was|were)|alone|be|there|here))?"
    r"|never mind|nevermind|forget (?:it|that|about it)|do not)(?: for now| after all| then| please)*"
)
_WAITS = re.compile(r"\b(?:wait|no|actually|second thoughts?|hang on|hold on|rather|better)\b")


def takes_back(parts: Sequence[Part]) -> bool:
    """Whether the last part of a sentence takes its command back: "put it there, or wait, leave it where it is"."""
    last = next((at for at, part in enumerate(parts) if at and _LEFT.fullmatch(" ".join(part.words))), 0)
    said = " ".join(word for part in parts[1:] for word in part.words)
    if re.search(r"\b(?:if not|otherwise|else)\b", said):
        return False
    return last == len(parts) - 1 > 0 and parts[0].act is None and _WAITS.search(said) is not None


def stops_after_all(parts: Sequence[Part]) -> bool:
    """Whether a sentence ends with "no" or "stop" after a command; "..., then leave it" is part of the command."""
    first, last = parts[0], parts[-1]
    otherwise = re.search(r"\b(?:if not|otherwise|else)\b", " ".join(word for part in parts for word in part.words))
    said = last.act in ("no", "stop") and last.words[0] != "then" and not otherwise
    return len(parts) > 1 and said and first.act is None and len(first.words) > 1


def says_nothing(part: Part) -> bool:
    """Whether a part is small talk, about people or the occasion, or a few words that name nothing: "cheese!"."""
    strange = [word for word in part.words if len(word) > 1 and word not in FILLERS]
    cry = len(part.words) <= 3 and not any(word in vocabulary() or word in STRANGERS for word in strange)
    return part.act == "social" or (part.act is None and (cry or is_chat(part.words)))


# ---- Sentences without what says nothing more


def without_idle(sentence: str, parts: list[Part]) -> str:
    """Return a sentence with blanks where parts say nothing that matters to the others, and "no" where they correct."""
    said = False
    for part in parts:
        sentence = _without_small_talk(sentence, part)
    if all(part.act in IDLE for part in parts):
        return sentence
    for part in parts:
        corrects = part.act in ("no", "wrong", "sorry")
        if part.act is not None and part.act not in IDLE and not corrects:
            break
        if part.act is None:
            said = True
        elif not (said and part.act != "social"):
            kept = "no" if corrects else ""
            sentence = f"{sentence[: part.start]}{kept.ljust(part.end - part.start)}{sentence[part.end :]}"
    return re.sub(r"^\W*no\b(?:\W*[,.;!]\W*no\b)*\W*[.;!]\W+(?=\w)", lambda m: "no,".ljust(len(m[0])), sentence)


def beside_home(sentence: str) -> tuple[int, int]:
    """Return where a sentence begins after "go home and then", and where it ends before "and then go home"."""
    tokens = [token for token in scan(sentence) if token.text not in ".!?"]
    joints = [at for at, token in enumerate(tokens) if at and token.text in _JOINS]

    def goes(part: list[Token]) -> bool:
        return act_of([token.text for token in part if token.text not in _JOINS]) == "home"

    after = [token for token in tokens[joints[0] :] if token.text not in _JOINS] if joints else []
    start = after[0].start if after and goes(tokens[: joints[0]]) else 0
    return start, next((tokens[at - 1].end for at in joints if goes(tokens[at + 1 :])), len(sentence))


def _without_small_talk(sentence: str, part: Part) -> str:
    """Return a sentence with blanks where a part begins with small talk before a command: "haha now open it"."""
    words = part.words
    for end in range(len(words) - 1, 0, -1) if part.act is None else ():
        if words[end - 1] in ("is", "that", "it", "this", "you", "was", "i"):  # "yes, that is what I meant"
            continue
        chat = act_of(words[:end]) in ("social", "yes") and any(act_of([word]) == "social" for word in words[:end])
        rest = " ".join(words[end:])
        if chat and (command().match(rest) or question(rest)):
            start = part.start + scan(sentence[part.start : part.end])[end].start
            return f"{sentence[: part.start]}{' ' * (start - part.start)}{sentence[start:]}"
    return sentence


# ---- Questions

_LENGTH = r"(?:\d\S*|one|two|three|four|five|six|seven|eight|nine|ten) ?(?:cm|mm|centi|milli|inch)"
_PLAINER = tuple(  # a whole sentence -> the same, as other rules know it
    (re.compile(rf"^\W*{pattern}\W*$", re.I | re.S), plain)
    for pattern, plain in (
        (  # "the drawer is empty, no?"
            r"([^,.;:!?]*\b(?:is|are|was|were|has|have)\b(?! to\b)[^,.;:!?]*),?\s*"
            r"\b(?:no|nope|yes|yeah|eh|huh|correct|true)\s*\?",
            r"\1, is it not?",
        ),
        (  # "correction, make that 5 centimetres"
            r"(?:(?:no|correction|actually|wait|sorry|better)\W+)*make (?:it|that|this)(?: just| only)? "
            rf"({_LENGTH}.*?)(?:\W+(?:instead|rather))?",
            r"no, \1",
        ),
        (  # "wait, that was supposed to be orange, not gray"
            r"(?:(?:no|wait|sorry|oh|hang on)\W+)*(?:that|it|this) was (?:supposed|meant) to be "
            r"((?!in\b|on\b|at\b|next\b|left\b|right\b|open|closed|shut)[^,.;]+?)(?:\W+not [^,.;]+?)?",
            r"no, \1",
        ),
        (  # "if there is something inside take it out"
            r"(.*\bif there(?:['\u2019]?s| is) (?:something|anything|a cube|a thing|one)(?: still)?) "
            r"(?:inside|in there)(?: then| ,)? ((?:take|get|bring|pull)\b.+)",
            r"\1 in it, \2",
        ),
        (r"(.+?) (?:is|was) what i (?:said|meant|wanted|asked for|had in mind)\b.*", r"no, \1"),
        (r"(?:(?:no|sorry|wait|oh)\W+)*i (?:meant|mean|said) (?:to |on )?(?:the )?(left|right)", r"no, \1"),
        (r"(?:(?:a|some) )?different (?:one|cube|block|thing)(?:\W+(?:please|instead|now))*", "no, a different one"),
        (
            r"(?:(?:no|sorry|wait|oh|actually|excuse me|scratch that)\W+)+i (?:said|meant) (?!i\b)(.+)",
            r"no, i meant \1",
        ),
        (r"(.*)\bif and only if\b(.+)", r"\1if\2"),
        (r"(?:(?:no|but|okay|it is)\W+)*my turn\W*(?:now)?\W+(.+)", r"\1"),
        (  # "I didn't say on it, I said beside it"
            r"i (?:did not|didn['\u2019]?t|never) sa(?:y|id) [^.;]*?[,.;]\s*i (?:said|meant) (.+)",
            r"no, \1",
        ),
        (r"(?:by|with) (?:the )?[\"'“]?(?:the )?[\w ]+?[\"'”]?,? i meant (.+)", r"no, i meant \1"),
        (
            r"(?:on second thoughts?|actually|oh wait),? (?:i|we) (?:do not|don['\u2019]?t) (?:need|want)(?: to have)? "
            r"(?:the |that )?(?:drawer|fridge)(?: open| closed)?",
            "undo that",
        ),
        (  # "red, no wait, yellow"
            r"(?:(?:um+|uh|er+m?|hm+)\W+)?(?:\w+ ){0,2}\w+\W+no,? wait\W+(\w+(?: \w+){0,2}?)(?:\W+(?:yeah|yes)\W+\1)?",
            r"\1",
        ),
        (  # "can you get out of the way, I need to reach in there"
            r"(.*\b(?:out of (?:the|my|our) way|step back|back off)\b[^,.;]*)[,.;]\s*(?:i|we) "
            r"(?:need|want|have|must|am trying)(?: to)? (?:reach|get|look|see|clean|wipe|fix|check)\b.*",
            r"\1",
        ),
        *(
            (rf"(?:number|no\.|option|nr\.?) ?(?:{number})", f"the {rank} one")
            for number, rank in (("1|one", "first"), ("2|two", "second"), ("3|three", "third"))
        ),
        (
            r"(?:and |then |do |give me )*(two|three|four) more(?: of (?:those|these|them|that)| like that)",
            r"\1 more times",
        ),
    )
)


def plainly(sentence: str) -> str:
    """Return a statement with a tag as the question that it is, and a correction as one that begins with "no"."""
    for pattern, plain in _PLAINER:
        sentence = pattern.sub(plain, sentence)
    return sentence


_OPENING = re.compile(
    r"^(?:(?:excuse me|wait|hang on|hold on|pardon(?: me)?|sorry(?: to (?:bother|ask|disturb)(?: you)?)?"
    r"|(?:just )?(?:one|a|quick|small)(?: quick| small| last)? question"
    r"|(?:he|she|they|(?:my|her|his) \w+) (?:wants to know|want to know|asks?|wonders?)(?: if| whether)?"
    r"|kindly|dear|may i ask(?: you)?|i (?:meant|wanted|would like|want) to ask|by the way|and|so|but|well|hey|okay"
    r"|robot(?! (?:has|is|was|did)\b)|please|then|now|hi|hello"
    rf"|{TELLING}|(?:do you |you )?have (?:you )?(?:any|an) idea|please tell me|tell me please|can you say"
    r"|(?:can|could|would|might|may|will) you (?:please )?tell me"
    r"|(?:can|could|would|will) you(?: please)?(?= (?:count|list|name|describe) (?!out\b))"
    r"|(?:(?:can|could) you (?:please )?)?(?:check|find out|see|show me)"
    r"(?= (?:what|where|which|who|how many)\b(?!.* and ))"
    r"|go(?: and)?(?= (?:check|find out|see)\b)|just|also|(?:roughly|about|approximately|exactly)(?= how\b)|,) )+"
)
ABLE = re.compile(  # about things in general
    r"^(?:can|could|are) you (?:\w+ ){1,3}"
    r"(?:things|stuff|objects|items|cubes|blocks|towers|stacks|drawers|doors|buttons|levers|wheels)"
    r"(?: up| down| out| together| around| over)?$"
)
_VOCATIVE = re.compile(
    r" , (?:(?:my|dear|young|good|old) )*"
    r"(?:man|boy|lady|friend|robot|sir|dear|love|darling|mate|buddy|honey|sweetie|pal|guv)(?= ,|$)"
)
_AT_ONCE = re.compile(
    r"^(?:can|could|are) you .*\b(?:two|three|both|several|many|more than one)\b.*"
    r" (?:at once|at same time|simultaneously)$|^(?:can|could) you (?:lift|carry|take|hold|move) .*\bboth together$"
)
_OR_IS = re.compile(r"^(?:can|could) you .* or (?:is|are) (?:it|they|there|something|anything)\b")
_ASKING = re.compile(
    r"^(?:what|who|whom|why|how|where|which|whose|when(?= (?:is|are|was|were|did|will|do|can)\b))\b(?! (?:about|if)\b)"
    r"|^(?:is|are|was|were|does|did|has|am|have (?:they|we|i|he|she|people|some ?one|any ?one|some ?body|any ?body)) "
    r"|^(?:do|can|could|will) (?:you|i|we) (?:see|hold|know|hear|understand"
    r"|remember|feel|speak|talk|say|fly|still|really|even|love|get tired|sleep|dream|fit)\b"
    r"|^(?:do|can) (?:you|we) have\b"
    rf"|{ABLE.pattern}"
    rf"|{_AT_ONCE.pattern}"
    r"|^(?:do|did) (?:you|i|we|they)\b|^(?:can|could|may|should) (?:i|one) (?!have\b|get\b|please\b)"
    r"|^do (?!it|that|what).*\b(?:have|contain|hold)\b"
    r"|^(?:would|does|will|could|can|should(?!.*,)) (?!you\b|we\b|i\b)(?!.*\bplease\b)"
    r".*\b(?:fit|go|work|lie|stand|sit|stay)\b"
    r"|^(?:can|could|will|would) you (?:please )?help(?: me| us)?(?: out)?(?: here| please| a bit)*$"
    r"|^(?:can|could|does|will) (?!you\b|we\b|i\b|.*\bplease\b).*\b(?:hold|take|store|contain)"
    r" (?:two|three|both|more|several|many|all|another)\b"
    r"|^(?:help|help me|help please|i need help|commands|options|instructions|anything else)$"
    r"|^have you |^(?:list|enumerate|name (?:me|all|every|cubes|blocks|things))\b"
    rf"|{_OR_IS.pattern}"
    r"|^(?:your|my) (?:left|right)\b.* or (?:mine|yours|my|your)\b|^(?:left|right) (?:from|as|for|of) .*\bwho"
    r"|^(?:can|could|would) you .* if i (?:asked|told|wanted|ask|tell|want)(?: you)?(?: to)?$"
    r"|^describe (?!how)|^(?:any(?! chance| way| possibility)|some|anything|something)\b"
    r"(?!.*\b(?:must|should|has to|goes?|put|needs?|belongs?)\b)"
    r".* (?:in|on|there|open)\b|^(?:there is )?(?:nothing|something|anything) .*in (?:your|my|robot) |^can i ask "
    r"|^you (?:see|hear|have|hold) |\b(?:what you can do|what can you do|what you see|what you are holding"
    r"|what i can say|how many .*)$"
)
_REQUESTING = re.compile(
    r"does not|let go of |(?:give|hand|put|drop|place|pass|bring|set|lay|leave|stack|store|release|return|open|close) "
    rf"|why not (?:both|all|either|them|it|that|this|{COLOR}|{THING})\b"
    r"|(?:are|is) you able to|will you (?!still)|could you (?!see|hear|help|.* if i (?:ask|told|tell|want))"
)


_EMPHASIS = re.compile(  # "where on earth is it", "where is it, if I may ask"
    r"^(who|what|where|why|how|which) (?:on earth|in (?:all )?(?:world|heaven)|hell|heck"
    r"|exactly|precisely|actually|specifically|roughly)\b"
    r"|(?: ,)? if (?:i|you|we) (?:may|can|could|might) (?:ask|tell me|say)$"
    r"|(?: [,.])? (?:i|we) (?:can|could|do) not (?:see|find|spot|reach)(?: it| them)?(?: any\w+)?$"
    r"|(?<!done)(?<!did)(?: ,)? for (?:me|us)$"
)
_PLEASE = re.compile(
    r"^((?:what|which|who|where|how|why|is|are|was|were|did|does)\b.*?)(?: ,)?(?: (?:please|thanks|robot))+$"
)
WHAT = ("what", "where", "which", "how", "who", "why", "whose")
_ASKS = (
    *WHAT,
    *phrases("many, much, far, tall, high, colour, color, colours, colors, there, you, any, are, did, does"),
)


def _spelled(asked: str) -> str:
    """Return a question with its first words as they are spelled: "whre is it", "how mny cubes", "can yuo see"."""
    words = asked.split()
    for i, word in enumerate(words[:3] if len(words) > 1 else ()):
        if len(word) < 3 or word in _ASKS or word in STRANGERS or (word, 0.0) in spellings(word):
            continue
        near = [each for each in (_ASKS if i else WHAT) if OSA.distance(word, each) == 1]
        words[i] = near[0] if near else word
    return " ".join(words)


_STATING = re.compile(  # "the fridge is closed?"
    rf"^(?:so |and |then |but )*(?P<what>(?:(?:{COLOR}) )?(?:{THING}|one)|(?:{COLOR})|it|they) (?P<be>is|are)"
    r" (?P<how>(?:(?:not|still|now|already) )*(?:open|closed|shut|empty|full|pressed|down|on|off|in|inside|under"
    r"|behind|next|left|right|there|held|free)\b[^,;:]*)$"
)


def question(text: str) -> str | None:
    """Return the question that plain words ask; None if they ask none, or ask politely for something to be done."""
    text = direct(text)
    asked = _OPENING.sub("", _VOCATIVE.sub("", text.rstrip(" ?.!")))
    asked = _PLEASE.sub(r"\1", asked)
    tag = r"(?:(?<=open|shut|full)|(?<=closed)|(?<=empty)| ,) (?:right|correct|yes|no|true)$"
    asked = re.sub(tag, " , is it", asked) if text.endswith("?") else asked
    asked = _STATING.sub(r"\g<be> \g<what> \g<how>", asked) if text.endswith("?") else asked
    asked = re.sub(r"^((?:which|what|who|where)(?: \w+)?) 's\b", r"\1 is", _EMPHASIS.sub(r"\1", _spelled(asked)))
    for form in wordings()["forms"]:
        asked = form.pattern.sub(form.replacement, asked)
    if not _ASKING.search(asked) or (_REQUESTING.match(asked) and not _AT_ONCE.match(asked)):
        return None
    plain = plain_start(asked)
    named = rf"what(?:ever)? (?:i|we) (?:\w+ ){{1,5}}is\b|what(?:ever)? you (?:are|have|hold)\b.*\b(?:{verb_words()})\b"
    named += r"|what(?:ever)? (?:is|stands|lies|sits|you (?:have|hold|are))\b"
    named += r".* (?:belongs|goes|should|must|needs|has to|ought)\b"
    named += r"|what(?:ever)? \w+ (?:holds|contains|hides) .*\b(?:on|in|to)\b"
    requests = plain != asked and re.match(rf"(?:{verb_words()}|let go)\b", plain) and not _PROPOSED.match(asked)
    requests = requests and not any(each.match(asked) for each in (ABLE, _AT_ONCE, _OR_IS))
    return None if requests or re.match(named, asked) else asked  # "what I want is", "what you hold, put it down"


# ---- What a sentence consists of beside a command

CONDITION = re.compile(
    r"^(?P<how1>if|only if|in case|when(?! you (?:have|are|did))|provided|assuming|should|as long as|whenever|unless) "
    r"(?P<if>.+?)(?<! is)(?<! are)(?<! not)(?<!you)(?<!\bi)(?<!\bwe)"
    rf"(?: [,:]| then|(?= (?:please|(?:you )?(?:{verb_words()})|(?:should|must|may) \w+)\b(?! ?,| then\b)))"
    r" ?(?:then )?(?P<do>.+?)"
    r"(?:(?: ,)? (?:otherwise|else|if not|or else)(?: ,)? (?P<else>.+))?$"
    r"|^(?P<do2>.+?)(?: ,)?(?: but)?(?: only)? "
    r"(?P<how>if|in case|unless|provided|as long as|except if|except when|only when) (?P<if2>(?!not$).+?)"
    r"(?:(?: ,)? (?:otherwise|else|if not|or else)(?: ,)? (?P<else2>.+))?$"
)
SAME = re.compile(
    r"^(?:(?:and|now|then|please|so|but) )*(?:(?:do |repeat )?(?:exactly )?(?:same|equivalent|that|it|repeat)"
    r"(?: thing| again| once more| distance| amount| move| movement| shift| displacement)*(?: ,)?(?: but)? "
    r"(?:with|for|to|using|goes for)|(?:do |repeat )?(?:exactly )?same(?: thing| again| once more)*(?: [,:]| but)+"
    r"|(?:and )?(?:once )?(?:again|more) (?:but )?(?:with|for)"
    r"|how about|what about|also) | (?:(?:as well|too|also)(?: then| now)?|likewise|(?:in )?same way"
    r"|(?:, )?(?:and )?(?:do )?(?:exactly )?same(?: thing| again| once more| direction| (?:with|for) it)*)$"
)
_PROPOSED = re.compile(
    r"^why (?:can|could|will|would|do|did) (?:not you|you not) (?P<not>.+)$"
    r"|^(?:are you able|would you be able|is it possible(?: for you)?) to (?P<able>.+)$"
    r"|^(?:can|could|would) you (?P<told>.+) if i (?:asked|told|wanted|ask|tell|want)(?: you)?(?: to)?$"
    r"|^what (?:would|will|does|happens?)(?: you)?(?: happen| do)? if (?:i|you|we)?(?: said| say| told you to"
    r"| asked you to| ask you to| tell you to| would| will| were to)? ?(?P<command>.+)$"
    r"|^how (?:do|can|would|should|must) (?:i|we|one) (?:say|tell you|ask you|get you|make you)(?: that you"
    r" (?:should|must|shall)| that| to)? (?P<asked>.+)$"
    r"|^(?:can|could|may|should) (?:i|one) (?P<mine>(?:put|stack|place|move|fit|store|use|open|close|press|turn|push"
    r"|lift|touch|remove|shut|switch|swap|empty|unstack|take(?= .*\b(?:out|off|away|back)\b))\b.+)$"
    rf"|^should (?:i|one) (?P<ought>(?:{verb_words()})\b.+)$"
    r"|^(?:can|could|would|does|do|will|may|should) (?P<what>(?!you\b|i\b|we\b).+?) "
    r"(?:fit|fits|go|stand|lie|be put|be|sit)(?: back)? (?P<where>(?:in|on|into|inside|next|to|onto|at|under|behind"
    r"|between|left|right|near|over)\b.*?)(?: ,.*)?$"
)


def proposal(asked: str) -> str | None:
    """Return the command of which a sentence asks whether it is possible, or what would come of it."""
    match = _PROPOSED.match(question(text_of(scan(asked))) or asked)
    if match is None:
        return None
    return f"put {match['what']} {match['where']}" if match["what"] else match[match.lastgroup or 0]

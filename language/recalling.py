"""Names that a person gives, and what is told by what was done: "Bob", "the first one you moved", "where it stood".

A sentence that says a thing or a place so is read as one that names the thing, or that points at the place.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from language.acts import act_of, question
from language.errors import NotUnderstood
from language.lattice import Lattice, vocabulary
from language.meanings import Entity, Gesture
from language.memory import Memory
from language.ordering import TIMES, later_time
from language.outcomes import Answer, Plan, Step
from language.referents import Ref
from language.scanning import COLOR, scan, text_of, verb_words
from language.talk import listed, name, phrase
from language.verbs import KNOWN, Act
from language.words import colors

_NOUN = r"ones?|cubes?|blocks?|things?|objects?|balls?|spheres?|cylinders?|what"
_DOER = (
    r"(?:that |which )?(?:you|i|we) (?:have |had )?(?:just |only |already |last |first )*"
    r"(?:(?:have|had|made|got|let|told|asked|wanted) you (?:to )?)?"
)
_WHEN = r"(?: (?:just now|before|earlier|first|last|at first|previously|a (?:moment|minute|second|while) ago))*"
_DONE = re.compile(
    rf"(?:\b(?P<rank>first|second|third|last|latest|previous) )?(?:\b(?P<number>two|three) )?(?:\b(?P<color>{COLOR}) )?"
    rf"\b(?P<noun>{_NOUN}|(?<=last )(?:two|three)|(?<=first )(?:two|three)) {_DOER}"
    rf"(?P<verb>(?!you\b|before\b|earlier\b|do\b)\w+(?: (?:up|down|out))?)(?! it\b| them\b){_WHEN}"
)
_ONCE = re.compile(r"^(?:first|second|third|last|latest|previous) |(?:earlier|before|ago|first|last|previously)$")
_LAST = re.compile(r"\blast (?P<number>two|three)(?: ones| cubes| blocks| things)?(?= back\b)")
_SAME = re.compile(r"\b(?:same )?(?:one|cube|block|thing) (?:as|from) (?:before|last time|earlier|just now)\b")
_FIRST = re.compile(r"\b(?P<rank>first|second)(?: one)?\b(?! \w+ (?:from|on|of)\b)")
_RANK = r"(?P<rank>first|second|third|fourth|last)"
_NAMED_FIRST = re.compile(  # of the things that a question or an answer named
    rf"\b{_RANK}(?: (?P<number>two|three))?(?: ones?| cubes?| blocks?| things?)? "
    r"(?:(?:that |which )?you (?:have )?(?:just )?"
    r"(?:mentioned|named|said|listed|offered|suggested|asked about)|of (?:those|these|them)$)"
)
_AGAIN = re.compile(rf"\b{_RANK}(?: (?P<noun>one|cube|block|thing))? (?=again\b|once more\b)")
_STOOD = re.compile(
    r"(?:\b(?:to|in|at|on|onto|back|exactly) )*"
    r"\b(?:where (?P<what>(?!(?:it|they|that|this|you|i|we)\b)\w+(?: \w+){0,2}?)"
    r" (?:was|were|stood|sat|lay|used to be|had been|started|came from)(?: standing| before| at first| originally"
    r"| initially| earlier| at start)*"
    r"|(?P<owner>\w+(?: \w+)?) 's (?:old|former|previous|original|first) (?:place|spot|position))\b(?! \w+ed\b)"
)
_WAS = r"(?:was|were|stood|sat|lay|had been|used to be)(?: standing| sitting| lying)?"
_SHARE = re.compile(  # some of those that were spoken of
    r"(?:\b(?:any|just|only) )*\b(?:(?P<number>one|two|three) of (?:them|those|these)"
    r"|(?:those|these) (?P<both>two|three)(?: ones| cubes| blocks| things)?)\b"
)
_BASE = re.compile(  # what a thing stood on
    r"\b(?:one|cube|block|thing) (?:that |which )?"
    rf"(?:{_WAS} (?:under|beneath|underneath|below) (?P<over>it|that|this|\w+(?: \w+)?)"
    rf"|(?P<over2>it|that|this|\w+(?: \w+)?) {_WAS} on)\b"
)
_PAIR = re.compile(  # of things that were spoken of
    r"\b(?P<lead>between|swap|switch|exchange) (?:(?:them|those|these|both)(?: both| two| cubes| blocks| ones)*|two)"
    r"(?=$| [.,;!?]| (?:please|now|then|and|instead)\b)"
)
_BOTH = re.compile(  # "and now both back on the table"
    r"(?:^|(?<=\band )|(?<=\bnow )|(?<=\bthen ))both(?: of them)? (?=(?:back|on|in|to|out|away|down)\b)"
)
_SHUT_IT = re.compile(
    r"^(?:(?:and|ok|okay|now|then|please|good|great|,) )*(?P<verb>open|close|shut) (?:it|that)(?= up| now| please|$)"
)
_OUT = re.compile(r"\b(?P<verb>take|get|bring|pull|fetch) (?:it|that)(?: back)? out\b(?! of\b)")
_GIVEN = re.compile(
    r"\b(?P<verb>give|hand|pass) (?:it|that)\b|\bi (?:would |do |really )*(?:like|love|want)(?: to have)? (?:it|that)$"
)
_ROTATED = re.compile(r"\b(?P<verb>rotate|tilt|tip) (?:it|that|this)(?: one)?\b")
_EXCHANGED = re.compile(
    r"\b(?:swap|exchange|trade|replace|change|switch) (?:it|that|this)(?: one)? (?:for|with|by|against)"
    r" (?P<new>[^.,;!?]+)"
)
_RATHER_IN = re.compile(  # "I would rather have the yellow one in there"
    r"\b(?:i|we) (?:would )?(?:rather|prefer)(?: to)?(?: have| see| put| like)? (?P<new>[^.,;!?]+?)"
    r" (?:in(?:side)? (?:there|it|that one)|inside)(?: instead)?$"
)
_POINTS = re.compile(r"\b(?:this|these|here|there)\b")
_PLACE = r"(?:this|that) (?:spot|place|position)|here"
_CALLS = re.compile(
    r"^(?:please |let us |now |from now on |i (?:will |shall )?|you can |we (?:will )?|just )*"
    rf"(?:call|name|remember|save|mark) (?P<what>{_PLACE}|it|that|this|[\w ]+?)(?: as)?"
    r" (?P<name>\w+(?: (?:base|place|spot))?)(?: from now on| please)*$"
    rf"|^(?:from now on )?(?P<what2>{_PLACE}|[\w ]+?) (?:is|are|shall be|will be|should be)(?: now)? (?:called|named)"
    r" (?P<name2>\w+(?: (?:base|place|spot))?)$"
    r"|^(?P<what3>it|[\w ]+?)(?: 's|s)? name is (?P<name3>\w+)$"
)
_NO_NAME = frozenset(["a", "an", "it", "me", "us", "you", "when", "if", "back", "out", "up", "again", "one", "ones"])
_RANKS = {"first": 0, "second": 1, "third": 2, "fourth": 3, "last": -1}


class Recalled(NamedTuple):
    """A sentence that names things as they are called in the scene, and the places that it points at, in order."""

    text: str
    places: tuple[Gesture, ...] = ()


@dataclass
class Recollections(Memory):
    """Remembers names, and finds what is told by what was done. names: of things and places, in lower case."""

    names: dict[str, Gesture] = field(default_factory=dict)

    def recalled(self, sentence: str) -> Recalled:
        """Return a sentence with the things and places that it tells by what was said and done.

        Raises NotUnderstood if it tells a thing by what was not done.
        """
        places: list[tuple[int, Gesture]] = []
        if act_of([token.text for token in scan(sentence)]) is not None:  # "finish what you started"
            return Recalled(sentence)
        of_things = self._by_name, self._by_deed, self._by_order, self._by_share, self._by_base, self._by_stand
        of_commands = self._by_pair, self._by_exchange, self._by_state, self._by_rotation, self._by_content
        for find in (*of_things, *of_commands):
            for match, meant in reversed(list(find(sentence))):
                tokens = scan(sentence)
                first, last = (match.string[:end].count(" ") for end in (match.start(), match.end() - 1))
                start, end = tokens[first].start, tokens[last].end
                if isinstance(meant, Gesture):
                    places.append((start, meant))
                sentence = sentence[:start] + ("there" if isinstance(meant, Gesture) else meant) + sentence[end:]
        return Recalled(sentence, tuple(meant for _, meant in sorted(places, key=lambda each: each[0])))

    def called(self, sentence: str) -> Answer | None:
        """Return the answer to a sentence that gives a name, or asks for one; None of another one."""
        text, world = text_of(scan(sentence.rstrip(" .!?"))), self.now
        asked = re.fullmatch(r"(?:who|what|which(?: one| cube| block| thing)?) (?:is|was) (?P<name>\w+(?: \w+)?)", text)
        if asked and asked["name"] in self.names:
            return self._introduced(sentence, asked["name"])
        match = _CALLS.match(text)
        if match is None:
            return None
        what, called = (next(filter(None, (match[f"{key}{n}"] for n in ("", 2, 3)))) for key in ("what", "name"))
        known = any(word in vocabulary() for word in called.split()) and not re.fullmatch(_PLACE, what)
        if known or {*called.split()} & _NO_NAME:
            return None
        things = self._things(what.removeprefix("its") or "it")
        if what in ("it", "that", "this", "its") or re.fullmatch(_PLACE, what):
            things = list(self.planner().it[:1])
        if len(things) != 1:
            return None
        thing = world.things[things[0]]
        shown = Gesture((), (thing.x, thing.y)) if re.fullmatch(_PLACE, what) else Gesture((things[0],))
        self.names = {**self.names, called: shown}
        return self._introduced(sentence, called)

    def _introduced(self, sentence: str, called: str) -> Answer:
        """Return what a name means, in a sentence."""
        meant = self.names[called]
        at = re.search(rf"\b{called}\b", sentence, re.IGNORECASE)
        what = name(self.now, meant.things[0]) if meant.things else "a place on the table"
        text = f"{at[0] if at else called} is {what}"
        return Answer(sentence, 1.0, (), (0, len(sentence)), text, about=meant.things)

    # ---- What is told, each with the words that tell it: a name, or a place

    def _by_name(self, sentence: str) -> Iterator[tuple[re.Match[str], str | Gesture]]:
        text = text_of(scan(sentence))
        for called, meant in self.names.items():
            lead = r"(?:\b(?:on|at|to|onto|in|into|back|over) )*" if not meant.things else ""
            for match in re.finditer(rf"{lead}\b{called}\b", text):
                yield match, name(self.now, meant.things[0]) if meant.things else meant

    def _by_deed(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        text = text_of(scan(sentence))
        for match in (*_DONE.finditer(text), *_LAST.finditer(text), *_SAME.finditer(text)):
            found = self._done_with(match)
            if found:
                yield match, listed([name(self.now, i) for i in found])
            elif match.re is _DONE and _ONCE.search(match[0]) and acts_of(match["verb"]) and not question(text):
                raise NotUnderstood(f"I do not know which is the '{match[0]}': I have done nothing like that yet")

    def _done_with(self, match: re.Match[str]) -> list[int]:
        """Return the things with which something was done: the first, the last, the last two."""
        said = match.groupdict()
        acts = acts_of(said["verb"]) if "verb" in said else frozenset(Act)
        acts = frozenset([Act.TAKE, Act.HOLD]) if said.get("verb") in ("had", "held") else acts
        things = [step.object for step in self._steps() if is_done(step, acts)]
        if not things and self.now.held is not None and acts & {Act.TAKE, Act.HOLD}:  # it was taken before
            things = [self.now.held]
        if "before" in match[0].split() and len(set(things)) > 1:  # "the one you had before"
            things = [i for i in things if i != self.now.held]
        meant = colors().get(said.get("color") or "", ())
        cubes = (said.get("noun") or "").startswith(("cube", "block"))
        things = [i for i in things if not meant or self.now.things[i].color in meant]
        things = [i for i in things if not cubes or self.now.is_loose(i)]
        rank, noun = said.get("rank") or "", said.get("noun") or ""
        if rank in ("first", "second", "third") or re.search(r" first$", match[0]):
            order, start = list(dict.fromkeys(things)), _RANKS.get(rank, 0)
        else:
            order, start = list(dict.fromkeys(reversed(things))), 0
        many = (said.get("number") or noun) in TIMES or noun.endswith("s")
        number = TIMES.get(said.get("number") or noun, len(order)) if many else 1
        return order[start : start + number]

    def _steps(self) -> list[Step]:
        plans = [turn.outcome for turn in self.turns if isinstance(turn.outcome, Plan)]
        return [step for plan in plans for step in plan.steps if not step.implied]

    def _by_order(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "the first" and "the second", where something was done with two things: "put the first on ..."."""
        things = list(dict.fromkeys(step.object for step in self._steps()))
        text = text_of(scan(sentence))
        for match in _AGAIN.finditer(text):  # "now the first one again"
            order = self._done_alike()
            if match["noun"] and len(order) > 1 and abs(_RANKS[match["rank"]]) < len(order):
                yield match, name(self.now, order[_RANKS[match["rank"]]])
        said, last = self.open_question(), self.turns[-1].outcome if self.turns else None
        offered = said.candidates if said is not None else last.about if isinstance(last, Answer) else ()
        for match in _NAMED_FIRST.finditer(text):
            rank, number = _RANKS[match["rank"]], TIMES.get(match["number"] or "", 1)
            named = offered[rank:][:number] if rank >= 0 else offered[-number:]
            if len(named) == number < len(offered):
                yield match, listed([name(self.now, i) for i in named])
        found = list(_FIRST.finditer(text))
        things = self._spoken_in_turn() or things
        if len(things) == 2 and [match["rank"] for match in found] in (["first", "second"], ["second", "first"]):
            yield from ((match, name(self.now, things[_RANKS[match["rank"]]])) for match in found)

    def _spoken_in_turn(self) -> list[int]:
        """Return the loose things that the last answers were about, one each, the first one first."""
        found: list[int] = []
        for turn in reversed(self.turns):
            loose = [i for i in turn.about if self.now.is_loose(i)]
            if not isinstance(turn.outcome, Answer) or len(loose) != 1:
                break
            found.insert(0, loose[0])
        return found if len(found) > 1 else []

    def _done_alike(self) -> list[int]:
        """Return the things with which the same was done as with the last one, in the order in which that was."""
        steps = self._steps()
        return list(dict.fromkeys(step.object for step in steps if is_done(step, frozenset([steps[-1].act]))))

    def _by_share(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "two of them", where more were spoken of, and "those two cubes", which were spoken of last."""
        text = text_of(scan(sentence))
        for match in _SHARE.finditer(text):
            if not re.search(rf"\b(?:{verb_words()})(?: me| us| up| out| down)? $", text[: match.start()]):
                continue
            number = TIMES.get(match["number"] or match["both"], 1)
            spoken = [i for i in (self.it if match["number"] else self.planner().recent) if self.now.is_loose(i)]
            spoken = [i for i in dict.fromkeys(spoken) if not self.now.things[i].target]
            if len(spoken) >= number + bool(match["number"]):
                yield match, listed([name(self.now, i) for i in spoken[:number]])

    def _by_base(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "the one that was under it", if the thing was taken off another one."""
        for match in _BASE.finditer(text_of(scan(sentence))):
            told, planner = match["over"] or match["over2"], self.planner()
            things = list(planner.it[:1]) if told in ("it", "that", "this") else self._things(told)
            rest = planner.rests.get(things[0]) if len(things) == 1 else None
            if rest is not None and rest[2] is not None:
                yield match, name(self.now, rest[2])

    def _by_stand(self, sentence: str) -> Iterator[tuple[re.Match[str], str | Gesture]]:
        text = text_of(scan(sentence))
        match = _STOOD.search(text)
        if match is None or not match.start() or question(text) or _POINTS.search(text):
            return
        things = self._things(match["what"] or match["owner"])
        rest = self.planner().rests.get(things[0]) if len(things) == 1 else None
        if rest is None:
            return
        x, y, on = rest
        inside = on in self.now.containers
        yield match, Gesture((), (x, y)) if on is None else f"{'in' if inside else 'on'} {name(self.now, on)}"

    def _by_pair(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "between them", if less than two things are "them": the two that were moved or spoken of last."""
        text, world = text_of(scan(sentence)), self.now
        if sum(world.is_loose(i) for i in self.it) > 1:
            return
        for match in (*_PAIR.finditer(text), *_BOTH.finditer(text)):
            planner = self.planner()
            spoken = [i for i in dict.fromkeys((*planner.carried, *planner.recent)) if world.is_loose(i)]
            moves = planner.it[:1] if re.search(r"\bit\b", text[: match.start()]) else ()
            others = [i for i in spoken if i not in moves and not re.search(rf"\b{world.things[i].color}\b", text)]
            if len(others) > 1:
                lead = f"{match['lead']} " if match.re is _PAIR else "put "
                yield match, f"{lead}{listed([name(world, i) for i in others[:2]])}"

    def _by_exchange(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "swap it for X" of a thing on the hand or in a container: X gets there in its place."""
        world, text = self.now, text_of(scan(sentence))
        full = world.contents(self.box) if self.box is not None else []
        for match in (*_EXCHANGED.finditer(text), *(_RATHER_IN.finditer(text) if full else ())):
            old = full[0] if match.re is _RATHER_IN else self.it[0] if self.it else None
            box = world.inside.get(old) if old is not None else None
            if old is None or box is None:
                continue
            if box == world.hand:
                yield match, f"put it back and give me {match['new']}"
            else:
                place = name(world, box)
                yield match, f"take {name(world, old)} out of {place} and put {match['new']} in {place}"

    def _by_state(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "close it", where the container that was spoken of last is closed, and the one before it is open."""
        world, match = self.now, _SHUT_IT.match(text_of(scan(sentence.rstrip(" .!"))))
        last = [i for i in self.planner().recent if i in world.containers][:2] if match else []
        if match and len(last) == 2 and self.box == last[0]:
            done = [(i in world.open) == (match["verb"] == "open") for i in last]
            if done == [True, False]:
                yield match, f"{match['verb']} {name(world, last[1])}"

    def _by_rotation(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "rotate it" of a loose thing, which no device is meant by."""
        for match in _ROTATED.finditer(text_of(scan(sentence))):
            if self.it and self.now.is_loose(self.it[0]):
                yield match, f"{match['verb']} {name(self.now, self.it[0])}"

    def _by_content(self, sentence: str) -> Iterator[tuple[re.Match[str], str]]:
        """Yield "take it out" and "give it to me" of what is in a container, where no thing in one was spoken of."""
        world = self.now
        full = world.contents(self.box) if self.box is not None else []
        if len(full) != 1 or (self.it and self.it[0] in world.inside):
            return
        text = text_of(scan(sentence))
        given = _GIVEN.finditer(text) if self.it[:1] == (self.box,) else ()  # the container itself stays
        for match in (*_OUT.finditer(text), *given):
            yield match, f"{match['verb'] or 'give me'} {name(world, full[0]).split(' in ')[0]}"

    def _whole(self, text: str) -> tuple[Entity | None, list[Ref]]:
        """Return the phrase to which all of some words belong, and its referents; None and [] of other words."""
        tokens = scan(text)
        entity, refs = phrase(self.now, self.planner(), tokens)
        return (None, []) if entity is None or entity.span != (0, len(tokens)) else (entity, refs)

    def _things(self, text: str) -> list[int]:
        """Return the things that some words name, all of which belong to one phrase."""
        _, refs = self._whole(text)
        real = [i for ref in refs for i in ref.things[-1:]]
        solid = [i for i in real if not self.now.things[i].target and self.now.is_loose(i)]
        return list(dict.fromkeys(solid or real))


def acts_of(verb: str) -> frozenset[Act]:
    """Return what a verb means, as it is or inflected."""
    tokens = scan(verb)
    lattice = Lattice(tokens) if tokens else None
    edges = [edge for kind in ("verb", "done") for edge in lattice.get(0, kind)] if lattice else []
    return frozenset(KNOWN[edge.value].act for edge in edges if not edge.cost and edge.end == len(tokens))


def is_done(step: Step, acts: frozenset[Act]) -> bool:
    """Whether a step does what one of these verbs says."""
    if acts & {Act.TAKE, Act.HOLD, Act.REMOVE, Act.UNSTACK} and (step.takes or step.carries):
        return True
    moves = {Act.CARRY, Act.LOWER, Act.GIVE, Act.BUILD, Act.STORE, Act.SWAP, Act.GATHER, Act.EMPTY}
    return step.carries if step.carries and acts & moves else step.act in acts


_WHOSE_SIDE = re.compile(
    r"\b(?P<whose>my|your)(?: own)? (?P<side>left|right)\b(?!\s+(?:hand|palm|arm))"
    r"|\b(?P<side2>left|right)\b(?:,?\s+(?:as |when |if )?(?:seen |looking |viewed )?(?:from (?P<whose2>my|your)"
    r" (?:side|point of view|perspective|view|viewpoint|position|place)|from where (?P<i>i) (?:am|sit|stand)))",
    re.IGNORECASE,
)
_IN_OTHER_WORDS = re.compile(  # "my left, so on your right"
    r"(\b(?:my|your) (?:left|right)\b),?\s*\b(?:so|meaning|that is)\b,?\s*(?:on |to |at )?(?:my|your) (?:left|right)\b",
    re.IGNORECASE,
)
_OWNER = {"robot": "your", "human": "my"}  # whose left is "left"
_OTHER_SIDE = {"left": "right", "right": "left"}


def on_sides_of(sentence: str, viewpoint: str) -> str:
    """Return a sentence with "left" and "right" as seen from a viewpoint for "my left" and "the left from my side"."""

    if re.search(r"\bor (?:mine|yours|my|your)\b|\bwhose\b", sentence, re.IGNORECASE):
        return sentence

    def seen(match: re.Match[str]) -> str:
        side = (match["side"] or match["side2"]).lower()
        whose = (match["whose"] or match["whose2"] or "my").lower()
        return side if whose == _OWNER.get(viewpoint, whose) else _OTHER_SIDE[side]

    return _WHOSE_SIDE.sub(seen, _IN_OTHER_WORDS.sub(r"\1", sentence))


_NAME = re.compile(
    r"(?<![\w'-])(?!(?:She|He|They|You|We|It|This|That|There|Who|What|One|Everyone|Nobody|Somebody|Someone)\b)"
    r"(?P<name>[A-Z][a-z]{2,}|(?i:grand(?:pa|ma|dad|mum|father|mother)|mum|mom|daddy|mummy))(?P<own>'s)?\b"
)
_TELLS = re.compile(
    r"\W+(?:needs?|wants?|likes?|loves?|hates?|asks?|asked|said|says|told|thinks?|will|would|can|is|has|and)\b"
)
_THAT_IS = re.compile(r",?\s*\b(?:i\.\s?e\.|that is to say|namely),?\s*")

_BACK = re.compile(  # "put it back, I wanted the yellow one"
    r"\b(?:put|take|bring|give) (?:it|that|them|this) (?:back|out|down)(?: again)?\W+"
    r"(?:I|we) (?:(?:really |actually )?(?:wanted|meant|said|asked for)|had wanted)\b",
    re.IGNORECASE,
)
_I_SAID = re.compile(  # "hang on, I said the fridge, didn't I?"
    r"^(?:(?:hang on|hold on|wait|hey|no|whoa|woah|excuse me|but)\b\W*)*(I (?:said|meant|told you|asked)\b.*?)"
    r"(?:,?\s*\b(?:did(?:n.?t| not) I|did I not))?\W*$",
    re.IGNORECASE | re.DOTALL,
)


def without_names(sentence: str) -> str:
    """Return a sentence with "my friend", "me" and "my" for what can only be names of people: "for Lisa"."""
    sentence = _BACK.sub("no, I wanted", sentence)
    sentence = _I_SAID.sub(r"no, \1", _THAT_IS.sub(", ", sentence))
    if sentence.istitle() or sentence.isupper():
        return sentence
    known = vocabulary()

    def plain(match: re.Match[str]) -> str:
        name, before, after = match["name"], sentence[: match.start()], sentence[match.end() :]
        first = not before.strip() or before.rstrip()[-1] in ".!?:;"
        family = name[0].islower() or name.lower().startswith(("grand", "mum", "mom"))
        if later_time(name.lower()):  # "Monday"
            return match[0]
        if name.lower() in known or (first and not family and not match["own"] and not _TELLS.match(after)):
            return match[0]
        if re.search(r"\b(?:the|a|an|this|that)\s+$", before, re.I):
            return match[0]
        if match["own"]:
            return "my"
        if before.rstrip().endswith(",") and not after.strip(" .!?\n"):  # who is spoken to, or who signs
            return match[0]
        return "me" if re.search(r"\b(?:for|to)\s+$", before, re.I) else "my friend"

    return re.sub(r"\bmy friend and I\b", "we", _NAME.sub(plain, sentence))

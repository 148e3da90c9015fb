"""Conditions: "close the fridge if it is open, and then ...", compared with the world that the steps before leave.

A sentence is divided into steps. What a condition is about is done or left out, and the rest is read as without it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

from language.acts import CONDITION, Part, parts_of, question
from language.going_on import GoingOn
from language.meanings import Gesture
from language.normalise import plain_start
from language.outcomes import Answer, Outcome, Plan, Question, Refusal
from language.questions import Questions
from language.remarks import command as command_word
from language.remarks import tells_of
from language.scanning import COLOR, THING, scan, text_of, verb_words
from language.talk import name, offers, phrase

MOST = 4  # conditions of a sentence
_IF = r"(?:only if|if|unless|in case|provided|as long as|except if|except when|only when)"
_BEGINS = re.compile(
    rf"^(?:(?:and|but|then|so|please|,) )*(?:{_IF}|when(?! you (?:have|are|did))|whenever|assuming"
    r"|should(?= (?!you\b|i\b|we\b).* (?:be|have)\b)) "
)
_OTHERWISE = re.compile(r"^(?:(?:and|but) )?(?:otherwise|else|if not|or else)\b")
_AND_TELL = re.compile(  # "open it and tell me what is in it"
    r"(?P<do>.+?)[\s,]+(?:and|then) (?:then )?(?:tell|show) (?:me|us) "
    r"(?P<asked>(?:what|which|where|who|how many)\b.+)$",
    re.IGNORECASE | re.DOTALL,
)
_POLITE = (  # what only asks kindly
    r"(?:(?:you|we) (?:can|could|would|will|like|want|please|may|wish|do not mind|must|(?:have|need)(?: a| to|$)"
    r"|are (?:able|ready|free|so kind))|i may|i (?:can|could|might) ask|possible|necessary|needed|needs? be|so kind"
    r"|(?:that|it|this) is (?:okay|fine|alright|all right|possible|convenient|no (?:trouble|bother|problem)|not too)"
    r")\b"
)
_NONE_INSIDE = re.compile(r"\bthere is (?:nothing|no (?:cube|thing|one)) (?:inside|in (?:it|there))(?: yet)?")
_NOTHING = re.compile(  # "otherwise leave it alone"
    r"(?:just |please |then )*(?:(?:leave|let|keep) (?:it|them|that|this|everything)"
    r"(?: alone| be| as (?:it|they) (?:is|are)| (?:open|closed|shut|there|so)| where (?:it|they) (?:is|are))*"
    r"|do nothing|nothing|never mind|wait|stop"
    r"|do not (?:do anything|bother|move|touch it))$"
)
_IF_SO = re.compile(  # "can you reach it? if so, grab it"
    r"^(?:(?:can|could) you )?(?:please )?([^?.;,]+?)(?: [?.;,])+ if (?:so|yes|you can|that works)"
    r"(?: ,)?(?: then| please)*(?: do (?:so|it|that) and)?(?= )"
)
_TELL_IF = re.compile(  # what is told anyway: "close it, then tell me if it is closed"
    r"(?: ,| and| then| to)+ (?:tell me|let me know|say|check|see|look|find out|show me) (?:if|whether) [^.;]*$"
)
_AFTER_ANSWER = re.compile(  # "is anything in it?" - "Yes: ..." - "if so, take it out"
    r"^(?:(?:and|then|so|well|okay) )*"
    r"(?:if (?:so|yes|it is|it does|there is|they are|that is (?:so|right|true))|in that case)"
    r"(?: ,)?(?: then)? (?P<do>.+)"
)
_SUBJECT, _STATE = r"(?:it|(?:\w+ )?(?:drawer|fridge|button|lever|wheel))", r"(?:open|closed|shut|up|down|on|off)"
_TWO_SIDED = (  # two conditions of one thing in one breath, and the same as two clauses
    (
        rf"^if ({_SUBJECT}) is ({_STATE}) (?:, )?(.+?) (?:, )?and if ({_SUBJECT}) is ({_STATE}) (?:, )?(.+)$",
        r"if \1 is \2 , \3 ; if \4 is \5 , \6",
    ),
    (
        rf"^(\w+) ({_SUBJECT}) if {_SUBJECT} is ({_STATE})(?: ,| and| ;)+ (\w+) it if it is ({_STATE})$",
        r"if \2 is \3 , \1 it ; if \2 is \5 , \4 it",
    ),
)
_STATED = re.compile(r"^(?!you |we |i ).*\b(?:is|are) (?:\w+ )?(?:open|closed|shut|empty|full|pressed|free)\b")
_INVERTED = re.compile(r"^(should|must|may|can|shall) (.+?) (go|be|stand|lie|come|move|get)\b")  # "only if ..."
_SOMEBODY = re.compile(
    r"(?:someone|somebody|anyone|anybody|he|she|they|you|i) (?:(?:has|have|did|had|already|ever) ?)+"
    r"(?:(?:done|do) (?:it|so|that))?$"
)
_PLACE = re.compile(r"\b(?:on|in|into|onto|inside|from|out of|behind|under|to|of)\b")
_NAMED = re.compile(rf"\b(?:{COLOR}) (?:one|{THING})\b|\b(?:{THING})\b")
_SPOKEN = re.compile(r"\b(?:it|they|that|them|there)\b")

_FIRST_DO = re.compile(
    rf"(?:(?:then|so|okay|ok|well|no|please|just|,) )*(?P<do>(?:{verb_words()})\b.+?) first(?: then)?"
)


class Conditional(NamedTuple):
    """A sentence with its first condition: the words before and after, the condition, what is done if it holds or not.

    how: "if", "unless" and the like. leads: whether the condition comes before what it is about.
    """

    before: str
    how: str
    condition: str
    does: str
    otherwise: str
    after: str
    leads: bool


@cache
def _joint() -> re.Pattern[str]:
    """Return a pattern for what joins two steps."""
    verb = rf"(?:(?:please|just|also) )*(?:{verb_words()}|do not|{_IF})\b"
    then = r"(?:and |but )*(?:then|finally|afterwards|after that|after this|next|lastly)"
    return re.compile(
        rf" ?[;.!] ?(?:{then} )?(?=.)|(?: ,)? {then}(?: ,)? | ,(?: and| but)? (?={verb})| (?:and|but) (?={verb})"
    )


def _steps(text: str) -> list[tuple[str, str]]:
    """Return the steps of a sentence, each after what joins it to the one before."""
    found, at, joint = [], 0, ""
    for match in _joint().finditer(text):
        found.append((joint, text[at : match.start()]))
        at, joint = match.end(), match[0]
    return [*found, (joint, text[at:])]


def conditional(text: str) -> Conditional | None:
    """Return the first condition of plain words; None if there is none, or it is not said what is done then."""
    steps = _steps(text)
    begins = rf"(?:^|\s){_IF} (?!{_POLITE})|{_BEGINS.pattern}(?!{_POLITE})"
    at = next((i for i, (_, words) in enumerate(steps) if re.search(begins, words)), None)
    if at is None:
        return None
    first, last, leads = at, at + 1, bool(_BEGINS.match(steps[at][1]))
    if not leads:  # "take it and put it in there if ..."
        while first and steps[first][0] == " and " and _SPOKEN.search(re.split(rf" {_IF} ", steps[first][1])[0]):
            first -= 1
    while last < len(steps) and (
        _OTHERWISE.match(steps[last][1]) or (leads and re.fullmatch(r" ,(?: and)? | and ", steps[last][0]))
    ):
        last += 1
    match = _match(steps[first:last])
    if match is None and leads and at:  # "press it, if it is up"
        first, last, leads = at - 1, at + 1, False
        match = _match(steps[first:last])
    if match is None:
        first, last, match = 0, len(steps), _match(steps)
    if match is None:
        return None
    does = _INVERTED.sub(r"\2 \1 \3", match["do"] or match["do2"])
    return Conditional(
        _joined(steps[:first]),
        match["how"] or match["how1"],
        _done_already(match["if"] or match["if2"], does),
        does,
        match["else"] or match["else2"] or "",
        _joined(steps[last:]),
        leads,
    )


def _done_already(condition: str, does: str) -> str:
    """Return a condition in full: "press it unless somebody already has" is about its being pressed."""
    verb = command_word().match(does)
    if verb is None or not _SOMEBODY.match(condition):
        return condition
    return f"it is {verb[0].split()[-1].removesuffix('e')}ed"


def _match(steps: Sequence[tuple[str, str]]) -> re.Match[str] | None:
    return CONDITION.match(re.sub(r"^(?:(?:and|but|then|so|please) )+", "", _joined(steps).rstrip(" .!")))


class Weighed(NamedTuple):
    """What comes of a condition.

    does: what is to be done; "" for nothing; or why it is not clear, None: as if there were no condition.
    note: why something is left out. it: what "it" means then.
    """

    does: str | Outcome | None
    note: str = ""
    it: tuple[int, ...] = ()


def _joined(steps: Sequence[tuple[str, str]]) -> str:
    return "".join(words if not at else joint + words for at, (joint, words) in enumerate(steps)).strip(" ,")


@dataclass
class Conditions(GoingOn):
    """Compares the conditions of a sentence with the world."""

    def _of_turns(self, sentence: str, text: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return what comes of a sentence that only goes on from the turns before. text: its words."""
        found = self._restored(sentence, text) or self._raised(sentence, text) or self._nearer(sentence, text)
        found = found or self._unheld(sentence, text) or self._first(sentence, text, made)
        found = found or self._chosen_by_wish(text, made) or self._across_it(sentence, text)
        found = found or self._contrasted(sentence) or self._same_after(sentence, made)
        return (
            found
            or self._same_elsewhere(sentence, text)
            or self._same_with_both(text)
            or self._like_before(text)
            or self._now_possible(sentence, text)
            or self._meant_first(sentence, text)
            or self._of_those(sentence, made)
        )

    def _first(self, sentence: str, text: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of "take it out first" after a refusal, and of what was refused, if that is possible then.

        text: the words of the sentence.
        """
        match, last = _FIRST_DO.fullmatch(text), self.turns[-1].outcome if self.turns else None
        if match is None or not isinstance(last, Refusal):
            return None
        trial = self.copy()
        outcome = trial._command(match["do"], made)
        if not isinstance(outcome, Plan) or last.reading is None:
            return outcome
        trial.remember(outcome, self.now)
        after = trial._settle(sentence, last.reading)
        if not isinstance(after, Plan):
            return outcome
        return replace(after, steps=(*outcome.steps, *after.steps), notes=(*outcome.notes, *after.notes))

    def _then_asks(self, sentence: str, parts: Sequence[Part], made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of a command before a question, with the answer: "open the drawer. What is in it?"."""
        asked = question(" ".join(parts[-1].words)) if len(parts) > 1 and parts[-1].mark == "?" else None
        command = sentence[: parts[-1].start].rstrip(" ,;.!-")
        if both := _AND_TELL.match(sentence):
            command, asked = both["do"], question(text_of(scan(both["asked"])))
        if asked is None or not command_word().match(" ".join(parts[0].words)):
            return None
        trial = self.copy()
        outcome = trial._answer(command, made)
        if not isinstance(outcome, Plan) or not outcome.steps:
            return None
        trial.remember(outcome, self.now)
        told = Questions(trial.now, trial.planner(), trial.turns).answer(asked)
        notes = (*outcome.notes, f"then: {told.rstrip('.')}") if told else ()
        return replace(outcome, sentence=sentence, notes=notes) if told else None

    def _about_topic(self, sentence: str, parts: Sequence[Part], made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of a sentence that first says what it is about: "you see the red cube? pick it up"."""
        for at in range(1, len(parts)):
            told, rest = " ".join(parts[at - 1].words), _after(sentence, parts[at - 1])
            if not tells_of(told) or not _SPOKEN.search(rest.lower()):
                return None
            things = list(dict.fromkeys(i for text in (told, *_NAMED.findall(told)) for i in self._told_of(text)))
            if things:
                trial = self.copy()
                trial.it = (things[0],)
                trial.box = next((i for i in things if i in self.now.containers), self.box)
                outcome = trial._answer(rest, made)
                asked = isinstance(outcome, Question) and bool(outcome.choices)
                return outcome if asked or isinstance(outcome, Plan) else None
        return None

    def _of_those(self, text: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the plan of what is said after an answer with the thing that it names: "the cube, hand it to me"."""
        asked, parts = self.open_question(), parts_of(text)
        told = " ".join(parts[0].words) if len(parts) > 1 else ""
        rest = _after(text, parts[0]) if told else ""
        if asked is None or not command_word().match(" ".join(parts[-1].words)) or command_word().match(told):
            return None
        entity = phrase(self.now, self.planner(), scan(told))[0] if re.search(r"\bit\b", rest.lower()) else None
        meant = self._meant(self.planner(), entity, asked.candidates) if entity is not None and asked.candidates else []
        if len(meant) != 1:
            return None
        trial = self.copy()
        trial.it, trial.turns = (meant[0],), [turn for turn in self.turns if turn.outcome is not asked]
        outcome = trial._command(rest, made)
        return outcome if isinstance(outcome, Plan) else None

    def _told_of(self, text: str) -> list[int]:
        """Return the thing that the longest phrase of some words means, if there is one."""
        refs = phrase(self.now, self.planner(), scan(text))[1]
        return [i for ref in refs[:1] for i in ref.things[-1:]]

    def _after_answer(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the outcome of what is to be done if the last answer was yes; None where nothing was answered so."""
        told = _AFTER_ANSWER.match(plain_start(sentence))
        last = self.turns[-1].outcome if self.turns else None
        if told is None or not isinstance(last, Answer) or not re.match(r"(?:Yes|No)\b", last.text):
            return None
        if re.search(r"\b(?:if|otherwise|else)\b", told["do"]):  # "if it is, ...; if not, ...": both are weighed
            return None
        if last.text.startswith("No"):
            why = f"I do nothing, because {last.text.partition(': ')[2] or 'it is not so'}"
            return Answer(sentence, 1.0, (), (0, len(sentence)), text=why)
        trial = self.copy()
        trial.it = last.about or self.it
        return replace(trial._command(told["do"], made), span=(0, len(sentence)))

    def _conditional(self, sentence: str, made: tuple[Gesture, ...]) -> Outcome | None:
        """Return the outcome of a sentence with conditions; None of another one."""
        if self.now.cells:  # no condition is compared with a board
            return None
        if (outcome := self._after_answer(sentence, made)) is not None:
            return outcome
        trial, notes = self.copy(), []
        left: tuple[str, ...] = ()
        plain = plain_start(sentence).replace(" 's ", " is ")
        plain = re.sub(r"(?: ,)? but (?=only (?:if|when)\b)", " ", _TELL_IF.sub("", plain))
        plain = _NONE_INSIDE.sub(lambda _: f"{'it' if self.box is None else name(self.now, self.box)} is empty", plain)
        for pattern, clauses in _TWO_SIDED:
            plain = re.sub(pattern, clauses, plain)
        text = trial._without_lead(_IF_SO.sub(r"\1 , then", plain))
        for number in range(MOST):
            found = conditional(text)
            if found is None and not number and not _IF_SO.match(plain):
                return None
            if found is None:
                break
            does, note, it = trial._weighed(found, made, later=number > 0)
            if not isinstance(does, str):
                return does
            if not found.before:
                trial.it = it or trial.it
            left += (f"I leave out '{found.does}', because {note}",) if note else ()
            after = found.after if note else trial._still_due(text, found.after, made)
            text = " , then ".join(part for part in (found.before, does, after) if part)
            notes += [note] if note else []
        if not text:
            return Answer(sentence, 1.0, (), (0, len(sentence)), text=f"I do nothing, because {'; '.join(notes)}")
        outcome = replace(trial._command(text, made), span=(0, len(sentence)))
        return replace(outcome, notes=(*outcome.notes, *left)) if isinstance(outcome, Plan) else outcome

    def _still_due(self, text: str, after: str, made: tuple[Gesture, ...]) -> str:
        """Return what follows a condition that holds, without a second one that does not: "if up, ...; if down, ...".

        text: the whole sentence. after: what follows the condition in it.
        """
        other = conditional(after) if _BEGINS.match(after) and f"then {after}" not in text else None
        if other is None or other.before or self._weighed(other, made, later=True).does != "":
            return after
        return other.after

    def _without_lead(self, plain: str) -> str:
        """Return a sentence without what only names a thing: "I forgot where X is; if it is in the drawer, ..."."""
        lead = re.match(r"([^.;!]+) [.;!] (?=(?:if|unless) )", plain)
        if lead is None or command_word().match(lead[1]) or _BEGINS.match(lead[1]):
            return plain
        self.it = (*self._told_of(lead[1]),) or self.it
        return plain[lead.end() :]

    def _weighed(self, found: Conditional, made: tuple[Gesture, ...], later: bool = False) -> Weighed:
        """Return what comes of a condition in the world that the words before it leave.

        later: whether another condition stands before it, whose "it" is meant again.
        """
        trial = self.copy()
        if found.before:
            outcome = trial._command(found.before, made)
            if not isinstance(outcome, Plan):
                return Weighed(outcome)
            trial.remember(outcome, trial.now)
        planner = trial.planner(made)
        parts = reversed([found.does, *_PLACE.split(found.does)[1:]])
        refs = [[ref.things[-1:] for ref in phrase(trial.now, planner, scan(part))[1] if ref.things] for part in parts]
        named = [min(each, key=lambda it: not trial.now.is_loose(it[0])) for each in refs if each]
        spoken = _SPOKEN.search(found.condition)
        before = planner.it and (
            (found.leads and (later or found.before)) or re.match(r"\w+ (?:it|them|that)\b", found.does)
        )
        its = [planner.it] if before or not spoken else [*named, planner.it]
        plain = re.sub(r"^(there is )?nothing\b", r"\1something", found.condition)
        known = Questions(trial.now, planner, trial.turns)
        true = None
        for it in its:
            planner.it = it
            true = self._all_true(known, plain) if true is None else true
        if true is None:
            stated = found.before or found.after or _STATED.search(found.condition)
            return Weighed(self._untold(found.condition) if stated else None)
        if (found.how in ("unless", "except if", "except when")) != (plain != found.condition):
            true = not true
        if true:
            subject = name(trial.now, known.things[0]) if known.things and found.before and not spoken else "it"
            return Weighed(re.sub(r"\bit\b", subject, found.does, count=1), it=planner.it)
        if found.otherwise and not _NOTHING.match(found.otherwise.strip(" .,!")):
            short = re.match(r"(?:a )?\w+ (?:one|cube|block)$|\w+$", found.otherwise)
            it = planner.it if short or not named else named[-1]
            return Weighed(_with_object(found.does, found.otherwise) if short else found.otherwise, it=it)
        state = known.described()
        why = f"{'' if found.how == 'unless' else 'it is not so that '}{found.condition}{state and f': {state}'}"
        return Weighed("", why, planner.it)

    def _all_true(self, known: Questions, condition: str) -> bool | None:
        """Return whether a condition holds, or all of several that "and" joins; None if nobody can tell."""
        whole = known.is_true(condition)
        parts = [known.is_true(part) for part in condition.split(" and ")] if whole is None else []
        return whole if None in parts or not parts else all(parts)

    def _untold(self, condition: str) -> Refusal:
        """Return the refusal of a sentence whose condition cannot be compared with the world."""
        text, offered = f"I cannot tell whether {condition}", offers(self.now, condition.split())
        return Refusal(condition, 0.0, (), (0, len(condition)), reason="nothing", text=text, suggestions=offered)


def _after(sentence: str, part: Part) -> str:
    """Return what follows a part, without the marks between them."""
    return sentence[part.end :].lstrip(" ,;:.!?-")


def _with_object(command: str, thing: str) -> str:
    """Return a command with another object: "give it to me", "the yellow one"."""
    if re.search(r"\b(?:it|that)\b", command):
        return re.sub(r"\b(?:it|that one|that|this)\b", thing, command, count=1)
    return f"{command.split()[0]} {thing}"

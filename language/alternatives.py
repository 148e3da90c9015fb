"""Questions that leave something out, "apart from the red cube", or name two answers, "is it here or is it there?"."""

from __future__ import annotations

import re
from abc import abstractmethod

from language.ranking import Rankings
from language.scanning import COLOR, scan
from language.talk import phrase, real

ALTERNATIVE = re.compile(r" (?:, )?or (?=(?:is|are|has|does) (?:it|they|there|something|anything|some|any|he|that)\b)")
_EXCEPT = re.compile(
    r" (?:, )?(?:apart from|aside from|except(?: for)?|besides|other than|excluding|not counting) "
    r"(?P<what>.+?)(?P<rest>(?: (?:in|on|under|inside|near|next to|at|is|are|that|which) .+)?)$"
)


_HAND = re.compile(  # the person's
    r"(?<!your )(?<!robot )(?<!left )(?<!right )(?<!in )(?<! 's )\b(?:(?:my|open|pink) )*hand\b(?! (?:side|over))"
)


def palms(asked: str) -> str:
    """Return a question with the word that names the person's hand alone: "what colour is my hand?"."""
    return _HAND.sub("palm", asked)


class Alternatives(Rankings):
    """Finds what a question leaves out and which of its answers is so."""

    @abstractmethod
    def _answer_to_next(self, asked: str) -> str | None:
        """Return the answer to one question of several, and remember what it was about."""

    def _without_excepted(self, asked: str) -> str:
        """Return a question without "apart from X", and note these things."""
        match = _EXCEPT.search(asked)
        if match is None:
            return asked
        head, what, rest = asked[: match.start()], match["what"], match["rest"]
        if re.search(
            r"\b(?:in|on|under|inside|at|near|next to)\b", head
        ):  # "anything on the table but X in the corner"
            what, rest = what + rest, ""
        things = self.subject(re.sub(rf"\b({COLOR})(?=$| and\b| or\b| ,)", r"\1 one", what))
        if not things:
            return head + rest if what in ("it", "that") else asked  # nothing was spoken of
        self.excepted = things
        return re.sub(r"\belse\b ?", "", head + rest)

    def _either_question(self, first: str, other: str) -> str | None:
        """Return the answer to "is it here or is it there?": that to the question that is so."""
        told = self._answer_to_next(first)
        if told is None:  # "can you reach it or is something on it?"
            self.planner.it = tuple(real(self.world, phrase(self.world, self.planner, scan(first))[1])[:1])
        otherwise = self._answer_to_next(other)
        return otherwise if told is None or (otherwise or "").startswith("Yes") else told

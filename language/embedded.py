"""Questions within others: "can you tell me where the red one is" asks "where is the red one"."""

from __future__ import annotations

import re

_TELLS = (
    r"(?:tell me|say|do you know|do you happen to know|do you have (?:any|an) idea|have you any idea|any idea"
    r"|i wonder|i am wondering|i was wondering|i want to know|i would like to know|i need to know|let me know"
    r"|do you remember|remind me|explain|report"
    r"|(?:can|could|would|will|might|may) you (?:please )?"
    r"(?:tell me|say|check|see|find out|remind me|let me know|explain)"
    r"|(?:please )?(?:check|find out|see|look)(?: for me)?)"
)
_OPENING = re.compile(
    rf"^(?:(?:and|so|but|well|hey|okay|robot|please|then|now|just|also|,) )*{_TELLS}(?: please| again)?(?: ,)? "
    r"(?=(?:if|whether|what|where|which|who|how|why)\b)"
)
_ONE = r"(?!.*(?: , | and | then | or else ))"  # no command follows
_BE = r"(?:is|are|was|were|am)"
_AUX = rf"(?:{_BE}|can|could|would|will|have|had|did)"
_WHO = r"(?:you|i|we|they)"
_DEED = r"(?:(?:just|last|really|actually|now|already) )*"
_FORMS = (  # as they are asked directly
    (
        rf"(?:if|whether) {_ONE}(?P<what>(?!you\b|i\b|we\b|there\b).+?) (?P<be>{_BE}) (?P<so>.+?)(?: or not)?",
        r"\g<be> \g<what> \g<so>",
    ),
    (rf"(?:if|whether) {_ONE}(?P<what>{_WHO}|there) (?P<be>{_BE}) (?P<so>.+?)(?: or not)?", r"\g<be> \g<what> \g<so>"),
    (
        rf"what (?P<who>{_WHO}) {_DEED}(?:have |had )?{_DEED}(?:did|done)(?P<when> just now| last| before| so far)?",
        r"what did \g<who> do\g<when>",
    ),
    (rf"what (?P<who>{_WHO}) (?P<does>see|hold|have)(?P<rest>.*)", r"what do \g<who> \g<does>\g<rest>"),
    (
        rf"(?P<wh>what|where|why|how|who) (?P<who>{_WHO}|it|that) (?P<aux>{_AUX})(?P<rest>.*)",
        r"\g<wh> \g<aux> \g<who>\g<rest>",
    ),
    (r"what (?P<box>.+?) (?:contains|holds|has in it|has inside)", r"what is in \g<box>"),
    (
        rf"(?P<wh>what colou?r|how (?!many|much)\w+|which (?:colou?r|way|side)) (?P<what>.+?) (?P<be>{_BE}|has)",
        r"\g<wh> \g<be> \g<what>",
    ),
)
_STATE = re.compile(  # "drawer open?"
    r"^((?:\w+ )?(?:drawer|fridge|refrigerator|freezer|button|lever|wheel|gripper)) "
    r"((?:still |already |now )?(?:open|opened|closed|shut|empty|full|pressed|free))(?: now| yet| already)? \?$"
)


def direct(text: str) -> str:
    """Return plain words that ask for the answer to a question as that question; other words as they are."""
    opening, end = _OPENING.match(text), text.rstrip(" ?.!")
    if opening is None:
        return _STATE.sub(r"is \1 \2 ?", re.sub(r"(?<=\w)\?$", " ?", text))
    asked = end[opening.end() :]
    for pattern, plain in _FORMS:
        if re.fullmatch(pattern, asked):
            return re.sub(rf"^{pattern}$", plain, asked)
    return text

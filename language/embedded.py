"""Questions within others: "can you tell me where the red one is" asks "where is the red one"."""

from __future__ import annotations

import re

_ASKER = (  # "might I trouble you to", "would you be so good as to", "who can"
    r"(?:might|may|could|can|would|will|i|we|you|trouble|ask|bother|be|so|very|good|kind|as|enough|to|please|who"
    r"|some ?body|someone|any ?body|anyone|was|am|wondering|wonder|if|like|love|want|for|able|is|it|possible|mind"
    r"|kindly|just|need)"
)
TELLING = (  # what comes before a question that is asked within another sentence
    rf"(?:{_ASKER} )*tell(?:ing)? (?:me|us|everyone|everybody|him|her|them"
    r"|(?:(?:my|our|these|this|a) )?\w+(?= (?:if|whether|what|where|which|who|how|why)\b))"
    r"|let (?:me|us) see(?! what (?:do|did) (?:i|we)\b)"
    r"|say|do you know|do you happen to know|any idea|i wonder|i am wondering|i was wondering|i want to know"
    r"|i (?:(?:would|do|will|now|also|just|really|still|then) )*(?:like|want|love|need|wish)"
    r" to (?:know|hear|learn|see)"
    r"(?= (?:if|whether|what|where|which|who|how|why)\b)|let me know|do you remember|remind me|explain"
)
_TELLS = (
    rf"(?:{TELLING}|do you have (?:any|an) idea|have you any idea|i need to know|report"
    r"|(?:can|could|would|will|might|may) you (?:please )?"
    r"(?:tell me|say|check|see|find out|remind me|let me know|explain)"
    r"|(?:please )?(?:check|find out|see|look)(?: for me)?)"
)
_OPENING = re.compile(
    rf"^(?:(?:and|so|but|well|hey|okay|robot|please|then|now|just|also|,) )*{_TELLS}(?: please| again)?(?: ,)? "
    r"(?=(?:if|whether|what|where|which|who|how|why)\b)"
)
_UNSURE = re.compile(  # "I keep forgetting which cube is in the drawer"
    r"^(?:(?:sorry|but|oh|well|,) )*i (?:(?:really|just|still|always) )*(?:(?:keep |have )?forg(?:et|ot|etting|otten)"
    r"|(?:am|was) (?:not sure|unsure|curious)|have no idea|ask myself|(?:do|can) not (?:know|remember|recall|tell))"
    r" (?=(?:if|whether|what|where|which|who|how)\b(?! to\b))"
)
_UNKNOWN = re.compile(  # "I can't see what you hold, what is it"
    r"^(?:(?:sorry|but|oh|well|,) )*i (?:(?:can|could) not (?:see|tell|remember|make out)"
    r"|(?:do|did) not (?:know|see|remember|hear|catch|understand)) "
    r"(?P<asked>(?:what|where|who|how|why) (?!to\b)[^,]+?)"
    r"(?: , (?:what|where|who) (?:is|was|are|were) (?:it|that|they))?$"
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
_NAMED = (
    r"(?:(?:\w+ )?(?:drawer|fridge|refrigerator|freezer|button|lever|wheel|gripper|hand|cube|block|one)|it|that|this)"
)
_STATE = r"(?:open|opened|closed|shut|empty|full|pressed|free)"
_STANDS = r"(?:standing|sitting|lying|located|placed|positioned|to be found|exactly|right now|at the moment|at moment)"
_PLAINER = tuple(  # "drawer open?", "whereabouts is it", "where does it stand"
    (re.compile(rf"^{pattern}(?P<end> ?[?.!]*)$"), rf"{plain}\g<end>")
    for pattern, plain in (
        (
            rf"(?P<what>{_NAMED}) (?P<so>(?:still |already |now )?{_STATE})(?: now| yet| already)?(?= ?\?)",
            r"is \g<what> \g<so>",
        ),
        (rf"(?P<what>{_NAMED}) 's (?P<so>{_STATE}\b.*?)", r"\g<what> is \g<so>"),
        (r"whereabouts (?P<rest>.+?)", r"where \g<rest>"),
        (r"where (?:does|do|did) (?P<what>.+?) (?:stand|sit|lie|rest|stay)(?: now| right now)?", r"where is \g<what>"),
        (rf"where (?P<be>is|are) (?P<what>.+?)(?: {_STANDS})+", r"where \g<be> \g<what>"),
        (r"(?:which|what) (?:place|position|spot) (?:is|are) (?P<what>.+?) (?:at|in|on)", r"where is \g<what>"),
        (r"what (?:is|was) your (?:last|latest|previous|most recent) (?:move|step|action|deed)", "what did you do"),
    )
)


def direct(text: str) -> str:
    """Return plain words that ask for the answer to a question as that question; other words as they are."""
    end = text.rstrip(" ?.!")
    opening, unknown = _OPENING.match(text) or _UNSURE.match(end), _UNKNOWN.match(end)
    if opening is None and unknown is None:
        return _plainer(text)
    asked = _plainer(unknown["asked"] if unknown else end[opening.end() if opening else 0 :])
    for pattern, plain in _FORMS:
        if re.fullmatch(pattern, asked):
            return re.sub(rf"^{pattern}$", plain, asked)
    return text if opening and opening.re is _OPENING else asked


def _plainer(text: str) -> str:
    """Return a question in plainer words."""
    for pattern, plain in _PLAINER:
        text = pattern.sub(plain, text)
    return text

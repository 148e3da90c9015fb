"""Commands for a later time, "open it tomorrow", "press it when I say so": the arm acts at once and has no clock."""

from __future__ import annotations

import re

_UNIT = r"(?:seconds?|minutes?|hours?|days?|weeks?|months?)"
_NUMBER = r"(?:\d+|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|twenty|thirty)"
_MANY = rf"(?:(?:a|an|about|another|few|couple of|some|half|more|{_NUMBER}) )"
_DAY = r"(?:monday|tuesday|wednesday|thursday|friday|saturday|sunday)s?"
_MEAL = r"(?:lunch|dinner|breakfast|supper|work|school|break|meeting)"
_WHO = r"(?:i|we|he|she|they|someone|somebody|(?:my|our|his|her|your) \w+)"
_DOES = r"(?:says?|tells?|leaves?|comes?|arrives?|returns?|calls?|claps?|whistles?|nods?|snaps?|finish(?:es)?|goes|go)"
_AFTER_THAT = r"(?: (?:so|go|now|home|back|stop|it|hands?|you|out|away))*"
_LATER = re.compile(
    rf"\b(?:tomorrow(?! ?'s)|tonight|(?:this|in) (?:evening|afternoon)|next (?:{_UNIT}|year|{_DAY})|(?:on |by )?{_DAY}"
    rf"|at (?:noon|midnight|{_NUMBER} (?:am|pm|o ?'? ?clock))|(?:after|at) {_MEAL}"
    rf"|(?:in|after|within) {_MANY}+{_UNIT}|{_MANY}*{_UNIT} (?:from now|later)"
    rf"|wait (?:for )?(?!(?:a|another) {_UNIT}){_MANY}+{_UNIT}|every {_MANY}*(?:{_UNIT}|morning|evening|night|{_DAY})"
    rf"|(?:when|whenever|once|as soon as|after) {_WHO} {_DOES}{_AFTER_THAT}"
    r"|(?<!for )(?<!and )(?<!or )(?<!then )later(?: on| today)?(?= please$|$))"
)
_WANTED = re.compile(r"\bi (?:want|would like|need|hope) to (?:find|see|have)\b")  # what shall be so then is done now


def later_time(plain: str) -> str:
    """Return the words of a sentence (in plain lower case) that say when it shall be done, if that is not now; ""."""
    found = _LATER.search(plain)
    return found[0] if found is not None and not _WANTED.search(plain) else ""

"""Signals about the motion in their plainest words: "I'd like you to move a little quicker" says "move quicker"."""

from __future__ import annotations

import re

_KIND = r"(?:(?:please|just|now|then|maybe|perhaps|kindly|simply|also|quickly|immediately|actually) )*"
_WISHED = re.compile(  # before what the robot shall do
    rf"^{_KIND}(?:(?:so|hey|and|but|okay|no|robot) )*{_KIND}"
    r"(?:(?:i|we) (?:(?:would|will|do|really|just|only|now|also|am going to) )*"
    r"(?:want|need|like|love|prefer|wish|ask|asked|tell|told|expect|order|beg|wanted)(?: for)? you to"
    r"|you (?:have|need|are|ought|are supposed) to|you (?:should|must|can|could|may|had better)"
    r"|(?:can|could|shall) we|let us|(?:can|could|would|will) you|feel free to|it is (?:time|okay) to"
    r"|it (?:would|will) be (?:\w+ )?(?:nice|good|great|best|better|helpful) if you(?: could| would)?"
    r"|(?:i think|i guess|maybe|perhaps) you (?:should|could|can|must)"
    rf") {_KIND}(?=\w)"
)
_MINDED = re.compile(rf"^{_KIND}(?:would|do) you mind {_KIND}(?P<verb>\w+?)(?P<double>[bdgmnpt])?(?P=double)?ing\b")
_LITTLE = (
    r"(?:(?:just|only) )?(?:(?:a )?(?:(?:tiny|little|wee|small) )*(?:bit|little|tad|touch|notch)|slightly|somewhat)"
)
_MUCH = r"(?:a lot|a good bit|much|lots|way|even|far|any)"
_PACE = (
    r"(?:(?:faster|quicker|slower)(?: (?:movements?|moves?|motions?))?"
    r"|(?:more|less) (?:quickly|speedily|slowly|gently|carefully)|quickly|slowly|gently)"
)
_MOVES = (
    r"(?:move|go|work|act|be|drive|run|walk|turn|do (?:it|that|this|things)|take (?:it|things)|make it|go about it|get)"
)
_PACED = re.compile(rf"^(?:come on )?(?:{_MOVES} )?(?:(?:{_LITTLE}|{_MUCH}) )*(?:{_MOVES} )?(?P<pace>{_PACE})$")
_BEFORE = r"(?:last|latest|previous|preceding|most recent|recent)"
_DEED = (
    rf"(?:(?:your|my|that|this) )?(?:(?:very )?{_BEFORE} )?"
    r"(?:steps?|moves?|actions?|commands?|orders?|things?|changes?|instructions?|one|movement|operation|request|task|undo|undoing)"
)
_DID = r"(?:what|whatever|thing|all|everything) (?:that )?(?:you|we|i) (?:(?:just|have|had|last) )*(?:did|done|do)"
_AFTER_ALL = r"(?: after all| anyway| though)*"
_ONCE_MORE = r"(?:again|once more|once again|one more time|another time|a second time|over again|over)"
_JUST_NOW = r"(?:just now|last|before|a (?:moment|second|minute) ago|just then)"
_UNDO = r"(?:undo|revert|reverse|cancel|rewind|roll back|take back|go back on|unwind|backtrack)"
_UNDOES = re.compile(
    rf"^(?:(?:please|now|no|and) )*(?:{_UNDO} (?:{_DEED}|{_DID}|(?:it|that|this)(?: again)?)(?: {_JUST_NOW})?"
    rf"|take (?:(?:your|my) )?(?:{_BEFORE} )(?:step|move|action|command|order|movement) back"
    rf"|take {_DID} back|(?:go|move|take) (?:one|a|1) step back|take that (?:last (?:one|thing|step) )?back"
    rf"|{_UNDO} (?!\w*thing\b)\w+ing(?: of (?:it|that))?)$"
)
BETTER_BEFORE = re.compile(  # "it looked nicer the way it was before"
    r"^(?:(?:no|oh|well|actually|but|wait|i think|you know what) )*"
    r"(?:(?:it|that) (?:was|looked) (?:better|nicer|prettier|tidier|neater|right|fine|good)"
    r"|i (?:liked|preferred) it(?: better| more)?)"
    r" (?:before|(?:where|how|way) (?:it was|you had it)(?: before)?)$"
    r"|^(?:(?:no|oh|well|actually|but|i think) )*"
    r"(?:first|previous|old|earlier|former|original|last) (?:place|spot|position)(?: for it)? was (?:better|nicer)$"
)
_REPEATS = re.compile(
    rf"^(?:(?:please|now|and|then) )*(?:(?:repeat|redo)(?: (?:{_DEED}|{_DID}|it|that|this))?(?: {_JUST_NOW})?"
    rf"(?: {_ONCE_MORE})?|(?:do|run|perform|execute|try|make) (?:(?:exactly )?(?:{_DEED}|{_DID}|it|that|this))"
    rf"(?: {_JUST_NOW})? {_ONCE_MORE}){_AFTER_ALL}$"
)
STARTING = "start|starting|initial|original|resting|rest|neutral|default|parking|base|first"
PLACES = "position|pose|point|place|posture|location"  # that are the STARTING ones, where the arm rests
_REST = rf"(?:home|(?:(?:your|its) )?(?:home|{STARTING}) (?:{PLACES}|spot))"
_ARM = r"(?:(?:your|robot|yourself) ?)?(?:arm|gripper|hand|yourself)?"
_GOES_HOME = re.compile(
    rf"^(?:(?:please|now|and|then) )*(?:(?:go|move|come|return|get|drive|bring|put|take|let|have)(?: {_ARM})?"
    rf"(?: (?:go|return|move|come))? )(?:back )?(?:(?:to|in|into|at) )?{_REST}"
    r"(?: and (?:then )?(?:rest|relax|sleep|wait|stay)(?: there| here)?)?$"
)


def plainest(text: str) -> str:
    """Return the words of a signal in their plainest form; those of other sentences as they are."""
    minded = _MINDED.match(text)
    said = f"{minded['verb']}{minded['double'] or ''}{text[minded.end() :]}" if minded else _WISHED.sub("", text)
    said = re.sub(rf"^{_KIND}(?=\w)", "", said)
    said = re.sub(
        r"(?: (?:please|right now|immediately|now|next time|at once|for a (?:second|moment)|from (?:now|here) on"
        r"|that would be (?:nice|great|good|lovely|better)"
        rf"|{_LITTLE}))+$",
        "",
        said,
    )
    for pattern, plain in ((_UNDOES, "undo"), (BETTER_BEFORE, "undo"), (_REPEATS, "again"), (_GOES_HOME, "home")):
        if pattern.match(said):
            return plain
    paced = _PACED.match(said)
    if paced is not None:
        fast = paced["pace"].startswith(("fast", "quick", "more quick", "more speed", "less slow", "less careful"))
        return "faster" if fast else "slower"
    return text if said == "hold it" else said  # "I want you to hold it" is no stop

"""Verbs, whole commands, and words between steps in people's commands.

Tables of words that are only understood. They are apart from the registries (`language.colors.COLORS`,
`language.objects.NOUNS`, ...), whose order and size determine token ids and random draws of trained policies.
A new word or phrase is one entry; commas separate phrases; articles are left out.
"""

from __future__ import annotations

# Action -> verbs. What the arm holds, and whether a place follows, decides between readings.
VERBS: dict[str, str] = {
    "take": (
        "take, pick, pick up, pickup, grab, grab hold of, get, grasp, hold, hold on to, lift, lift up, raise, "
        "fetch, collect, catch, select, take up, pull up, choose, take hold of, picking, picking up, taking, "
        "grabbing, seize, pull out, take out, keep hold of"
    ),
    "move": (
        "move, put, place, set, shift, transfer, stack, carry, lay, leave, position, relocate, transport, keep, "
        "insert, stick, bring, placed, putted, putting, placing, moving, slide, drag, reposition, pile, add, "
        "load, sort, gather, collect, hang, get, rest, stand, balance, moved, put back, place back, return, "
        "displace, situate, locate, mount, fix, attach, deposit, rearrange"
    ),
    "drop": (
        "drop, release, let go, let go of, put down, place down, lower, set down, drop down, lay down, let fall, "
        "ungrasp, unhand, drop off, deposit"
    ),
    "remove": "remove, clear, take away, take off",
    "give": (
        "bring me, give me, pass me, hand me, get me, fetch me, i want, i need, i would like, i'd like, give, "
        "bring us, hand, pass, hand over, bring over"
    ),
    "unstack": "unstack",
    "push": "push, shove, nudge, slide, pushing, poke",
    "reach": (
        "reach, reach for, touch, go to, move to, point to, point at, approach, go near, move your hand to, move "
        "the gripper to, move the arm to, move your arm to, go over to, move the hand to, tap, show me"
    ),
    "press": "press, push, press down on, hit, push down on, click",
    "switch": "switch, flip, toggle, pull, throw, turn on, turn off, activate",
    "turn": "turn, twist, rotate, spin",
    "open": "open, open up",
    "close": "close, shut",
}
# Whole commands without an object.
CONTROLS: dict[str, str] = {
    "stop": (
        "stop, halt, freeze, stop it, stop that, don't move, do not move, abort, cancel, stay, stop moving, stop "
        "there, never mind, nevermind, stop now, whoa, quit, enough"
    ),
    "wait": (
        "wait, hold on, pause, one moment, wait a second, wait a moment, hang on, hold on a second, just a "
        "moment, wait a minute, hold still"
    ),
    "home": (
        "go home, home, return home, go back home, move home, reset, move back to your starting position, go to "
        "your home position, go back to the start, return to start, go to the start position, return to your "
        "starting position, go to home, go back to your starting position, retract, move away"
    ),
    "undo": (
        "undo, undo that, revert, take that back, undo it, go back, undo the last step, put it back, put it back "
        "where it was, put that back"
    ),
    "again": (
        "again, repeat, do it again, do that again, once more, repeat that, one more time, same again, the same "
        "again, redo, repeat it, a bit further, a bit more, a little more, further, more, keep going, continue, a "
        "little further"
    ),
    "faster": "faster, go faster, speed up, quicker, hurry up, hurry, move faster, be quicker",
    "slower": (
        "slower, go slower, slow down, more slowly, move slower, easy, careful, carefully, go a bit slower, a bit "
        "slower"
    ),
    "yes": (
        "yes, yeah, yep, yup, ok, okay, sure, correct, right, exactly, that's right, y, yes that one, that one, "
        "that's it"
    ),
    "no": "no, nope, nah, wrong, not that, not that one, that's wrong, n, neither",
}
# Other words, by category.
SINGLES: dict[str, str] = {
    "not_meant": (
        "no, not that one, not that, sorry, actually, i meant, i mean, no i meant, no i mean, rather, instead, "
        "wrong, nope"
    ),
    "particle": "up, down, away, back, over, off, out",
    "join": ("and, then, and then, ., ;, after that, afterwards, next, &, and also, also, finally, and afterwards"),
    "if": "if, when, in case, provided",
    "there": "there is, there's, there are, you see, you can see, you have, you find",
    "else": "otherwise, else, if not, or else",
    "never": "don't, do not, never, dont",
}
# Words that add nothing. They are skipped at no cost.
FILLERS = frozenset(
    [
        "!",
        "'",
        ",",
        "-",
        ":",
        "?",
        "about",
        "again_please",
        "and/or",
        "are",
        "arm",
        "be",
        "been",
        "being",
        "can",
        "carefully",
        "color",
        "colored",
        "colour",
        "coloured",
        "computer",
        "could",
        "currently",
        "directly",
        "exactly",
        "gently",
        "go",
        "goes",
        "hey",
        "hi",
        "how",
        "i",
        "is",
        "its",
        "just",
        "kept",
        "kindly",
        "lies",
        "like",
        "located",
        "lying",
        "must",
        "my",
        "now",
        "ok",
        "okay",
        "paced",
        "piled",
        "placed",
        "please",
        "positioned",
        "present",
        "resting",
        "rests",
        "right_away",
        "robot",
        "sat",
        "shaped",
        "should",
        "sir",
        "sits",
        "sitting",
        "situated",
        "slowly",
        "so",
        "stacked",
        "standing",
        "stands",
        "thank",
        "thanks",
        "that",
        "that's",
        "thats",
        "the",
        "there",
        "there's",
        "to",
        "very",
        "want",
        "was",
        "which",
        "which's",
        "will",
        "would",
        "you",
        "your",
    ]
)

"""Words that are understood in people's commands, by category. The sentences of the project's own grammar use none of these.

These tables are apart from the registries (`language.colors.COLORS`, `language.objects.NOUNS`, ...), whose order and size
determine token ids and random draws of trained policies. Words of the registries are read from them, so that a colour or
noun that is added there is understood here too. A new word or phrase is one entry.
"""

from __future__ import annotations

from language.colors import COLORS
from language.objects import NOUNS, SIZES

# Colour word -> the colours that it may mean, the likeliest first. The first that the scene holds is taken.
NEAR_COLORS: dict[str, tuple[str, ...]] = {
    "light blue": ("cyan", "blue"),
    "sky blue": ("cyan", "blue"),
    "blue sky": ("cyan", "blue"),
    "sky": ("cyan", "blue"),
    "aqua": ("cyan",),
    "teal": ("cyan", "green"),
    "turquoise": ("cyan",),
    "dark blue": ("blue",),
    "navy": ("blue",),
    "magenta": ("magenta", "pink", "purple"),
    "fuchsia": ("magenta", "pink", "purple"),
    "pink": ("pink", "magenta", "purple"),
    "purple": ("purple", "magenta", "pink"),
    "violet": ("purple", "magenta", "pink"),
    "lilac": ("purple", "magenta", "pink"),
    "light green": ("green",),
    "dark green": ("green",),
    "dark red": ("red",),
    "light grey": ("gray", "white"),
    "light gray": ("gray", "white"),
    "dark grey": ("gray",),
    "dark gray": ("gray",),
    "silver": ("gray",),
    "white": ("white",),
    "golden": ("yellow", "orange"),
    "gold": ("yellow", "orange"),
}

# Kind of a scene's things -> nouns. "thing" is any of them.
THINGS: dict[str, tuple[str, ...]] = {
    "cube": ("cube", "block", "brick", "box", "square", "cubes", "blocks", "bricks", "boxes"),
    "pyramid": ("pyramid", "prism", "tetrahedron", "triangle", "cone", "pyramids", "prisms", "tetrahedra", "triangles"),
    "sphere": ("orb", "globe", "balls", "spheres"),
    "cylinder": ("can", "cylinders", "tubes", "tins"),
    "button": ("buttons",),
    "lever": ("switch",),
    "wheel": (),
    "thing": ("one", "object", "thing", "piece", "item", "shape", "ones", "objects", "things", "pieces", "items"),
}
STACKS = (
    "stack, tower, pile, pillar, column, stick, building, parallelipiped, parallelepiped, slab, combination, heap, group"
    ", towers, stacks, set, parallelopiped, double"
)
# Part of a board or table -> nouns.
REGIONS: dict[str, str] = {
    "corner": "corner, corners",
    "edge": "edge, border, margin, rim",
    "side": "side, half, end",
    "center": "center, centre, middle",
    "cell": "square, cell, space, field, tile, spot, place, position",
    "board": "board, table, floor, grid, ground, table top, tabletop, desk, surface, playing field, chessboard",
    "robot": "robot, you, robot arm, arm, yourself, your base, gripper, hand, the robot",
    "person": "me, us, my hand, myself",
    "gap": "gap",
}
FIXTURES: dict[str, tuple[str, ...]] = {"drawer": ("drawer",), "door": ("door", "fridge", "fridge door", "lid")}

# Relation -> phrases. The kind of the anchor decides what a preposition such as "on" means.
RELATIONS: dict[str, str] = {
    "on": "on top of, on the top of, on to the top of, to the top of, to top of, onto the top of, onto top of, on top, ontop of, "
    "ontop, atop, atop of, upon, on, onto, on to, up on, at the top of, at top of, in top of, over the top of, on the back of, "
    "on the head of, over top of, up onto, standing on, on upon, directly on, o top of, directly above",
    "over": "over, above, on above, over on",
    "in": "in, inside, into, within, inside of, in to",
    "at": "at, by the",
    "to": "to, towards, toward, unto",
    "from": "from, off, off of, out of, from top of, from the top of, from on top of, from over, from above, from atop, "
    "from off, off the top of, off top of, of the top of, from on, of top of",
    "of": "of",
    "under": "under, below, beneath, underneath, at the bottom of, the support of",
    "left": "left of, to the left of, on the left of, left to, to the left side of, on the left side of, at the left of, "
    "on left of, to left of, at left of, left side of, left hand side of, to the left to, on the left hand side of, at left to, "
    "left from, to the left from, left side to",
    "right": "right of, to the right of, on the right of, right to, to the right side of, on the right side of, at the right of, "
    "on right of, to right of, at right of, right side of, right hand side of, to the right to, on the right hand side of, "
    "right from, to the right from, right side to",
    "front": "in front of, front of, before, to the front of, at the front of, at front of, in the front of, ahead of",
    "behind": "behind, in back of, at the back of, to the back of, in the back of, back of, behind of",
    "near": "near, near to, next to, beside, close to, by, adjacent to, alongside, along side, around, besides, adjacent, "
    "bordering, touching, next, close by, nearby, at the side of, by the side of, beside of, to the side of",
    "nearest": "nearest to, closest to, nearest, closest, closer to, nearer to, most close to, closer, nearest from, closest from, "
    "that is nearest, closest towards, the nearest to, nearest the",
    "farthest": "farthest from, furthest from, most distant from, farthest away from, furthest away from, far from, "
    "away from, far away from",
    "opposite": "opposite, opposite to, opposite of, diagonally opposite, diagonally opposed to, diametrically opposed to, "
    "diametrically opposite, diagonally opposite to, opposed to, across from",
    "with": "with, that has, which has, having, containing, supporting",
}
# Direction -> phrases that need no anchor.
DIRECTIONS: dict[str, str] = {
    "left": "left, to the left, leftwards, leftward, to left, on the left, at the left, towards the left",
    "right": "right, to the right, rightwards, rightward, to right, on the right, at the right, towards the right",
    "forward": "forward, forwards, ahead, straight ahead, away from you, to the front",
    "backward": "backward, backwards, back, towards you, closer to you, toward you, to the back",
    "up": "up, upwards, upward, higher",
    "down": "down, downwards, lower",
}
# Side of the board or table -> words; before a noun they select ("the left cube").
SIDES: dict[str, str] = {
    "left": "left, left hand, lefthand, leftmost, left most, most left, west",
    "right": "right, right hand, righthand, rightmost, right most, most right, east",
    "far": "far, top, upper, farther, topmost, top most, uppermost, north",
    "near": "bottom, lower, nearer, bottom most, south, lowermost",
    "front": "front, frontal, frontmost, front most",
    "back": "back, rear, rearmost, back most",
    "center": "center, centre, middle, central",
}
SUPERLATIVES: dict[str, str] = {
    "left": "leftmost, left most, most left, farthest left, furthest left, far left, far most left",
    "right": "rightmost, right most, most right, farthest right, furthest right, far right",
    "high": "highest, topmost, top, tallest, upper, uppermost, on top",
    "low": "lowest, bottom, lower, shortest",
    "nearest": "nearest, closest, closer, nearby, nearer",
    "farthest": "farthest, furthest, most distant, far, farthest away, furthest away",
    "largest": "largest, biggest, bigger, larger",
    "smallest": "smallest, littlest, smaller",
}
SINGLE = (
    "single, lone, only, individual, solitary, alone, isolated, standalone, stand alone, stand-alone, lonely, separate"
)
OTHER = "other, another, different, second other"
EXPOSED = "exposed, free, uncovered, clear, visible"
EVERY = "all, all the, all of the, every, each"
BOTH = "both, both the, both of the"
ANY = "a, an, any, some, one, either, one of the, any of the, either of the, some of the"
VACANT = "vacant, empty, unoccupied, free, un occupied"

NUMBERS = ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
ORDINALS = {
    "first": 1,
    "1st": 1,
    "second": 2,
    "2nd": 2,
    "third": 3,
    "3rd": 3,
    "fourth": 4,
    "4th": 4,
    "fifth": 5,
    "5th": 5,
}
LAST = "last"
UNITS: dict[str, str] = {  # length in cells, or in metres
    "cell": "square, squares, cell, cells, space, spaces, step, steps, place, places, unit, units, field, fields, block, blocks, "
    "position, positions, grid, grids, box, boxes, tile, tiles, sq, spot, spots, row, rows, column, columns",
    "0.01": "cm, centimeter, centimeters, centimetre, centimetres",
    "0.001": "mm, millimeter, millimeters, millimetre, millimetres",
    "0.1": "dm, decimeter, decimeters",
    "1": "m, meter, meters, metre, metres",
    "0.0254": "inch, inches",
}
A_BIT = "a bit, a little, a little bit, slightly, somewhat, a touch, a tad, a few centimeters, a few cm, bit, little"

# Action -> verbs. What the arm holds, and whether a place follows, decides between readings.
VERBS: dict[str, str] = {
    "take": "take, pick, pick up, pickup, grab, grab hold of, get, grasp, hold, hold on to, lift, lift up, raise, fetch, collect, "
    "catch, select, take up, pull up, choose, take hold of, picking, picking up, taking, grabbing, pull out, take out, keep hold of",
    "move": "move, put, place, set, shift, transfer, stack, carry, lay, leave, position, relocate, transport, "
    "keep, insert, stick, bring, placed, putted, putting, placing, moving, slide, drag, reposition, pile, add, "
    "load, hang, get, rest, stand, balance, moved, put back, place back, return",
    "drop": "drop, release, let go, let go of, put down, place down, lower, set down, drop down, lay down, let fall, ungrasp, unhand, "
    "drop off, deposit",
    "remove": "remove, clear, unstack, take away, get rid of, delete, take off",
    "give": "bring me, give me, pass me, hand me, get me, fetch me, i want, i need, i would like, i'd like, give, bring us, hand, pass, "
    "hand over, bring over",
    "push": "push, shove, nudge, slide, pushing, poke",
    "reach": "reach, reach for, touch, go to, move to, point to, point at, approach, go near, move your hand to, "
    "move the gripper to, move the arm to, move your arm to, go over to, move the hand to, tap, show me",
    "press": "press, push, press down on, hit, push down on, click",
    "switch": "switch, flip, toggle, pull, throw, turn on, turn off, activate",
    "turn": "turn, twist, rotate, spin",
    "open": "open, open up",
    "close": "close, shut",
}
# Whole commands without an object.
CONTROLS: dict[str, str] = {
    "stop": "stop, halt, freeze, stop it, stop that, don't move, do not move, abort, cancel, stay, stop moving, "
    "stop there, never mind, nevermind, stop now, whoa, quit, enough",
    "wait": "wait, hold on, pause, one moment, wait a second, wait a moment, hang on, hold on a second, just a moment, "
    "wait a minute, hold still",
    "home": "go home, home, return home, go back home, move home, reset, move back to your starting position, go to your home position, "
    "go back to the start, return to start, go to the start position, return to your starting position, go to home, "
    "go back to your starting position, retract, move away",
    "undo": "undo, undo that, revert, take that back, undo it, go back, undo the last step, put it back, put it back where it was, "
    "put that back",
    "again": "again, repeat, do it again, do that again, once more, repeat that, one more time, same again, the same again, redo, "
    "repeat it, a bit further, a bit more, a little more, further, more, keep going, continue, a little further",
    "faster": "faster, go faster, speed up, quicker, hurry up, hurry, move faster, be quicker",
    "slower": "slower, go slower, slow down, more slowly, move slower, easy, careful, carefully, go a bit slower, a bit slower",
    "yes": "yes, yeah, yep, yup, ok, okay, sure, correct, right, exactly, that's right, y, yes that one, that one, that's it",
    "no": "no, nope, nah, wrong, not that, not that one, that's wrong, n, neither",
}
NOT_MEANT = (
    "no, not that one, not that, sorry, actually, i meant, i mean, no i meant, no i mean, rather, instead, wrong, nope"
)
PRONOUNS = "it, that, this, them, those, these, that one, this one, itself, the same"
HELD = (
    "you are holding, you're holding, you hold, held, being held, in your hand, in the gripper, in your gripper, in hand, the arm holds, "
    "he is holding, you have, you currently hold, the robot is holding, you picked up, it is holding, you've got, you are currently holding"
    ", the robot holds, carried, in the hand, you just picked up, in the robot's hand, that you are holding"
)
UP_OR_DOWN = "up, down, away, back, over, off, out"
BARE = "nothing on it, nothing on top, nothing on top of it, nothing above it, no block on top"
JOIN = "and, then, and then, ., ;, after that, afterwards, next, &, and also, also, finally, and afterwards"
IF = "if, when, in case, provided"
THERE_IS = "there is, there's, there are, you see, you can see, you have, you find"
ELSE = "otherwise, else, if not, or else"
NOT = "not, isn't, aren't, other than, except, excluding, but not, besides, without, is not, are not"
NEVER = "don't, do not, never, dont"

# Words that add nothing. They are skipped at no cost.
FILLERS = frozenset(
    [
        "the",
        ",",
        "-",
        ":",
        "!",
        "?",
        '"',
        "'",
        "which",
        "that",
        "is",
        "are",
        "was",
        "be",
        "been",
        "being",
        "sitting",
        "sits",
        "standing",
        "stands",
        "resting",
        "rests",
        "lying",
        "lies",
        "located",
        "situated",
        "placed",
        "positioned",
        "currently",
        "now",
        "please",
        "could",
        "you",
        "would",
        "can",
        "will",
        "robot",
        "hey",
        "hi",
        "i",
        "want",
        "to",
        "just",
        "exactly",
        "directly",
        "slowly",
        "gently",
        "kindly",
        "carefully",
        "and/or",
        "sat",
        "which's",
        "that's",
        "thats",
        "its",
        "your",
        "so",
        "first",
        "very",
        "paced",
        "piled",
        "kept",
        "present",
        "there",
        "stacked",
        "how",
        "about",
        "like",
        "ok",
        "okay",
        "should",
        "goes",
        "go",
        "must",
        "thanks",
        "thank",
        "right_away",
        "again_please",
        "my",
        "sir",
        "computer",
        "arm",
        "there's",
        "color",
        "colour",
        "colored",
        "coloured",
        "shaped",
        "my",
    ]
)


def phrases(text: str) -> list[str]:
    """Returns the phrases of a table's entry, which commas separate."""
    return [phrase.strip() for phrase in text.split(", ")]


def colors() -> dict[str, tuple[str, ...]]:
    """Returns every colour word with the colours that it may mean."""
    known = {word: (name,) for name, color in COLORS.items() for word in (name, *color.synonyms)}
    return {**known, **NEAR_COLORS}


def nouns() -> dict[str, tuple[str, ...]]:
    """Returns each kind of thing with its nouns, those of the registry included."""
    kinds = dict.fromkeys([*NOUNS, *THINGS])
    return {
        k: tuple(dict.fromkeys((k, *NOUNS.get(k, ()), *THINGS.get(k, ()))))[k == "thing" :]
        + (("thing",) if k == "thing" else ())
        for k in kinds
    }


def sizes() -> dict[str, str]:
    """Returns the size words, each with its size."""
    return {word: name for name, size in SIZES.items() for word in (name, *size.synonyms)}

"""Relations, directions, sides, superlatives, numbers and lengths in people's commands.

Tables of words that are only understood. They are apart from the registries (`language.colors.COLORS`,
`language.objects.NOUNS`, ...), whose order and size determine token ids and random draws of trained policies.
A new word or phrase is one entry; commas separate phrases; articles are left out.
"""

from __future__ import annotations

# Relation -> phrases. The kind of the anchor decides what a preposition such as "on" means.
RELATIONS: dict[str, str] = {
    "on": (
        "on top of, on the top of, on to the top of, to the top of, to top of, onto the top of, onto top of, on "
        "top, ontop of, ontop, atop, atop of, upon, on, onto, on to, up on, at the top of, at top of, in top of, "
        "over the top of, on the back of, on the head of, over top of, up onto, standing on, on upon, directly "
        "on, o top of, directly above"
    ),
    "over": "over, above, on above, over on",
    "in": "in, inside, into, within, inside of, in to",
    "at": "at, by the",
    "to": "to, towards, toward, unto",
    "from": (
        "from, off, off of, out of, from top of, from the top of, from on top of, from over, from above, from "
        "atop, from off, off the top of, off top of, of the top of, from on, of top of"
    ),
    "of": "of",
    "under": "under, below, beneath, underneath, at the bottom of, the support of",
    "left": (
        "left of, to the left of, on the left of, left to, to the left side of, on the left side of, at the left "
        "of, on left of, to left of, at left of, left side of, left hand side of, to the left to, on the left "
        "hand side of, at left to, left from, to the left from, left side to"
    ),
    "right": (
        "right of, to the right of, on the right of, right to, to the right side of, on the right side of, at the "
        "right of, on right of, to right of, at right of, right side of, right hand side of, to the right to, on "
        "the right hand side of, right from, to the right from, right side to"
    ),
    "front": (
        "in front of, front of, before, to the front of, at the front of, at front of, in the front of, ahead of"
    ),
    "behind": "behind, in back of, at the back of, to the back of, in the back of, back of, behind of",
    "near": (
        "near, near to, next to, beside, close to, by, adjacent to, alongside, along side, around, besides, "
        "adjacent, bordering, touching, next, close by, nearby, at the side of, by the side of, beside of, to the "
        "side of"
    ),
    "nearest": (
        "nearest to, closest to, nearest, closest, closer to, nearer to, most close to, closer, nearest from, "
        "closest from, that is nearest, closest towards, the nearest to, nearest the"
    ),
    "farthest": (
        "farthest from, furthest from, most distant from, farthest away from, furthest away from, far from, away "
        "from, far away from"
    ),
    "opposite": (
        "opposite, opposite to, opposite of, diagonally opposite, diagonally opposed to, diametrically opposed "
        "to, diametrically opposite, diagonally opposite to, opposed to, across from"
    ),
    "with": "with, that has, which has, having, containing, supporting",
}
# Direction -> phrases that need no anchor.
DIRECTIONS: dict[str, str] = {
    "left": "left, to the left, leftwards, leftward, to left, leftways",
    "right": ("right, to the right, rightwards, rightward, to right, rightways"),
    "forward": "forward, forwards, ahead, straight ahead, away from you, to the front",
    "backward": "backward, backwards, back, towards you, closer to you, toward you, to the back",
    "up": "up, upwards, upward, higher",
    "top": "on top, at top, on very top",
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
# Length of a unit, in cells or in metres -> words.
UNITS: dict[str, str] = {
    "cell": (
        "square, squares, cell, cells, space, spaces, step, steps, place, places, unit, units, field, fields, "
        "block, blocks, position, positions, grid, grids, box, boxes, tile, tiles, sq, spot, spots, row, rows, "
        "column, columns"
    ),
    "0.01": "cm, centimeter, centimeters, centimetre, centimetres",
    "0.001": "mm, millimeter, millimeters, millimetre, millimetres",
    "0.1": "dm, decimeter, decimeters",
    "1": "m, meter, meters, metre, metres",
    "0.0254": "inch, inches",
}
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
# Other words, by category.
SINGLES: dict[str, str] = {
    "single": (
        "single, lone, only, individual, solitary, alone, isolated, standalone, stand alone, stand-alone, lonely, "
        "separate"
    ),
    "other": "other, another, different, second other",
    "exposed": "exposed, free, uncovered, clear, visible",
    "every": "all, all the, all of the, every, each",
    "both": "both, both the, both of the",
    "any": "a, an, any, some, one, either, one of the, any of the, either of the, some of the",
    "vacant": "vacant, empty, unoccupied, free, un occupied",
    "bit": (
        "a bit, a little, a little bit, slightly, somewhat, a touch, a tad, a few centimeters, a few cm, bit, little"
    ),
    "pronoun": "it, that, this, them, those, these, that one, this one, itself, the same",
    "held": (
        "you are holding, you're holding, you hold, held, being held, in your hand, in the gripper, in your "
        "gripper, in hand, the arm holds, he is holding, you have, you currently hold, the robot is holding, you "
        "picked up, it is holding, you've got, you are currently holding, the robot holds, carried, in the hand, "
        "you just picked up, in the robot's hand, that you are holding"
    ),
    "bare": "nothing on it, nothing on top, nothing on top of it, nothing above it, no block on top",
    "pointing": "this, that",
    "last": "last",
    "not": "not, isn't, aren't, other than, except, excluding, but not, besides, without, is not, are not",
    "between": "between, in between",
    "here": "here, there, over there, over here",
}

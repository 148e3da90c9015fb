"""Colours, things, stacks and regions in people's commands.

Tables of words that are only understood. They are apart from the registries (`language.colors.COLORS`,
`language.objects.NOUNS`, ...), whose order and size determine token ids and random draws of trained policies.
A new word or phrase is one entry; commas separate phrases; articles are left out.
"""

from __future__ import annotations

from language.colors import COLORS
from language.objects import FITTINGS, HAND, NOUNS, SIZES

# Colour word -> the colours that it may mean, the likeliest first. The first that the scene holds is taken.
NEAR_COLORS: dict[str, str] = {
    "light blue": "cyan, blue",
    "sky blue": "cyan, blue",
    "blue sky": "cyan, blue",
    "sky": "cyan, blue",
    "aqua": "cyan",
    "aquamarine": "cyan",
    "azure": "cyan, blue",
    "lightblue": "cyan, blue",
    "skyblue": "cyan, blue",
    "pale blue": "cyan, blue",
    "bright blue": "cyan, blue",
    "darkblue": "blue",
    "navy blue": "blue",
    "teal": "cyan, green",
    "turquoise": "cyan",
    "dark blue": "blue",
    "navy": "blue",
    "magenta": "magenta, pink, purple",
    "fuchsia": "magenta, pink, purple",
    "pink": "pink, magenta, purple",
    "purple": "purple, magenta, pink",
    "violet": "purple, magenta, pink",
    "rose": "pink, magenta, purple",
    "light pink": "pink, magenta, purple",
    "dark pink": "magenta, pink, purple",
    "lilac": "purple, magenta, pink",
    "light green": "green",
    "dark green": "green",
    "dark red": "red",
    "light grey": "white, gray",
    "light gray": "white, gray",
    "dark grey": "gray",
    "dark gray": "gray",
    "silver": "gray",
    "white": "white",
    "golden": "yellow, orange",
    "gold": "yellow, orange",
}
# Kind of a scene's things -> nouns. "thing" is any of them.
THINGS: dict[str, str] = {
    "cube": (
        "cube, block, brick, box, square, cuboid, building block, toy block, cuboids, cubes, blocks, building "
        "blocks, bricks, boxes"
    ),
    "pyramid": "pyramid, prism, tetrahedron, triangle, cone, spike, pyramids, prisms, tetrahedra, triangles",
    "sphere": "orb, globe, balls, spheres",
    "cylinder": "can, cylinders, tubes, tins",
    "button": "buttons",
    "lever": "switch",
    "wheel": "",
    "thing": "one, object, thing, piece, item, shape, ones, objects, things, pieces, items",
}
# Role of a thing -> adjectives. See-through things mark places.
ROLES: dict[str, str] = {
    "real": "solid, opaque, real",
    "target": (
        "transparent, translucent, see through, seethrough, glassy, ghostly, target, targets, target area, target "
        "place, target position, goal, goals, goal area, goal position, marker, markers, marked, marked area, marked "
        "place, marked position, marked spot, destination"
    ),
}
STACKS = (
    "stack, tower, pile, pillar, column, stick, building, parallelipiped, parallelepiped, slab, combination, "
    "heap, group, towers, stacks, set, parallelopiped, structure, piles, pillars, columns, stacking, stock"
)
# Part of a board or table, or participant -> nouns.
REGIONS: dict[str, str] = {
    "corner": "corner, corners, angle, vertex",
    "edge": "edge, border, margin, rim, boundary, perimeter, edges",
    "side": "side, half, end, hand side",
    "center": "center, centre, middle",
    "cell": "square, cell, space, field, tile, spot, place, position",
    "board": (
        "board, table, floor, grid, playing board, game board, chess board, base, ground, table top, "
        "tabletop, desk, surface, playing field, chessboard"
    ),
    "robot": "robot, you, robot arm, arm, yourself, your base, gripper, hand, the robot",
    "person": "me, us, my hand, myself",
    "gap": "gap",
}
# Part of the workspace that opens -> nouns.
FIXTURES: dict[str, str] = {
    "drawer": "drawer",
    "door": "door, fridge, fridge door, lid",
}


def phrases(text: str) -> list[str]:
    """Returns the phrases of a table's entry, which commas separate."""
    return [phrase.strip() for phrase in text.split(", ")]


def colors() -> dict[str, tuple[str, ...]]:
    """Returns every colour word with the colours that it may mean; those of the registry mean themselves."""
    known = {word: (name,) for name, color in COLORS.items() for word in (name, *color.synonyms)}
    return {**known, **{word: tuple(phrases(names)) for word, names in NEAR_COLORS.items()}}


def nouns() -> dict[str, tuple[str, ...]]:
    """Returns each kind of thing with its nouns, those of the registry included. Fittings and hands are none."""
    found = {kind: (kind, *synonyms) for kind, synonyms in NOUNS.items() if kind not in (*FITTINGS, HAND)}
    for kind, text in THINGS.items():
        found[kind] = tuple(dict.fromkeys((*found.get(kind, ()), *filter(None, phrases(text)))))
    return found


def sizes() -> dict[str, str]:
    """Returns the size words, each with its size."""
    return {word: name for name, size in SIZES.items() for word in (name, *size.synonyms)}

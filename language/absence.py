"""What shall be nowhere near a place, as what is done about it: "nothing in the drawer", "no cube on the right"."""

from __future__ import annotations

from language.meanings import Clause, Entity, RelationPhrase, Span
from language.verbs import Act, bringing, doing

_OPPOSITE = {"left": "right", "far": "near", "front": "back"} | {"right": "left", "near": "far", "back": "front"}
_ELSEWHERE = {"left": "right", "right": "left", "front": "behind", "behind": "front", "near": "away"}


def cleared(place: RelationPhrase, span: Span) -> Clause | None:
    """Return the clause after which nothing is at a place; None: nothing can be done about it. span: of the wish."""
    if place.name == "direction" and place.value in _OPPOSITE:
        place = RelationPhrase("at", (Entity("side", sides=(place.value,)),), span=place.span)
    anchor = place.anchors[0] if place.anchors else Entity("board")
    if anchor.kind == "mutual" or (anchor.other and place.name == "on"):
        return Clause(doing(Act.UNSTACK), Entity(noun="cube", every=True, plural=True), span=span)
    if place.name == "in" and anchor.kind == "thing":
        return Clause(doing(Act.EMPTY), anchor, span=span)
    if place.name in ("on", "over") and anchor.kind == "thing":
        return Clause(doing(Act.UNSTACK), Entity(relations=(place,)), span=span)
    if place.name in _ELSEWHERE and anchor.kind == "thing":
        there = Entity(noun="cube", every=True, plural=True, relations=(place,))
        return Clause(bringing("goal"), there, (RelationPhrase(_ELSEWHERE[place.name], (anchor,)),), span=span)
    sides = [_OPPOSITE[side] for side in anchor.sides if side in _OPPOSITE]
    if anchor.kind in ("side", "edge") and len(sides) == 1:
        but = tuple(each for each in anchor.relations if each.name == "not")  # "but the gray cube"
        there = Entity(noun="cube", every=True, plural=True, relations=(place, *but))
        other = RelationPhrase("at", (Entity("side", sides=tuple(sides)),))
        return Clause(bringing("goal"), there, (other,), span=span)
    return None

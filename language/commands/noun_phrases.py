"""Noun phrases of the chart without their relations.

For example "the second blue block", "top left corner", "red and green tower".
"""

from __future__ import annotations

from typing import Any, NamedTuple

from language.commands import costs
from language.commands.items import Gaps, Item
from language.commands.meanings import Entity
from language.commands.nouns import REGIONS

_OURS = frozenset({"my", "our"})
_PLURAL = frozenset({"tetrahedra", "boxes"})
_MODIFIERS = (
    "size",
    "role",
    "single",
    "other",
    "every",
    "both",
    "any",
    "ordinal",
    "last",
    "superlative",
    "number",
    "exposed",
    "vacant",
)


class _Draft(NamedTuple):
    """A noun phrase that is being parsed: the next token, its fields so far, its cost, the words left out."""

    at: int
    known: dict[str, Any]
    cost: float
    skipped: int


class NounPhrases:
    """The noun phrases of a chart's sentence."""

    def __init__(self, gaps: Gaps) -> None:
        self._gaps, self._lattice, self._get = gaps, gaps.lattice, gaps.lattice.get

    def at(self, start: int) -> list[Item]:
        """Returns the noun phrases that begin at a token, after a gap."""
        found: list[Item] = []
        drafts = [_Draft(gap.end, {}, gap.cost, gap.skipped) for gap in self._gaps.at(start)]
        while drafts:
            draft = drafts.pop()
            found += self._ended(draft, start)
            drafts += self._extended(draft)
            if draft.known:  # fillers within the phrase, and one unknown word
                drafts += self._skipping(draft)
        return found

    def _skipping(self, draft: _Draft) -> list[_Draft]:
        lattice = self._lattice
        if draft.at >= len(lattice):
            return []
        cost = self._gaps.skip_cost(draft.at)
        if lattice.tokens[draft.at].text == "," or (cost and (draft.skipped or draft.at not in lattice.unknown)):
            return []
        return [_Draft(draft.at + 1, draft.known, draft.cost + cost, draft.skipped | (1 << draft.at if cost else 0))]

    def _extended(self, draft: _Draft) -> list[_Draft]:
        """Returns the drafts with one more modifier."""
        found = []
        for edge in self._get(draft.at, "pointing") if not draft.known else ():
            found.append(_Draft(edge.end, {"pointed": draft.at}, draft.cost + costs.POINTED, draft.skipped))
        for category in _MODIFIERS:
            for edge in self._get(draft.at, category):
                more = _modified(draft.known, category, edge.value)
                if more is not None:
                    found.append(_Draft(edge.end, more, draft.cost + edge.cost, draft.skipped))
        for edge in self._get(draft.at, "side"):
            sides = draft.known.get("sides", ())
            if edge.value not in sides:
                found.append(
                    _Draft(
                        edge.end, {**draft.known, "sides": (*sides, edge.value)}, draft.cost + edge.cost, draft.skipped
                    )
                )
        colors = draft.known.get("colors", ())
        at = draft.at
        if colors and any(
            self._lattice.tokens[at].text == mark for mark in ("and", ",", "&", "+") if at < len(self._lattice)
        ):
            at += 1
            if at < len(self._lattice) and self._lattice.tokens[at].text == "and":
                at += 1
        for edge in self._get(at, "color"):
            found.append(
                _Draft(
                    edge.end, {**draft.known, "colors": (*colors, edge.value)}, draft.cost + edge.cost, draft.skipped
                )
            )
        return found

    def _ended(self, draft: _Draft, start: int) -> list[Item]:
        """Returns the phrases that end with the noun at the draft's token, or without a noun."""
        found = []
        at, known = draft.at, draft.known
        for edge in self._get(at, "noun"):
            found += self._thing(draft, edge, start)
        for edge in self._get(at, "stack"):
            found += self._stack(draft._replace(at=edge.end, cost=draft.cost + edge.cost), start)
        for edge in self._get(at, "region"):
            if edge.value == "robot" and at and self._lattice.tokens[at - 1].text in _OURS:
                continue  # "my hand" is not the robot's
            if not known.keys() & {"colors", "superlative", "single", "size"}:
                found.append(_item(draft, edge.end, edge.cost, start, kind=edge.value))
        for edge in self._get(at, "fixture"):
            found.append(_item(draft, edge.end, edge.cost, start, kind="fixture", noun=edge.value))
        if not known:
            for edge in self._get(at, "pronoun"):
                found.append(_item(draft, edge.end, edge.cost, start, kind="it"))
        elif known.keys() == {"pointed"}:
            found.append(_item(draft, at, 0.0, start, kind="thing"))
        elif not known.keys() - {"sides"}:
            far = costs.FAR_SIDE * ("far" in known["sides"] and len(known["sides"]) > 1)
            found.append(_item(draft, at, 0.5 + far, start, kind="side"))
            found.append(_item(draft, at, 1.2, start, kind="thing"))
        elif known.keys() & {"colors", "ordinal", "other", "every", "number", "single", "role"}:
            found.append(_item(draft, at, costs.NO_NOUN, start, kind="thing"))
        elif known.get("superlative") in ("left", "right") and len(known) == 1:
            sides = draft._replace(known={"sides": (known["superlative"],)})
            found.append(_item(sides, at, 0.5, start, kind="side"))
            found.append(_item(draft, at, costs.SUPERLATIVE_ALONE, start, kind="thing"))
        elif "superlative" in known:
            found.append(_item(draft, at, costs.SUPERLATIVE_ALONE, start, kind="thing"))
        return found

    def _thing(self, draft: _Draft, edge: Any, start: int) -> list[Item]:
        word = self._lattice.tokens[edge.end - 1].text
        noun = None if edge.value == "thing" else edge.value
        known = {**draft.known, "noun": noun, "plural": word.endswith("s") or word in _PLURAL}
        thing = _Draft(edge.end, known, draft.cost + edge.cost, draft.skipped)
        found = []
        for after in self._get(edge.end, "stack"):  # "block tower"
            found += self._stack(thing._replace(at=after.end), start)
        if len(known.get("colors", ())) > 1:  # "the blue and green block" is a stack
            found.append(_item(thing, edge.end, 0.4, start, kind="stack"))
        else:
            found.append(_item(thing, edge.end, 0.0, start, kind="thing"))
            tokens = self._lattice.tokens
            at = edge.end + (edge.end < len(tokens) and tokens[edge.end].text in ("number", "no", "nr"))
            numbers = [e for e in self._get(at, "number") if 0 < e.value < 100]
            found += [_item(thing, e.end, 0.3, start, kind="thing", ordinal=int(e.value)) for e in numbers]
        return found

    def _stack(self, draft: _Draft, start: int) -> list[Item]:
        found = [_item(draft, draft.at, 0.0, start, kind="stack")]
        after = draft.at
        lattice = self._lattice
        for again in self._get(after, "stack"):  # "combination tower"
            found.append(_item(draft, again.end, 0.0, start, kind="stack"))
        if after < len(lattice) and lattice.tokens[after].text in ("of", "with", "made"):
            for inner in self.at(after + 1):
                if inner.value.kind in ("thing", "stack") and not inner.skipped:
                    colors = draft.known.get("colors", ()) + inner.value.colors
                    known = {**draft.known, "colors": colors, "noun": inner.value.noun}
                    found.append(_item(draft._replace(known=known), inner.end, inner.cost, start, kind="stack"))
        return found


def _modified(known: dict[str, Any], category: str, value: Any) -> dict[str, Any] | None:
    """Returns the fields so far with one more modifier; None if they have it already."""
    key = {"both": "number", "last": "ordinal", "vacant": "exposed"}.get(category, category)
    if key in known:
        return None
    values: dict[str, Any] = {
        "both": 2,
        "last": -1,
        "ordinal": value,
        "superlative": value,
        "size": value,
        "role": value,
    }
    if category == "number":
        return {**known, "number": int(value)} if value == int(value) and 0 < value < 100 else None
    return {**known, key: values.get(category, True), **({"every": True} if category == "both" else {})}


def _item(draft: _Draft, end: int, cost: float, start: int, **fields: Any) -> Item:
    known = {**draft.known, **fields}
    if known["kind"] in REGIONS:
        known.pop("colors", None)
    return Item(
        end, Entity(**known, span=(draft.at if not draft.known else start, end)), draft.cost + cost, draft.skipped
    )

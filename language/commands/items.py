"""The items of the chart, and the gaps between them: words that are left out."""

from __future__ import annotations

from typing import Any, NamedTuple

from language.commands import costs
from language.commands.lattice import Lattice
from language.commands.verb_words import FILLERS

_CONTENT = frozenset(
    ("noun", "color", "role", "stack", "region", "number", "ordinal", "verb", "pronoun", "every", "both", "other")
    + ("never", "not", "if", "else")
)


class Item(NamedTuple):
    """A part of a reading: the token after it, its meaning, its cost, and a bit for each token that it leaves out."""

    end: int
    value: Any
    cost: float
    skipped: int = 0


class Gaps:
    """The words of a sentence that may be left out between phrases."""

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        self._gaps: dict[int, list[Item]] = {}

    def at(self, start: int) -> list[Item]:
        """Returns the tokens where the next phrase may begin.

        Fillers are left out at no cost, one other word at a cost.
        """
        if start not in self._gaps:
            found = [Item(at, None, 0.0) for at in self._free(start)]
            for item in list(found):
                if item.end < len(self.lattice):
                    cost = self.skip_cost(item.end)
                    found += [Item(at, None, cost, 1 << item.end) for at in self._free(item.end + 1)]
            best: dict[int, Item] = {}
            for item in found:
                if item.end not in best or item.cost < best[item.end].cost:
                    best[item.end] = item
            self._gaps[start] = list(best.values())
        return self._gaps[start]

    def _free(self, start: int) -> list[int]:
        """Returns the positions from a token on that are reached by leaving out fillers."""
        positions = [start]
        while start < len(self.lattice) and self.lattice.tokens[start].text in FILLERS:
            start += 1
            positions.append(start)
        return positions

    def skip_cost(self, index: int) -> float:
        """Returns the cost of leaving out a token."""
        if self.lattice.tokens[index].text in FILLERS:
            return 0.0
        if index in self.lattice.unknown:
            return costs.SKIPPED["unknown"]
        if "color" in self.lattice.edges[index]:
            return costs.SKIPPED["color"]
        return costs.SKIPPED["content" if _CONTENT & self.lattice.edges[index].keys() else "function"]

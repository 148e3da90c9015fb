"""The table of success under changed conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from trainers.sweeps.runs import share_cell

HEADER = ("condition", "success (95 %)", "/ plain", "disturbed", "wrong object", "episodes")


def with_ratios(results: Mapping[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """The results of `conditions` as rows, with their names and the ratio of their success to that of the first one."""
    plain = next(iter(results.values()))["success_at_end"]
    return [
        {"condition": name, "over_plain": result["success_at_end"] / plain if plain else None, **result}
        for name, result in results.items()
    ]


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows of `with_ratios` as a table in Markdown, the row with the least success marked."""
    worst = min(rows, key=lambda row: row["success_at_end"])
    lines = [HEADER, ["---"] * len(HEADER), *(_cells(row, row is worst and len(rows) > 1) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cells(row: Mapping[str, Any], worst: bool) -> list[str]:
    low, high = row["ci95"]
    return [
        row["condition"] + " (worst)" * worst,
        f"{row['success_at_end']:.3f} ({low:.3f}-{high:.3f})",
        share_cell(row["over_plain"]),
        share_cell(row["disturbed"]),
        f"{row['wrong_object']:.3f}",
        f"{row['episodes']}",
    ]

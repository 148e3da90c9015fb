"""Results of evaluations as text: lines for one, a table for several conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from trainers.sweeps.runs import share_cell

WORST = 5  # transitions that are shown
SHARES = {"success_once": "success_once", "wrong_object": "wrong object", "disturbed": "disturbed"}


HEADER = ("condition", "success (95 %)", "/ plain", "disturbed", "wrong object", "episodes")


def describe(report: dict[str, Any]) -> str:
    """By kind of instruction, by difficulty of the gesture, overall or by split, and how far objects were moved."""
    if "reached" in report:
        return _chains(report)
    lines = [_line(kind, part) for kind, part in report.get("by_kind", {}).items()]
    lines += [
        _line(f"{name} {bin_name(name, part['range'])}", part)
        for name, bins in report.get("by_pointing", {}).items()
        for part in bins
    ]
    overall = [_line(split, part) for split, part in report.get("by_split", {"all": report}).items()]
    return "\n".join([*lines, *overall, *_moved(report)])


def _chains(report: dict[str, Any]) -> str:
    """Return how many instructions were carried out in a row, and which ones were not."""
    rows = [*report["by_task"].items(), *list(report["by_transition"].items())[:WORST]]
    lines = [f"{name:34} {row['success']:.3f} of {row['tried']}" for name, row in rows]
    low, high = report["mean_length_ci95"]
    counts = [f"{share:.3f}" for share in report["reached"]]
    lines.append(f"reached 1 to {report['length']:<22} {' '.join(counts)}")
    mean = f"{'mean length':34} {report['mean_length']:.3f} of {report['length']} (95 %: {low:.3f}-{high:.3f})"
    return "\n".join([*lines, f"{mean}, {report['chains']} chains"])


def _line(name: str, part: dict[str, Any]) -> str:
    low, high = part["ci95"]
    success = f"{name:16} success_at_end {part['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f})"
    rest = [f"{label} {share_cell(part[key])}" for key, label in SHARES.items() if key in part]
    return ", ".join([success, *rest, f"{part['episodes']} episodes"])


def _moved(report: dict[str, Any]) -> list[str]:
    """Return how far objects were moved; no line where that was not measured."""
    measured = {name: value for name, value in report.get("moved", {}).items() if value is not None}
    parts = [f"{name.replace('_', ' ')} {share_cell(value)}" for name, value in measured.items()]
    return [f"{'moved':16} {', '.join(parts)}"] if parts else []


def bin_name(name: str, ends: Sequence[float | None]) -> str:
    """Return the label of a bin: "2-3", "30+", and "6" for a count. ends: its lower and upper edge."""
    low, high = ends
    if name == "objects":
        return f"{low:g}"
    return f"{low:g}+" if high is None else f"{low:g}-{high:g}"


def with_ratios(results: Mapping[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Return results by condition as rows, with the ratio of their success to that of the first one."""
    plain = next(iter(results.values()))["success_at_end"]
    return [
        {"condition": name, "over_plain": result["success_at_end"] / plain if plain else None, **result}
        for name, result in results.items()
    ]


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows of `with_ratios` as a table in Markdown, the row with the least success marked."""
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

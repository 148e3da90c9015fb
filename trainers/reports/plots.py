"""Figures of one run: its learning curve, and success by difficulty of the gesture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from trainers.run.metrics import read_metrics
from trainers.utils.atomic_io import atomic_path


def learning_curve(metrics: Path, target: Path) -> None:
    """Plot success against frames, in training with exploration noise and of the deterministic policy.

    Args:
        metrics: path of metrics.csv.
        target: path of the image.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = read_metrics(metrics)
    figure = Figure(figsize=(7, 4))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for name, label, style in (
        ("train/success", "success in training", "-"),
        ("eval/success_at_end", "success of the deterministic policy", "o-"),
        ("eval/wrong_object", "wrong object", "x--"),
        ("grounding/accuracy", "grounding accuracy", ":"),
    ):
        points = [(row["frames"], row[name]) for row in rows if math.isfinite(row.get(name, math.nan))]
        if points:
            axes.plot(*zip(*points, strict=True), style, label=label)
    axes.set(xlabel="frames", ylim=(-0.02, 1.02))
    axes.grid(alpha=0.3)
    if axes.lines:
        axes.legend(loc="lower right")
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=120, bbox_inches="tight")


PANELS = {  # measure in a result's "by_pointing" -> label of its axis
    "angle": "angle to the nearest rival, from the fingertip (degrees)",
    "objects": "number of objects",
    "distance": "distance from the fingertip (cm)",
    "stray": "angular error of the ray / angle to the nearest rival",
}


def pointing_plot(by_pointing: Mapping[str, Sequence[Mapping[str, Any]]], target: Path, title: str) -> None:
    """Plot success by angle, number of objects, distance and error, with 95 % intervals and episodes per bin.

    Args:
        by_pointing: from a result's JSON; measures that it lacks are left out.
        target: path of the image.
        title: of the figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [name for name in PANELS if name in by_pointing]
    figure = Figure(figsize=(4.5 * min(len(names), 2), 3.6 * -(-len(names) // 2)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(-(-len(names) // 2), min(len(names), 2), squeeze=False).flat
    for axes, name in zip(panels, names, strict=False):
        _panel(axes, name, by_pointing[name])
    for axes in list(panels)[len(names) :]:
        axes.set_axis_off()
    figure.suptitle(f"{title}\n95 % intervals, and the number of episodes above", fontsize="medium")
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=120)


def _panel(axes: Any, name: str, bins: Sequence[Mapping[str, Any]]) -> None:
    positions, shares = range(len(bins)), [part["success_at_end"] for part in bins]
    low, high = zip(*(part["ci95"] for part in bins), strict=True)
    errors = [
        [max(share - end, 0) for share, end in zip(shares, low, strict=True)],
        [max(end - share, 0) for share, end in zip(shares, high, strict=True)],
    ]
    axes.bar(positions, shares, color="tab:blue", alpha=0.35)
    axes.errorbar(positions, shares, errors, fmt="o", color="tab:blue", markersize=4, capsize=3)
    for position, part in zip(positions, bins, strict=True):
        axes.text(position, 1.04, f"{part['episodes']}", ha="center", fontsize="small", color="gray")
    axes.set(xlabel=PANELS[name], ylabel="success at end", ylim=(0, 1.12), xlim=(-0.6, len(bins) - 0.4))
    axes.set_xticks(positions, [bin_name(name, part["range"]) for part in bins], fontsize="small")
    axes.grid(axis="y", alpha=0.3)


def bin_name(name: str, ends: Sequence[float | None]) -> str:
    """The label of a bin: "2-3", "30+", and "6" for a count. ends: its lower and upper edge."""
    low, high = ends
    if name == "objects":
        return f"{low:g}"
    return f"{low:g}+" if high is None else f"{low:g}-{high:g}"

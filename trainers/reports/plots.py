"""Figures as image files: the learning curve and the pointing figure of one run, and curves of several runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from trainers.config import EvalConfig
from trainers.evaluation.evaluation import wilson
from trainers.reports.evaluation_text import bin_name
from trainers.run.metrics import read_metrics
from trainers.run.progress import WINDOW, RecentSuccess
from trainers.sweeps.runs import RunRecord
from trainers.utils.files import atomic_path

Groups = Mapping[str, Sequence[RunRecord]]  # runs with one configuration, by its label
PANELS = {  # measure in a result's "by_pointing" -> label of its axis
    "angle": "angle to the nearest rival, from the fingertip (degrees)",
    "objects": "number of objects",
    "distance": "distance from the fingertip (cm)",
    "stray": "angular error of the ray / angle to the nearest rival",
}
CURVES = {  # column of metrics.csv -> label and style of its line
    "train/success": (f"success in training, mean of {WINDOW} episodes", "-"),
    "eval/success_at_end": ("success of the deterministic policy, 95 %", "o-"),
    "eval/wrong_object": ("wrong object", "x--"),
    "grounding/accuracy": ("grounding accuracy", ":"),
}
MAIN_TASKS = ("nl_reach", "nl_pick_and_place", "nl_reach_gesture")
LEGEND_COLUMNS = 3  # labels in a row below a figure
LEGEND_ROW_HEIGHT = 0.24  # inches
LOSS_POINTS = 60  # of a loss curve
STYLES = ("-", "--", ":")


def learning_curve(metrics: Path, target: Path, config: Mapping[str, Any], evaluation: EvalConfig) -> None:
    """Plot success against frames, in training with exploration noise and of the deterministic policy.

    Training's is the mean of the last `WINDOW` episodes. The policy's has Wilson's 95 % interval.

    Args:
        metrics: path of metrics.csv.
        target: path of the image.
        config: of the run; tells what was trained.
        evaluation: tells of how many episodes an evaluation is.
    """
    rows = read_metrics(metrics)
    figure = Figure(figsize=(7, 4))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    recent = RecentSuccess()
    rows = [row | {"train/success": recent.add(row)} for row in rows]
    for name, (label, style) in CURVES.items():
        points = [(row["frames"], row[name]) for row in rows if math.isfinite(row.get(name, math.nan))]
        if points:
            (line,) = axes.plot(*zip(*points, strict=True), style, label=label)
            if name == "eval/success_at_end":
                frames, low, high = _intervals(points, evaluation)
                axes.fill_between(frames, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
    axes.set(xlabel="frames (control steps of all worlds)", ylabel="share of episodes", ylim=(-0.02, 1.02))
    axes.set_title(_what_was_trained(config), fontsize="medium")
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.grid(alpha=0.3)
    if axes.lines:
        axes.legend(loc="lower right", fontsize="small")
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=120, bbox_inches="tight")


def _intervals(points: Sequence[tuple[float, float]], evaluation: EvalConfig) -> np.ndarray:
    """(3, P) frames and Wilson's 95 % interval of each of the evaluations, whose frames and success `points` has."""
    counts = [evaluation.interval_episodes] * (len(points) - 1) + [evaluation.episodes]
    ends = [(frames, *wilson(round(share * n), n)) for (frames, share), n in zip(points, counts, strict=True)]
    return np.array(ends).T


def _what_was_trained(config: Mapping[str, Any]) -> str:
    """Return task, robot, control mode, algorithm and seed of a run, in a line; without those that its config lacks."""
    names = [config[group]["name"] for group in ("task", "robot", "control", "algo") if group in config]
    names += [f"seed {config['seed']}"] if "seed" in config else []
    return ", ".join(names)


def pointing_plot(by_pointing: Mapping[str, Sequence[Mapping[str, Any]]], target: Path, title: str) -> None:
    """Plot success by angle, number of objects, distance and error, with 95 % intervals and episodes per bin.

    Args:
        by_pointing: from a result's JSON; measures that it lacks are left out.
        target: path of the image.
        title: of the figure.
    """
    names = [name for name in PANELS if name in by_pointing]
    columns, rows = min(len(names), 2), -(-len(names) // 2)
    figure, panels = _figure(rows, columns, (4.5 * columns, 3.6 * rows))
    for axes, name in zip(panels, names, strict=False):
        _panel(axes, name, by_pointing[name])
    for axes in panels[len(names) :]:
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


def success(groups: Groups, target: Path) -> None:
    """Plot the success ratio of the deterministic policy against frames, with a band from worst to best seed."""
    figure, (axes,) = _figure(1, 1, (7.5, 4.2))
    for (label, runs), style in zip(groups.items(), _styles(len(groups)), strict=True):
        _band(axes, label, evaluation_curves(runs, "eval/success_at_end"), style)
    axes.set(xlabel="frames", ylabel="success ratio", ylim=(-0.02, 1.02))
    _save(figure, [axes], target)


def tasks(groups: Groups, target: Path) -> None:
    """Plot the mean return of an episode and the success ratio against frames, side by side."""
    figure, (left, right) = _figure(1, 2, (11, 4.2))
    for (label, runs), style in zip(groups.items(), _styles(len(groups)), strict=True):
        _band(left, label, evaluation_curves(runs, "eval/mean_return"), style)
        _band(right, label, evaluation_curves(runs, "eval/success_at_end"), style)
    left.set(xlabel="frames", ylabel="mean reward of an episode")
    right.set(xlabel="frames", ylabel="success ratio", ylim=(-0.02, 1.02))
    _save(figure, [left, right], target)


def losses(groups: Groups, target: Path) -> bool:
    """Plot each loss against frames, with a row of panels for each algorithm.

    Returns:
        False if no run has losses; then no file is written.
    """
    panels = _panels(groups)
    if not panels:
        return False
    columns = max(len(names) for names in panels.values())
    figure, all_axes = _figure(len(panels), columns, (3.4 * columns, 2.8 * len(panels)))
    styles = dict(zip(groups, _styles(len(groups)), strict=True))
    for row, (algo, names) in enumerate(panels.items()):
        for axes, name in zip(all_axes[row * columns :], names, strict=False):
            for label, runs in groups.items():
                if algorithm(runs[0]) == algo:
                    _band(axes, label, [binned_curve(run, name) for run in runs], styles[label], dots=False)
            axes.set(title=f"{algo}: {name.removeprefix('loss/')}", xlabel="frames")
        for axes in all_axes[row * columns + len(names) : (row + 1) * columns]:
            axes.set_axis_off()
    _save(figure, all_axes, target)
    return True


def algorithm(run: RunRecord) -> str:
    """Return the name of the algorithm of a run."""
    return str(run.config.get("algo", {}).get("name", "-"))


def _panels(groups: Groups) -> dict[str, list[str]]:
    """Return the losses of each algorithm that are finite and not 0 in at least one bin of a run."""
    found: dict[str, dict[str, None]] = {}
    for run in (run for runs in groups.values() for run in runs):
        names = [
            n for n in (run.rows[0] if run.rows else {}) if n.startswith("loss/") and binned_curve(run, n)[1].any()
        ]
        found.setdefault(algorithm(run), {}).update(dict.fromkeys(names))
    return {algo: list(names) for algo, names in found.items() if names}


def evaluation_curves(runs: Sequence[RunRecord], column: str) -> list[np.ndarray]:
    """For each run, (2, points): the frames and values of a column at its evaluations."""
    return [np.array([(row["frames"], row[column]) for row in run.evaluations]).reshape(-1, 2).T for run in runs]


def binned_curve(run: RunRecord, column: str) -> np.ndarray:
    """Return frames and values (2, points) of a column, averaged over at most `LOSS_POINTS` intervals of the run."""
    points = np.array([(row["frames"], row.get(column, np.nan)) for row in run.rows]).reshape(-1, 2)
    points = points[np.isfinite(points[:, 1])]
    parts = [part.mean(0) for part in np.array_split(points, LOSS_POINTS) if len(part)]
    return np.array(parts).reshape(-1, 2).T


def _band(axes: Any, label: str, curves: Sequence[np.ndarray], style: tuple[Any, str], dots: bool = True) -> None:
    """Plot the mean over seeds, for the frames that all of them cover, and a band from the minimum to the maximum."""
    curves = [curve for curve in curves if curve.shape[1]]
    if not curves:
        return
    color, line = style
    low, high = max(curve[0, 0] for curve in curves), min(curve[0, -1] for curve in curves)
    frames = np.unique(np.concatenate([curve[0] for curve in curves]))
    frames = frames[(frames >= low) & (frames <= high)]
    values = np.array([np.interp(frames, *curve) for curve in curves])
    axes.plot(frames, values.mean(0), line, color=color, label=label, marker="o" if dots else None, markersize=3)
    axes.fill_between(frames, values.min(0), values.max(0), color=color, alpha=0.12, linewidth=0)


def _styles(count: int) -> list[tuple[Any, str]]:
    """Return a colour and a line style for each of `count` curves; distinct for up to thirty curves."""
    colors = colormaps["tab10"].colors  # type: ignore[attr-defined]
    return [(colors[i % 10], STYLES[i // 10 % len(STYLES)]) for i in range(count)]


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, columns, squeeze=False).flat)


def _save(figure: Figure, all_axes: Sequence[Any], target: Path) -> None:
    """Save the figure with one legend below all panels, where it hides no curve."""
    named: dict[str, Any] = {}
    for axes in all_axes:
        axes.grid(alpha=0.3)
        axes.set_xlim(left=0)
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        lines, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, lines, strict=True))
    if named:
        figure.set_figheight(figure.get_figheight() + LEGEND_ROW_HEIGHT * -(-len(named) // LEGEND_COLUMNS))
        columns = min(LEGEND_COLUMNS, len(named))
        figure.legend(named.values(), named, loc="outside lower center", ncols=columns, frameon=False)
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=120)

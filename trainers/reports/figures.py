"""Pictures of several runs: success and reward against frames, from evaluation episodes, and losses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from trainers.sweeps.runs import Run

Groups = Mapping[str, Sequence[Run]]
MAIN_TASKS = ("nl_reach", "nl_pick_and_place", "nl_reach_gesture")
LEGEND = 3  # labels side by side below a picture
LINE = 0.24  # inches that a line of labels takes
BINS = 60  # points of a loss curve
STYLES = ("-", "--", ":")


def success(groups: Groups, target: Path) -> None:
    """Success ratio of the deterministic policy against frames, a band from the worst to the best seed."""
    figure, (axes,) = _figure(1, 1, (7.5, 4.2))
    for (label, runs), style in zip(groups.items(), _styles(len(groups)), strict=True):
        _band(axes, label, curves(runs, "eval/success_at_end"), style)
    axes.set(xlabel="frames", ylabel="success ratio", ylim=(-0.02, 1.02))
    _save(figure, [axes], target)


def tasks(groups: Groups, target: Path) -> None:
    """Mean reward of an episode and success ratio against frames, side by side."""
    figure, (left, right) = _figure(1, 2, (11, 4.2))
    for (label, runs), style in zip(groups.items(), _styles(len(groups)), strict=True):
        _band(left, label, curves(runs, "eval/mean_return"), style)
        _band(right, label, curves(runs, "eval/success_at_end"), style)
    left.set(xlabel="frames", ylabel="mean reward of an episode")
    right.set(xlabel="frames", ylabel="success ratio", ylim=(-0.02, 1.02))
    _save(figure, [left, right], target)


def losses(groups: Groups, target: Path) -> bool:
    """Each loss against frames, in a row for each algorithm. False, and no picture, where no run has any."""
    panels = _panels(groups)
    if not panels:
        return False
    columns = max(len(names) for names in panels.values())
    figure, every = _figure(len(panels), columns, (3.4 * columns, 2.8 * len(panels)))
    styles = dict(zip(groups, _styles(len(groups)), strict=True))
    for row, (algo, names) in enumerate(panels.items()):
        for axes, name in zip(every[row * columns :], names, strict=False):
            for label, runs in groups.items():
                if algorithm(runs[0]) == algo:
                    _band(axes, label, [binned(run, name) for run in runs], styles[label], dots=False)
            axes.set(title=f"{algo}: {name.removeprefix('loss/')}", xlabel="frames")
        for axes in every[row * columns + len(names) : (row + 1) * columns]:
            axes.set_axis_off()
    _save(figure, every, target)
    return True


def algorithm(run: Run) -> str:
    """The name of the algorithm that a run learned by."""
    return str(run.config.get("algo", {}).get("name", "-"))


def _panels(groups: Groups) -> dict[str, list[str]]:
    """The losses of each algorithm that are a number, and not 0, at least once."""
    found: dict[str, dict[str, None]] = {}
    for run in (run for runs in groups.values() for run in runs):
        names = [n for n in (run.rows[0] if run.rows else {}) if n.startswith("loss/") and binned(run, n)[1].any()]
        found.setdefault(algorithm(run), {}).update(dict.fromkeys(names))
    return {algo: list(names) for algo, names in found.items() if names}


def curves(runs: Sequence[Run], column: str) -> list[np.ndarray]:
    """(2, points) frames and values of each run's evaluations."""
    return [np.array([(row["frames"], row[column]) for row in run.evaluated]).reshape(-1, 2).T for run in runs]


def binned(run: Run, column: str) -> np.ndarray:
    """(2, points) frames and values of a column, as means over at most `BINS` stretches of the run."""
    points = np.array([(row["frames"], row.get(column, np.nan)) for row in run.rows]).reshape(-1, 2)
    points = points[np.isfinite(points[:, 1])]
    parts = [part.mean(0) for part in np.array_split(points, BINS) if len(part)]
    return np.array(parts).reshape(-1, 2).T


def _band(axes: Any, label: str, each: Sequence[np.ndarray], style: tuple[Any, str], dots: bool = True) -> None:
    """The mean over seeds where all of them were measured, and a band from the least to the greatest."""
    each = [curve for curve in each if curve.shape[1]]
    if not each:
        return
    color, line = style
    low, high = max(curve[0, 0] for curve in each), min(curve[0, -1] for curve in each)
    frames = np.unique(np.concatenate([curve[0] for curve in each]))
    frames = frames[(frames >= low) & (frames <= high)]
    values = np.array([np.interp(frames, *curve) for curve in each])
    axes.plot(frames, values.mean(0), line, color=color, label=label, marker="o" if dots else None, markersize=3)
    axes.fill_between(frames, values.min(0), values.max(0), color=color, alpha=0.12, linewidth=0)


def _styles(count: int) -> list[tuple[Any, str]]:
    """A colour and a line for each of `count` curves, none twice up to thirty."""
    colors = colormaps["tab10"].colors  # type: ignore[attr-defined]
    return [(colors[i % 10], STYLES[i // 10 % len(STYLES)]) for i in range(count)]


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, columns, squeeze=False).flat)


def _save(figure: Figure, every: Sequence[Any], target: Path) -> None:
    """One legend below all panels, which hides no curve."""
    named: dict[str, Any] = {}
    for axes in every:
        axes.grid(alpha=0.3)
        axes.set_xlim(left=0)
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        lines, labels = axes.get_legend_handles_labels()
        named |= dict(zip(labels, lines, strict=True))
    if named:
        figure.set_figheight(figure.get_figheight() + LINE * -(-len(named) // LEGEND))
        figure.legend(named.values(), named, loc="outside lower center", ncols=min(LEGEND, len(named)), frameon=False)
    figure.savefig(target, dpi=120)

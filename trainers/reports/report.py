"""What a sweep came to, in pictures and tables: `python -m trainers.reports.report <sweep dir>`.

Writes report.html, one file with everything in it, and report.md, with its pictures beside it, into the directory. All
curves come from evaluation episodes of the deterministic policy. A directory of several sweeps, or a single run's, will
do as well.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from conf.schema import ConfigError
from trainers.reports import figures, page
from trainers.reports.figures import MAIN_TASKS
from trainers.reports.page import Heading, Paragraph, Part, Picture, Table
from trainers.reports.scores import LEVELS, bootstrap, iqm, kept, reached, result, score
from trainers.sweeps.runs import Run, find_runs, groups, typed
from trainers.sweeps.sweep import starts
from trainers.utils.system_info import machine

SEEDS = "The line is the mean over seeds, the band goes from the worst to the best one."


def write(folder: Path) -> Path:
    """The report of the runs in `folder`, as report.html and report.md there. The HTML file. Raises ConfigError."""
    runs = find_runs(folder)
    begun = groups([run for run in runs if run.config])
    grouped = {label: done for label, each in begun.items() if (done := [run for run in each if run.result])}
    if not grouped:
        raise ConfigError(f"no run in {folder} has finished" + failures(runs))
    parts: list[Part] = [
        Heading("Success ratio"),
        *_success(grouped, folder),
        Heading("How good, and how soon"),
        *_configurations(grouped, {label: len(each) for label, each in begun.items()}),
        Heading("Every seed"),
        _seeds(grouped),
        *_main_tasks(grouped, folder),
        *_losses(grouped, folder),
        *_unfinished(runs),
        *_circumstances(folder),
    ]
    count = sum(map(len, grouped.values()))
    return page.write(folder, f"{count} runs of {len(grouped)} configurations", parts)


def failures(runs: Sequence[Run]) -> str:
    """The first error, to end a message with."""
    errors = [run.reason for run in runs if run.error]
    return f"; {len(errors)} failed: {errors[0]}" if errors else ""


def _success(grouped: dict[str, list[Run]], folder: Path) -> list[Part]:
    figures.success(grouped, folder / "success.png")
    episodes = "Evaluation episodes of the deterministic policy, none of which was trained on. "
    return [Picture("success.png", "Success ratio against frames"), Paragraph(episodes + SEEDS)]


def _configurations(grouped: dict[str, list[Run]], begun: dict[str, int]) -> list[Part]:
    """begun: how many runs of each there are, those that did not finish included."""
    levels = [f"{level:.0%}".replace("%", " %") for level in LEVELS]
    header = ["configuration", "seeds", "success (95 %)", "worst seed (95 %)", "wrong object", "final / best"]
    header += [f"frames to {level}" for level in levels] + [f"seconds to {level}" for level in levels]
    rows = []
    for label, runs in grouped.items():
        s = score(runs)
        seeds = f"{s.seeds}" if s.seeds == begun[label] else f"{s.seeds} of {begun[label]}"
        row = [label, seeds, _within(s.success, s.interval), f"seed {s.worst.seed}: {_success_of(s.worst)}"]
        row += [f"{s.wrong:.3f}", _number(s.kept, ".2f")]
        rows.append(row + [_number(x, ",.0f") for x in (*s.frames, *s.seconds)])
    if len(grouped) > 1:
        rows.append(_together(grouped, len(header)))
    return [Table(header, rows), Paragraph(HOW)]


HOW = (
    "Success: interquartile mean of the seeds' final success (of fewer than four seeds, their mean), with a bootstrap "
    "interval over seeds, drawn again within each configuration. The worst seed's interval is Wilson's, over its "
    "episodes. Wrong object: share of the final episodes, mean over seeds. Final / best: final success over the best "
    "evaluation along the way, of the seed that kept least. Frames and seconds: to the first evaluation with that "
    "success, median over seeds; '-' where it was never reached. Seconds are wall-clock, with start-up and evaluations."
)


def _together(grouped: dict[str, list[Run]], width: int) -> list[str]:
    """The row of all configurations."""
    import numpy as np

    strata = [[result(run)["success_at_end"] for run in runs] for runs in grouped.values()]
    scores = [x for each in strata for x in each]
    row = ["all", f"{len(scores)}", _within(float(iqm(np.array(scores))), bootstrap(strata))]
    return row + [""] * (width - len(row))


def _seeds(grouped: dict[str, list[Run]]) -> Table:
    header = ["configuration", "seed", "success (95 %)", "episodes", "wrong object", "final / best"]
    header += ["frames", "seconds"]
    header += [f"to {level:.0%}".replace("%", " %") for level in LEVELS]
    return Table(header, [_seed(label, run) for label, runs in grouped.items() for run in runs])


def _seed(label: str, run: Run) -> list[str]:
    final = result(run)
    row = [label, f"{run.seed}", _success_of(run), f"{final['episodes']}", f"{final['wrong_object']:.3f}"]
    row += [_number(kept(run), ".2f"), f"{final['frames']:,}", f"{final['wall_s']:,.0f}"]
    for level in LEVELS:
        frames, seconds = reached(run.evaluated, level)
        row.append(f"{frames:,.0f} ({seconds:,.0f} s)" if math.isfinite(frames) else "-")
    return row


def _main_tasks(grouped: dict[str, list[Run]], folder: Path) -> list[Part]:
    """Figure of the tasks that the original was judged on, where the runs have any."""
    main = {label: runs for label, runs in grouped.items() if _task(runs[0]) in MAIN_TASKS}
    if not main:
        return []
    figures.tasks(main, folder / "tasks.png")
    names = ", ".join(task for task in MAIN_TASKS if any(_task(runs[0]) == task for runs in main.values()))
    picture = Picture("tasks.png", f"Mean reward and success ratio: {names}")
    return [Heading("Main tasks"), picture, Paragraph(f"Evaluation episodes of {names}. {SEEDS}")]


def _task(run: Run) -> str:
    return str(run.config.get("task", {}).get("name"))


def _losses(grouped: dict[str, list[Run]], folder: Path) -> list[Part]:
    if not figures.losses(grouped, folder / "losses.png"):
        return []
    said = Paragraph(f"As measured at each update, averaged over {figures.BINS} stretches of the run. {SEEDS}")
    return [Heading("Losses"), Picture("losses.png", "Losses against frames"), said]


def _unfinished(runs: Sequence[Run]) -> list[Part]:
    """What is in none of the numbers above."""
    rows = [[run.folder.name, run.command, run.ending] for run in runs if not run.result]
    return [Heading("Runs that did not finish"), Table(["run", "command", "why"], rows)] if rows else []


def _circumstances(folder: Path) -> list[Part]:
    """Commands and machine: as each sweep's own file tells, or as they are now."""
    files = [folder / "sweep.yaml", *sorted(folder.glob("*/sweep.yaml"))]
    begun = [start for file in files if file.is_file() for start in starts(file.parent)]
    if not begun:
        return [Heading("Machine of this report"), Table(["", ""], [list(item) for item in machine().items()])]
    commands = [[f"{start.get('time', '-')}", typed(start["overrides"], "-m")] for start in begun]
    known: dict[str, Any] = begun[-1].get("machine", {})
    parts: list[Part] = [Heading("Commands"), Table(["started", "command"], commands)]
    return [*parts, Heading("Machine"), Table(["", ""], [[name, str(value)] for name, value in known.items()])]


def _success_of(run: Run) -> str:
    return _within(result(run)["success_at_end"], result(run)["ci95"])


def _within(value: float, interval: Sequence[float]) -> str:
    return f"{value:.3f} ({interval[0]:.3f}-{interval[1]:.3f})"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def main(words: Sequence[str]) -> None:
    """Raises ConfigError."""
    if len(words) != 1 or words[0] in ("-h", "--help"):
        raise ConfigError("give one directory of runs: python -m trainers.reports.report <sweep dir>")
    print(write(Path(words[0])))


def cli() -> None:
    """Runs `main` on the process's arguments."""
    try:
        main(sys.argv[1:])
    except ConfigError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    cli()

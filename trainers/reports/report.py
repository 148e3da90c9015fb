"""The report of a sweep: `python -m trainers.reports.report <sweep dir>`.

It is written twice: as Markdown with image files, and as one HTML file below 5 MB with images and films in it, light or
dark as the reader's system is, whose tables are sorted by a click on a column.
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import ConfigError
from core.program import run_program
from core.system import system_info
from trainers.reports import plots
from trainers.reports.plots import MAIN_TASKS
from trainers.reports.scores import LEVELS, bootstrap, final_over_best, iqm, result_of, score, time_to_level
from trainers.sweeps.runs import (
    NAME,
    RunRecord,
    command_line,
    find_runs,
    group_by_configuration,
    read_starts,
    share_cell,
)
from trainers.utils.files import write_text

STYLE = """
:root { color-scheme: light dark; --ink: #222; --page: #fff; --line: #ddd; --strong: #777; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #ddd; --page: #16181b; --line: #3a3d42; --strong: #999; }
  .plot { filter: invert(0.92) hue-rotate(180deg); } /* dark, with the same hues */
}
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1200px; margin: 2em auto; padding: 0 1em;
  color: var(--ink); background: var(--page); }
img, video { max-width: 100%; border-radius: 6px; background: #fff; }
.films { display: grid; grid-template-columns: repeat(auto-fill, minmax(260px, 1fr)); gap: 1em; }
figure { margin: 0; font-size: 13px; } figure img, figure video { width: 100%; display: block; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0; }
th, td { border-bottom: 1px solid var(--line); padding: 4px 9px; text-align: left; vertical-align: top; }
td:not(:last-child) { white-space: nowrap; }
th { border-bottom: 2px solid var(--strong); }
th button { all: unset; cursor: pointer; } th button:focus-visible { outline: 2px solid; }
th[aria-sort=ascending] button::after { content: " \\25b2"; }
th[aria-sort=descending] button::after { content: " \\25bc"; }
"""
# Sorts by numbers where a cell begins with one, else as text; a second click turns the order round.
SCRIPT = """
document.querySelectorAll("th button").forEach(button => button.onclick = () => {
  const head = button.parentElement, body = head.closest("table").tBodies[0];
  const turn = head.getAttribute("aria-sort") == "ascending" ? -1 : 1;
  const value = row => row.cells[head.cellIndex].textContent.replace(/^seed \\d+: /, "").replaceAll(",", "");
  const order = (a, b) => {
    const [x, y] = [parseFloat(value(a)), parseFloat(value(b))];
    if (isNaN(x) != isNaN(y)) return isNaN(x) ? 1 : -1;
    return turn * (isNaN(x) ? value(a).localeCompare(value(b)) : x - y);
  };
  body.append(...[...body.rows].sort(order));
  head.parentElement.querySelectorAll("th").forEach(each => each.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", turn == 1 ? "ascending" : "descending");
});
"""
FILM = "evaluation.mp4"
FILM_BYTES = 2_700_000  # of all films in the page, where they take a third more as text
POSTER_WIDTH = 320  # pixels


Groups = dict[str, list[RunRecord]]
USAGE = "give one directory of runs: python -m trainers.reports.report <sweep dir>"
SEEDS = "The line is the mean over seeds; the band reaches from the worst to the best seed."
LEVEL_NAMES = [f"{level:.0%}".replace("%", " %") for level in LEVELS]
METHOD = (
    "Success: interquartile mean of the seeds' final success (of fewer than four seeds, their mean), with a bootstrap"
    " interval over seeds, resampled within each configuration; one seed has none. The worst seed's interval is "
    "Wilson's, over its episodes. Wrong object: share of the final episodes, mean over seeds. Disturbed: share of the"
    " successful final episodes in which an object was moved by more than 1 cm that the task does not move; the "
    "greatest over seeds. Final / best: final success over the best evaluation during training, minimum over seeds. "
    "Frames and seconds: to the first evaluation with that success, median over seeds; '-' if it was never reached. "
    "Seconds are wall-clock time with start-up and evaluations."
)


def markdown_text(text: str) -> str:
    """Return text as Markdown that shows it: on one line, and without HTML, links, images or emphasis of its own."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    line = re.sub(r"&(?=#?\w+;)|<(?=[A-Za-z/!?])", lambda match: escape(match[0]), line)
    line = re.sub(r"^(?!-$)[#>+=-]|[\\`*|]|\[(?=[^\]]*\][(\[:])", r"\\\g<0>", line)
    return re.sub(r"(?<=\w)://|(?<=www)\.", lambda match: match[0].replace(":", "&#58;").replace(".", "&#46;"), line)


@dataclass(frozen=True)
class Heading:
    """A heading of the second level."""

    text: str

    def markdown(self) -> str:
        return f"## {markdown_text(self.text)}"

    def html(self, folder: Path) -> str:
        return f"<h2>{escape(self.text)}</h2>"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str

    def markdown(self) -> str:
        return markdown_text(self.text)

    def html(self, folder: Path) -> str:
        return f"<p>{escape(self.text)}</p>"


@dataclass(frozen=True)
class Picture:
    """An image. file: the name of a PNG in the report's directory. title: alternative text."""

    file: str
    title: str

    def markdown(self) -> str:
        title = re.sub(r"(?<!\\)[\[\]]", r"\\\g<0>", markdown_text(self.title))
        return f"![{title}]({self.file})"

    def html(self, folder: Path) -> str:
        data = base64.b64encode((folder / self.file).read_bytes()).decode()
        return f'<img class="plot" alt="{escape(self.title)}" src="data:image/png;base64,{data}">'


@dataclass(frozen=True)
class Table:
    """A table of text cells. total: a last row that keeps its place when the others are sorted."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    total: Sequence[str] = ()

    def markdown(self) -> str:
        rows = [self.header, *self.rows, *([self.total] if self.total else [])]
        lines = [[markdown_text(cell) for cell in row] for row in rows]
        rule = ["---"] * len(self.header)
        return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], rule, *lines[1:]))

    def html(self, folder: Path) -> str:
        head = "".join(f"<th><button>{escape(cell)}</button></th>" if cell else "<th></th>" for cell in self.header)
        body = "\n".join(map(_row, self.rows))
        foot = f"<tfoot>{_row(self.total)}</tfoot>" if self.total else ""
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody>{foot}</table>"
        return f'<div class="wide">{table}</div>'


def _row(cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


@dataclass(frozen=True)
class Films:
    """The films of runs, as many as `FILM_BYTES` allows; of the others their last picture, and where they are.

    films: names and paths of mp4 files.
    """

    films: Sequence[tuple[str, Path]]

    def markdown(self) -> str:
        return "\n".join(f"- {markdown_text(name)}: `{path}`" for name, path in self.films)

    def html(self, folder: Path) -> str:
        left, figures = FILM_BYTES, []
        for name, path in self.films:
            poster, size = last_picture(path), path.stat().st_size
            shown = f'<img alt="" src="{poster}">' if poster else ""
            caption = f"{escape(name)}<br>{escape(str(path))}"
            if poster and size <= left:
                left, caption = left - size, escape(name)
                film = base64.b64encode(path.read_bytes()).decode()
                about = f'aria-label="{escape(name)}" poster="{poster}" src="data:video/mp4;base64,{film}"'
                shown = f'<video controls muted preload="none" {about}></video>'
            figures.append(f"<figure>{shown}<figcaption>{caption}</figcaption></figure>")
        return f'<div class="films">{"".join(figures)}</div>'


def last_picture(film: Path) -> str:
    """Return the last frame of a film, on which its outcome is written, as the URL of a JPEG; "" for a damaged film."""
    from imageio.v2 import get_reader
    from PIL import Image

    try:
        file: Any = get_reader(film)
        with file as reader:
            frame = Image.fromarray(reader.get_data(reader.count_frames() - 1))
    except (OSError, RuntimeError, IndexError, ValueError):
        return ""
    frame.thumbnail((POSTER_WIDTH, POSTER_WIDTH))
    picture = BytesIO()
    frame.save(picture, "JPEG", quality=80)
    return "data:image/jpeg;base64," + base64.b64encode(picture.getvalue()).decode()


Block = Heading | Paragraph | Picture | Table | Films


def write_page(folder: Path, title: str, blocks: Sequence[Block]) -> Path:
    """Write report.md and report.html to `folder`, which holds the images.

    Returns:
        The path of the HTML file.
    """
    write_text(
        folder / "report.md", "\n\n".join([f"# {markdown_text(title)}", *(block.markdown() for block in blocks)]) + "\n"
    )
    body = "\n".join(block.html(folder) for block in blocks)
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    head += f"<style>{STYLE}</style>"
    page = f"<head>{head}</head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n<script>{SCRIPT}</script>\n</body>"
    write_text(folder / "report.html", f'<!doctype html>\n<html lang="en">\n{page}\n</html>\n')
    return folder / "report.html"


def write(folder: Path) -> Path:
    """Write report.html and report.md about the runs in `folder`.

    Returns:
        The path of the HTML file.

    Raises:
        ConfigError: no run has finished, or a file is damaged.
    """
    runs = find_runs(folder)
    started = group_by_configuration([run for run in runs if run.config])
    finished = {label: done for label, each in started.items() if (done := [run for run in each if run.result])}
    if not finished:
        raise ConfigError(f"no run in {folder} has finished" + failures(runs))
    blocks: list[Block] = [
        Heading("Success ratio"),
        *_success_section(finished, folder),
        Heading("Final success and time to success"),
        *_configuration_table(finished, {label: len(each) for label, each in started.items()}),
        Heading("Every seed"),
        _seed_table(finished),
        *_main_tasks_section(finished, folder),
        *_losses_section(finished, folder),
        *_films_section(finished),
        *_unfinished_section(runs),
        *_machine_section(folder),
    ]
    return write_page(folder, _title(finished, max(len(runs), planned(folder))), blocks)


def _title(finished: Groups, wanted: int) -> str:
    """wanted: how many runs there are to be."""
    count, groups = sum(map(len, finished.values())), len(finished)
    runs = f"{count} run{'s' * (count > 1)}" if count == wanted else f"{count} of {wanted} runs"
    return f"{runs} of {groups} configuration{'s' * (groups > 1)}"


def planned(folder: Path) -> int:
    """Return how many jobs the sweeps in a folder have, started or not; 0 without a record of a sweep."""
    return sum(_jobs(read_starts(file.parent)[0]["overrides"]) for file in _sweep_files(folder))


def _jobs(overrides: Sequence[str]) -> int:
    """Return how many jobs a sweep with these overrides has; 0 where Hydra's syntax does not tell."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    try:
        words = OverridesParser.create().parse_overrides(list(overrides))
        return math.prod(len(list(word.sweep_string_iterator())) for word in words if word.is_sweep_override())
    except HydraException:
        return 0


def _sweep_files(folder: Path) -> list[Path]:
    return [file for file in [folder / NAME, *sorted(folder.glob(f"*/{NAME}"))] if file.is_file()]


def failures(runs: Sequence[RunRecord]) -> str:
    """Return the number of failed runs and the first error, as the end of a message; "" if none has failed."""
    errors = [run.reason for run in runs if run.error]
    return f"; {len(errors)} failed: {errors[0]}" if errors else ""


def _success_section(groups: Groups, folder: Path) -> list[Block]:
    plots.success(groups, folder / "success.png")
    episodes = "Evaluation episodes of the deterministic policy; none of them was used for training. "
    return [Picture("success.png", "Success ratio against frames"), Paragraph(episodes + SEEDS)]


def _configuration_table(groups: Groups, started: dict[str, int]) -> list[Block]:
    """started: how many runs of each configuration were started, unfinished ones included."""
    header = ["configuration", "seeds", "success (95 %)", "worst seed (95 %)"]
    header += ["wrong object", "disturbed", "final / best"]
    header += [f"frames to {level}" for level in LEVEL_NAMES] + [f"seconds to {level}" for level in LEVEL_NAMES]
    rows = []
    for label, runs in groups.items():
        s = score(runs)
        seeds = f"{s.seeds}" if s.seeds == started[label] else f"{s.seeds} of {started[label]}"
        success = _with_interval(s.success, s.interval) if s.seeds > 1 else f"{s.success:.3f}"
        row = [label, seeds, success, f"seed {s.worst.seed}: {_success(s.worst)}"]
        row += [f"{s.wrong_object:.3f}", share_cell(s.disturbed), _number(s.final_over_best, ".2f")]
        rows.append(row + [_number(x, ",.0f") for x in (*s.frames, *s.seconds)])
    total = _overall_row(groups, len(header)) if len(groups) > 1 else ()
    return [Table(header, rows, total), Paragraph(METHOD)]


def _overall_row(groups: Groups, width: int) -> list[str]:
    """Return the row for all configurations together."""
    strata = [[result_of(run)["success_at_end"] for run in runs] for runs in groups.values()]
    scores = [x for each in strata for x in each]
    row = ["all", f"{len(scores)}", _with_interval(float(iqm(np.array(scores))), bootstrap(strata))]
    return row + [""] * (width - len(row))


def _seed_table(groups: Groups) -> Table:
    header = ["configuration", "seed", "success (95 %)", "episodes", "wrong object", "disturbed", "final / best"]
    header += ["frames", "seconds", *(f"to {level}" for level in LEVEL_NAMES)]
    return Table(header, [_seed_row(label, run) for label, runs in groups.items() for run in runs])


def _seed_row(label: str, run: RunRecord) -> list[str]:
    final = result_of(run)
    row = [label, f"{run.seed}", _success(run), f"{final['episodes']}", f"{final['wrong_object']:.3f}"]
    row += [share_cell(final.get("disturbed")), _number(final_over_best(run), ".2f")]
    row += [f"{final['frames']:,}", f"{final['wall_s']:,.0f}"]
    for level in LEVELS:
        frames, seconds = time_to_level(run.evaluations, level)
        row.append(f"{frames:,.0f} ({seconds:,.0f} s)" if math.isfinite(frames) else "-")
    return row


def _main_tasks_section(groups: Groups, folder: Path) -> list[Block]:
    """Return the figure of the tasks that the original project was evaluated on; empty if no run has one of them."""
    main = {label: runs for label, runs in groups.items() if _task(runs[0]) in MAIN_TASKS}
    if not main:
        return []
    plots.tasks(main, folder / "tasks.png")
    names = ", ".join(task for task in MAIN_TASKS if any(_task(runs[0]) == task for runs in main.values()))
    picture = Picture("tasks.png", f"Mean reward and success ratio: {names}")
    return [Heading("Main tasks"), picture, Paragraph(f"Evaluation episodes of {names}. {SEEDS}")]


def _task(run: RunRecord) -> str:
    return str(run.config.get("task", {}).get("name"))


def _losses_section(groups: Groups, folder: Path) -> list[Block]:
    if not plots.losses(groups, folder / "losses.png"):
        return []
    text = f"Measured at each update and averaged over {plots.LOSS_POINTS} intervals of the run. {SEEDS}"
    return [Heading("Losses"), Picture("losses.png", "Losses against frames"), Paragraph(text)]


def _films_section(groups: Groups) -> list[Block]:
    films = [
        (f"{label}, seed {run.seed}: {_success(run)}", run.folder / FILM)
        for label, runs in groups.items()
        for run in runs
        if (run.folder / FILM).is_file()
    ]
    return [Heading("Films"), Films(films)] if films else []


def _unfinished_section(runs: Sequence[RunRecord]) -> list[Block]:
    """Return the runs that the figures and tables leave out."""
    rows = [[run.folder.name, run.command, run.status] for run in runs if not run.result]
    return [Heading("Runs that did not finish"), Table(["run", "command", "why"], rows)] if rows else []


def _machine_section(folder: Path) -> list[Block]:
    """Commands and machine from each sweep.yaml; without one, the machine that writes the report."""
    starts = [start for file in _sweep_files(folder) for start in read_starts(file.parent)]
    if not starts:
        return [Heading("Machine of this report"), Table(["", ""], [list(item) for item in system_info().items()])]
    commands = [[f"{start.get('time', '-')}", command_line(start["overrides"], "-m")] for start in starts]
    machine: dict[str, Any] = starts[-1].get("machine", {})
    blocks: list[Block] = [Heading("Commands"), Table(["started", "command"], commands)]
    return [*blocks, Heading("Machine"), Table(["", ""], [[name, str(value)] for name, value in machine.items()])]


def _success(run: RunRecord) -> str:
    return _with_interval(result_of(run)["success_at_end"], result_of(run)["ci95"])


def _with_interval(value: float, interval: Sequence[float]) -> str:
    return f"{value:.3f} ({interval[0]:.3f}-{interval[1]:.3f})"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def main(words: Sequence[str]) -> None:
    """Write the report of the directory that `words` names, and print its path. Raises ConfigError."""
    if len(words) != 1:
        raise ConfigError(USAGE)
    print(write(Path(words[0])))


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(main, __file__, words)


if __name__ == "__main__":
    cli()

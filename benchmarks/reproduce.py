"""Make every figure of README and docs/results.md again: what is missing is run, stored, and written into the pages.

    python -m benchmarks.reproduce --list                       # the rows, their commands, and what is missing
    python -m benchmarks.reproduce --rows 'policies/*'          # run what is missing of these, then write the pages
    python -m benchmarks.reproduce --rows 'nl_reach/*' --seeds 0,1 --launcher joblib --jobs 2
    python -m benchmarks.reproduce --stale                      # rows whose code or command has changed since
    python -m benchmarks.reproduce --rows 'policies/*' --again  # run those again
    python -m benchmarks.reproduce --write                      # only write the pages
    python -m benchmarks.reproduce --check                      # do the pages show what the store has?

`benchmarks/rows.yaml` declares the rows, `benchmarks/row_book.py` describes the store. A run that has its result is not
made again. One that was killed goes on with the command at which it was, by the program's own resume where it has one,
unless the commit is another one. A try that takes longer than the row's budget is ended, and the next one goes on.
`python -m benchmarks.same_bits` keeps figures over changes of the code that leave them as they are.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.comparison import compare, comparison_table
from benchmarks.row_book import ReproducedRow, RowBook
from core.errors import ConfigError, RunError
from core.program import program
from core.system import cores, signal_at_parent_death, system_info

ROWS = Path(__file__).with_name("rows.yaml")
MARKED = re.compile(r"(<!-- (rows|comparison): ([\w-]+) -->\n)(.*?)(<!-- end of rows -->)", re.DOTALL)
# Started by every Python of a run. At its end it writes down the files of the project that it has loaded; files other
# than modules are seen as they are opened. A run's commands are therefore exactly those that a user would give.
TRACER = """
import atexit, os, sys
root, folder, opened = os.environ["REPRODUCE_ROOT"] + os.sep, os.path.dirname(__file__), set()
def see(event, arguments):
    if event == "open" and isinstance(arguments[0], str):
        opened.add(arguments[0])
def end():
    modules = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
    paths = {os.path.abspath(path) for path in [*modules, *opened, *sys.argv[:1]] if path}
    with open(os.path.join(folder, f"{os.getpid()}.loaded"), "a") as file:
        file.writelines(path[len(root):] + "\\n" for path in paths if path.startswith(root))
sys.addaudithook(see)
atexit.register(end)
"""
Outcome = tuple[dict[str, Any], dict[str, str]] | str  # a result and the hashes of what it loaded, or why there is none


class StepRunner:
    """Makes the steps of one run, in its folder, where they stay until its result is stored.

    Raises:
        RunError: another process makes this run, a step failed or took too long, or the figure is missing.
    """

    def __init__(self, book: RowBook, row: ReproducedRow, seed: int, threads: int | None) -> None:
        self.book, self.row, self.seed, self.threads = book, row, seed, threads
        self.kind = book.kinds[str(row.kind)]
        self.folder = book.root / "outputs" / "reproduce" / row.id / str(seed)
        self.name = f"{row.id} with seed {seed}"

    def run(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return the result, and the hashes of the project files that were loaded."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with open(self.folder.with_suffix(".lock"), "w") as lock:  # the steps inherit it
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise RunError(f"{self.name} is being run by another process") from None
            commands = self.book.commands(self.row, self.seed)
            state = self._state(commit(self.book.root))
            start = time.monotonic()  # of this try, to which the budget applies
            for number in range(state["done"], len(commands)):
                state["seconds"] += self._step(number, commands[number], lock.fileno(), time.monotonic() - start)
                state["done"] = number + 1
                self._progress.write_text(json.dumps(state))
            return self._result(state["seconds"], commands), self.book.hashes(self._loaded())

    @property
    def _progress(self) -> Path:
        return self.folder / "progress.json"

    def _state(self, now: str) -> dict[str, Any]:
        """Return how many steps are done. A run begins anew at another commit, and if its first step cannot go on."""
        state = json.loads(self._progress.read_text()) if self._progress.exists() else {}
        if state.get("commit") == now and (state["done"] or self._goes_on()):
            return dict(state)
        shutil.rmtree(self.folder)
        (self.folder / "trace").mkdir(parents=True)
        (self.folder / "trace" / "sitecustomize.py").write_text(TRACER)
        fresh = {"commit": now, "done": 0, "seconds": 0.0}
        self._progress.write_text(json.dumps(fresh))
        return fresh

    def _goes_on(self) -> bool:
        return self.kind.resumable is not None and any(self.folder.glob(self.kind.resumable))

    def _step(self, number: int, command: str, lock: int, used: float) -> float:
        """Run a command; return its seconds. used: seconds of the budget that are gone."""
        command = self.kind.resume if self.kind.resume and number == 0 and self._goes_on() else command
        words = [os.path.expandvars(word.replace("{folder}", str(self.folder))) for word in shlex.split(command)]
        words[0] = sys.executable if words[0] == "python" else words[0]
        path = os.pathsep.join([str(self.folder / "trace"), str(self.book.root)])
        environment = os.environ | {"PYTHONPATH": path, "REPRODUCE_ROOT": str(self.book.root)}
        environment |= {"OMP_NUM_THREADS": str(self.threads)} if self.threads else {}
        log, start = self.folder / f"step{number + 1}.txt", time.monotonic()
        with log.open("w") as file:
            options: dict[str, Any] = {"stdout": file, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
            process = subprocess.Popen(
                words,
                cwd=self.book.root,
                env=environment,
                pass_fds=[lock],
                preexec_fn=signal_at_parent_death,
                **options,
            )
            try:
                code = process.wait(max(1.0, self.row.budget - used))
            except subprocess.TimeoutExpired:
                raise RunError(
                    f"{self.name} took longer than its budget of {self.row.budget:.0f} s; see {log}"
                ) from None
            finally:
                process.kill()
                process.wait()
        if code:
            last = (log.read_text(errors="replace").strip().splitlines() or ["no output"])[-1]
            raise RunError(f"{self.name}: {command!r} ended with exit code {code}: {last[:200]}; see {log}")
        return time.monotonic() - start

    def _loaded(self) -> set[str]:
        own = f"{self.folder.relative_to(self.book.root)}{os.sep}"
        found = {line for each in self.folder.glob("trace/*.loaded") for line in each.read_text().splitlines()}
        return {path for path in found if not path.startswith((own, "outputs" + os.sep, "build" + os.sep))}

    def _result(self, seconds: float, commands: list[str]) -> dict[str, Any]:
        values = self.values(len(commands))
        figures = {key: find(values, key) for key in self.book.keys(self.row)}
        if not isinstance(figures[self.row.figure], int | float):
            raise RunError(f"{self.name} has no number {self.row.figure!r} in {self.kind.read}")
        result = {"row": self.row.id, "seed": self.seed, "commands": commands, "figures": figures}
        if self.kind.frames:
            result["frames"] = json.loads((self.folder / self.kind.frames).read_text())["frames"]
        result |= {"seconds": round(seconds, 1), "date": datetime.now(UTC).date().isoformat()}
        return result | {"commit": commit(self.book.root), "machine": system_info()}

    def values(self, steps: int) -> dict[str, Any]:
        """Return the JSON object that has the figure. steps: how many the kind has."""
        printed = self.kind.read == "printed"
        path = self.folder / (f"step{steps}.txt" if printed else self.kind.read)
        text = path.read_text() if path.exists() else ""
        for part in reversed(text.splitlines()) if printed else [text]:
            try:
                found = json.loads(part)
            except ValueError:
                continue
            if isinstance(found, dict):
                return found
        raise RunError(f"{self.name} wrote no JSON object: {path}")


def find(values: Any, key: str) -> Any:
    """Return the value at a path of keys that dots join; None where there is none."""
    for name in key.split("."):
        values = values.get(name) if isinstance(values, dict) else None
    return values


def commit(root: Path) -> str:
    """Return the commit, with a + where code differs from it; "unknown" outside of a repository."""
    git = partial(subprocess.run, cwd=root, capture_output=True, text=True)
    named = git(["git", "rev-parse", "--short", "HEAD"])
    changed = git(["git", "diff", "--quiet", "HEAD", "--", "*.py", "conf"]).returncode
    return named.stdout.strip() + "+" * (changed == 1) if named.returncode == 0 else "unknown"


def attempt(rows: Path, run: tuple[str, int], threads: int | None) -> Outcome:
    """Make a run, here or on a node of a cluster."""
    book = RowBook(rows)
    try:
        return StepRunner(book, book.rows[run[0]], run[1], threads).run()
    except RunError as error:
        return str(error)


def launch(
    launcher: str, make: Callable[..., Outcome], runs: Sequence[tuple[str, int]], jobs: int
) -> Iterator[Outcome]:
    """Yield the outcomes of the runs in order: one at a time, `jobs` at a time, or as tasks of a Ray cluster."""
    if launcher == "local":
        yield from map(make, runs, [None] * len(runs))
    elif launcher == "joblib":
        from joblib import Parallel, delayed

        yield from Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(delayed(make)(r, 1) for r in runs)
    else:
        from trainers.cluster.ray_map import map_on_cluster

        yield from map_on_cluster(partial(make, threads=1), runs, "row")


def run_missing(book: RowBook, rows: Path, given: argparse.Namespace) -> int:
    """Run what is missing, and store it. Returns the number of runs without a result."""
    chosen = book.chosen(given.rows, given.seeds)
    wanted = [(r, s) for r, s in chosen if book.result(r, s) is None or (given.again and book.changed(r, s))]
    budget = sum(row.budget for row, _ in wanted)
    print(
        f"{len(wanted)} of {len(chosen)} runs are missing; by their budgets at most {budget / 3600:.1f} h", flush=True
    )
    failed = 0
    runs = [(row.id, seed) for row, seed in wanted]
    outcomes = launch(given.launcher, partial(attempt, rows), runs, given.jobs)
    for (row, seed), outcome in zip(wanted, outcomes, strict=True):
        if isinstance(outcome, str):
            failed += 1
            print(f"error: {outcome}", file=sys.stderr, flush=True)
            continue
        book.save(row, seed, *outcome)
        shutil.rmtree(book.root / "outputs" / "reproduce" / row.id / str(seed), ignore_errors=True)
        value = row.value_and_interval(outcome[0]["figures"])[0]
        print(f"{row.id} {seed}: {value:g}, {outcome[0]['seconds']:.0f} s", flush=True)
    return failed


def summary(book: RowBook, older: Callable[[ReproducedRow], bool]) -> dict[str, Any]:
    """Return what `results.json` has: each row with its runs, the worst first. older: whether its code has changed."""
    entries = {}
    for row in book.rows.values():
        runs = list(stored_runs(book, row))
        state = "older code" if older(row) or not runs else "measured"
        runs = runs or list(former_runs(book.older.get(row.id, {"values": ()})))
        runs.sort(key=lambda run: run["value"] * (-1 if row.at_most else 1))
        measured = book.measured(row)
        if not runs:
            state = "not reached" if any(book.result(measured, seed) for seed in measured.seeds) else "not run"
        entries[row.id] = {
            "label": row.label,
            "bar": row.bar,
            "state": state,
            "seeds": len(measured.seeds),
            "runs": runs,
            "command": " && ".join(book.commands(measured, measured.seeds[0])),
        }
    return {"rows": entries, "comparisons": comparisons(book, entries)}


def comparisons(book: RowBook, entries: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return what `results.json` has of each compared matrix. entries: those of the rows."""
    former = stored_summary(book).get("comparisons", {})
    found = {}
    for name in book.compared:
        rows = [row for row in book.rows.values() if row.table == name]
        seeds = book.shared_seeds(name)
        values: dict[str, dict[str, list[float]]] = {}
        for row in rows:
            line, column = ends_of(row)
            runs = (run for run in stored_runs(book, row) if run["seed"] in seeds)
            values.setdefault(column, {})[line] = [run["value"] for run in runs]
        entry = compare(values, len(seeds), former.get(name))
        states = {entries[row.id]["state"] for row in rows if ends_of(row)[0] in entry["lines"]}
        found[name] = entry | {"state": "older code" if "older code" in states else "measured"}
    return found


def ends_of(row: ReproducedRow) -> tuple[str, str]:
    """Return the line and the column of a matrix's row."""
    line, _, column = row.id.partition("/")[2].rpartition("-")
    return line, column


def stored_summary(book: RowBook) -> dict[str, Any]:
    """Return what the last writing has left in `results.json`."""
    return dict(json.loads(book.summary.read_text())) if book.summary.exists() else {"rows": {}}


def stored_runs(book: RowBook, row: ReproducedRow) -> Iterator[dict[str, Any]]:
    """Yield what the store has of the row's runs."""
    measured = book.measured(row)
    for seed in measured.seeds:
        result = book.result(measured, seed)
        value, interval = row.value_and_interval(result["figures"]) if result else (None, None)
        if result and value is not None:
            about: dict[str, Any] = {
                key: result[key] for key in ("frames", "seconds", "date", "commit") if key in result
            }
            yield {"seed": seed, "value": value, "interval": interval, **about}


def former_runs(entry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the runs of an entry of older.yaml; `interval` is that of its first, and worst, value."""
    shared: dict[str, Any] = {key: entry[key] for key in ("date", "commit", "frames") if key in entry}
    shared = {key: value if key == "frames" else str(value) for key, value in shared.items()}
    for number, value in enumerate(entry["values"]):
        yield {"value": value, "interval": None if number else entry.get("interval"), **shared}


def shown(row: ReproducedRow, value: float) -> str:
    return f"{value:,.{row.digits}f}"


def cells(row: ReproducedRow, entry: dict[str, Any], short: bool) -> list[str]:
    """Return the cells of a row. short: as README has them."""
    runs, label = entry["runs"], str(row.readme) if short else row.label
    bar = "" if row.bar is None else f"{row.bar:g}"
    if not runs:
        return [label, entry["state"], "", ""] if short else [label, entry["state"], bar, "", "", ""]
    values = [shown(row, run["value"]) for run in runs]
    if runs[0].get("interval"):
        values[0] += " ({}-{})".format(*(shown(row, bound) for bound in runs[0]["interval"]))
    mark = "" if entry["state"] == "measured" else " †"
    frames = f"{runs[0]['frames']:,}" if runs[0].get("frames") else ""
    if short:
        return [label, values[0] + mark, str(len(runs)), frames]
    if row.bar is not None and (runs[0]["value"] > row.bar if row.at_most else runs[0]["value"] < row.bar):
        bar += ", missed"
    missing = f" ({len(runs)} of {entry['seeds']} seeds)" * (len(runs) < entry["seeds"] and not mark)
    seconds = [run["seconds"] for run in runs if "seconds" in run]
    taken = f"{max(seconds):,.0f}" if seconds else ""
    measured = ", ".join(dict.fromkeys(f"{run['date']} {run['commit']}" for run in runs)) + mark
    return [label, ", ".join(values) + missing, bar, frames, taken, measured]


def table(book: RowBook, kind: str, name: str, found: dict[str, Any]) -> str:
    """Return a generated table. kind: rows or comparison. Raises ConfigError for a name without one."""
    if kind == "comparison":
        if name not in found["comparisons"]:
            raise ConfigError(f"a page has the marker 'comparison: {name}', but compared has no such matrix")
        entry = found["comparisons"][name]
        return written(comparison_table(entry, " †" * (entry["state"] == "older code")))
    short = name == "readme"
    rows = [row for row in book.rows.values() if (row.readme if short else row.table == name)]
    if not rows:
        raise ConfigError(f"a page has the marker 'rows: {name}', but no row is of that table")
    if name in book.matrices:
        head, *lines = matrix(rows, found)
    else:
        head = list(README_HEAD if short else HEAD)
        lines = [cells(row, found["rows"][row.id], short) for row in rows]
        used = [number for number, column in enumerate(zip(*lines, strict=True)) if any(column)]
        head, *lines = [[line[number] for number in used] for line in [head, *lines]]
    return written([head, *lines])


def written(lines: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table of lines of cells, head first."""
    head, *body = [f"| {' | '.join(line)} |" for line in lines]
    return re.sub(r"\|  (?=\|)", "| ", "\n".join([head, "|---" * len(lines[0]) + "|", *body, ""]))


def matrix(rows: Sequence[ReproducedRow], found: dict[str, Any]) -> list[list[str]]:
    """Return the worst seeds as a matrix, head first: a column for each end of the ids. Not run: "-"."""
    names = [(*ends_of(row), row) for row in rows]
    columns = list(dict.fromkeys(column for _, column, _ in names))
    lines: dict[str, dict[str, str]] = {}
    for line, column, row in names:
        entry = found["rows"][row.id]
        mark = "†" if entry["state"] == "older code" else ""
        lines.setdefault(line, {})[column] = shown(row, entry["runs"][0]["value"]) + mark if entry["runs"] else "-"
    order = list(dict.fromkeys(line.partition("-")[0] for line in lines))
    lines = dict(sorted(lines.items(), key=lambda item: order.index(item[0].partition("-")[0])))
    body = [[line, *(entries.get(column, "") for column in columns)] for line, entries in lines.items()]
    return [["", *columns], *body]


README_HEAD = ("kuka, `step` and PPO unless named", "success, worst seed (95 %)", "seeds", "frames")
HEAD = ("", "each seed, the worst first (95 %)", "bar", "frames", "seconds", "measured")


def generated(book: RowBook, found: dict[str, Any]) -> dict[Path, str]:
    """Return the contents of the pages and of the summary."""
    texts = {book.summary: json.dumps(found, indent=1) + "\n"}
    for page in book.pages:
        text = page.read_text("utf-8")
        texts[page] = MARKED.sub(lambda match: match[1] + table(book, match[2], match[3], found) + match[5], text)
    return texts


def check(book: RowBook) -> list[str]:
    """Return what differs from what the store generates, with the marks of the last `--write`, a sentence each."""
    older = {name for name, entry in stored_summary(book)["rows"].items() if entry["state"] == "older code"}
    differing = []
    for path, wanted in generated(book, summary(book, lambda row: row.id in older)).items():
        text = path.read_text("utf-8") if path.exists() else ""
        lines = zip(text.splitlines() + [""], wanted.splitlines() + [""], strict=False)
        number, pair = next(((n, pair) for n, pair in enumerate(lines, 1) if pair[0] != pair[1]), (0, ("", "")))
        if text != wanted:
            place = f"{path.relative_to(book.root)}, line {number}"
            differing.append(f"{place}: {pair[0][:150]!r} is not what the store generates: {pair[1][:150]!r}")
    return differing


def stale(book: RowBook, given: argparse.Namespace) -> Iterable[str]:
    """Yield the runs whose code or command has changed since, a sentence each."""
    for row, seed in book.chosen(given.rows, given.seeds):
        changes = book.changed(row, seed)
        if changes:
            more = f" and {len(changes) - 3} more" * (len(changes) > 3)
            since = (book.result(row, seed) or {})["commit"]
            yield f"{row.id} {seed}: changed since {since}: {', '.join(changes[:3])}{more}"


def listed(book: RowBook, given: argparse.Namespace) -> Iterable[str]:
    """Yield the runs with their commands."""
    for row, seed in book.chosen(given.rows, given.seeds):
        state = "stored" if book.result(row, seed) else f"missing, at most {row.budget:.0f} s"
        yield f"{row.id} {seed} ({state}): {' && '.join(book.commands(row, seed))}"


def main(words: list[str]) -> None:
    """Do what the options say. Raises ConfigError for a bad file, RunError where runs or the check failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", default="*", metavar="GLOB", help="which rows, by their ids (all)")
    parser.add_argument("--seeds", type=lambda text: [int(seed) for seed in text.split(",")], help="0,1: these alone")
    parser.add_argument(
        "--launcher", choices=("local", "joblib", "ray"), default="local", help="one run at a time (local)"
    )
    parser.add_argument("--jobs", type=int, default=cores(), help="runs at a time, of joblib (one a core)")
    parser.add_argument("--again", action="store_true", help="also run what has changed since it was measured")
    parser.add_argument("--file", type=Path, default=ROWS, help="the rows (benchmarks/rows.yaml)")
    modes = parser.add_mutually_exclusive_group()
    for mode, text in (
        ("list", "list runs"),
        ("stale", "list what has changed"),
        ("write", "write pages"),
        ("check", ""),
    ):
        modes.add_argument(f"--{mode}", action="store_true", help=text or "fail where a page differs from the store")
    given = parser.parse_args(words)
    book = RowBook(given.file.resolve())
    if given.list or given.stale:
        print("\n".join(listed(book, given) if given.list else stale(book, given)))
        return
    if given.check:
        differing = check(book)
        if differing:
            raise RunError("\n".join([*differing, "python -m benchmarks.reproduce --write writes the pages"]))
        return
    failed = 0 if given.write else run_missing(book, given.file.resolve(), given)
    found = summary(book, lambda row: any(book.changed(book.measured(row), seed) for seed in row.seeds))
    for path, text in generated(book, found).items():
        path.write_text(text, "utf-8")
    if failed:
        raise RunError(f"{failed} runs have no result")


if __name__ == "__main__":
    with program():
        main(sys.argv[1:])

"""Keep the figures of rows whose code has changed since, where short runs before and after give the same numbers.

    python -m benchmarks.same_bits 830ae393                        # a commit whose code the figures are of
    python -m benchmarks.same_bits 830ae393 --rows 'policies/*'
    python -m benchmarks.same_bits 830ae393 --list                 # what would be run

A change of a message changes a file that every training loads, and no figure. Runs of one kind that load the same
modules and the same algorithm, for whatever robot and task, form a group. One run of each group is made at both commits
with its kind's `probe` in `benchmarks/rows.yaml`: its steps with fewer frames and episodes. Where all numbers that it
writes are the same, to the last bit, the results of the group are noted as those of the new code too, with both commits
and the run that was compared. The others remain outdated, and `benchmarks.reproduce --again` makes them anew.
"""

from __future__ import annotations

import argparse
import copy
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from subprocess import run
from typing import Any

from benchmarks.reproduce import ROWS, StepRunner, commit
from benchmarks.row_book import OF_SWEEPS, ReproducedRow, RowBook, hash_of
from core.errors import ConfigError, RunError
from core.program import program

Run = tuple[ReproducedRow, int]  # a row and its seed
TIMES = ("seconds", "second", "minutes", "ms", "load")  # what names of numbers that two runs never share have in them


@contextmanager
def checkout(root: Path, name: str) -> Iterator[Path]:
    """Give a folder with the project as it was at a commit. Raises ConfigError where git cannot make it."""
    with tempfile.TemporaryDirectory(prefix="same-bits-") as scratch:
        tree = Path(scratch) / "project"
        try:
            made = run(
                ["git", "worktree", "add", "--detach", str(tree), name], cwd=root, capture_output=True, text=True
            )
            if made.returncode:
                raise ConfigError(f"git has no tree of the commit {name}: {made.stderr.strip().splitlines()[-1]}")
            yield tree
        finally:
            run(["git", "worktree", "remove", "--force", str(tree)], cwd=root, capture_output=True, check=False)


def groups(book: RowBook, before: Path, rows: str) -> dict[tuple[str, ...], list[Run]]:
    """Return the runs to compare, by what they share: those of the code of `before` that have changed since."""
    found: dict[tuple[str, ...], list[Run]] = {}
    for row, seed in book.chosen(rows):
        if not book.changed(row, seed) or book.kinds[str(row.kind)].probe is None:
            continue
        then = book.loaded(row, seed)
        if all(hash_of(before / path) == digest for path, digest in then.items() if path not in OF_SWEEPS):
            shared = sorted(path for path in then if path.endswith(".py") or path.startswith("conf/algo/"))
            found.setdefault((str(row.kind), *shared), []).append((row, seed))
    return found


def _at(book: RowBook, root: Path) -> RowBook:
    """Return the book with the project in another folder."""
    moved = copy.copy(book)
    moved.root = root
    return moved


def probe(book: RowBook, root: Path, chosen: Run) -> tuple[dict[str, float], set[str]]:
    """Return the numbers that the short run writes in the tree at `root`, by path of keys, and the files it loaded.

    Raises:
        RunError: a step of it failed.
    """
    row, seed = chosen
    kind = book.kinds[str(row.kind)]
    steps = kind.probe or kind.steps
    short = _at(book, root)
    short.kinds = {str(row.kind): replace(kind, steps=steps, resume=None, resumable=None)}
    runner = StepRunner(short, row, seed, threads=None)
    _, files = runner.run()
    return dict(numbers(runner.values(len(steps)))), set(files)


def numbers(values: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers within a JSON value with their paths of keys, without times."""
    if isinstance(values, dict | list):
        named = values.items() if isinstance(values, dict) else enumerate(values)
        for name, value in named:
            if not any(word in str(name).split("_") for word in TIMES):
                yield from numbers(value, f"{path}.{name}" if path else str(name))
    elif isinstance(values, int | float):
        yield path, values


def differences(before: dict[str, float], after: dict[str, float]) -> list[str]:
    """Return the numbers that differ, a phrase each."""
    names = sorted(before.keys() | after.keys())
    return [f"{name} {before.get(name)} -> {after.get(name)}" for name in names if before.get(name) != after.get(name)]


def compare(book: RowBook, base: str, trees: tuple[Path, Path], group: list[Run]) -> str:
    """Compare a group's first run in both trees, note the group's results where they agree; return what came of it."""
    row, seed = group[0]
    try:
        (before, _), (after, files) = (probe(book, tree, group[0]) for tree in trees)
    except RunError as error:
        return f"failed: {error}"
    if differing := differences(before, after):
        return f"differs in {len(differing)} of {len(after)} numbers, first {differing[0]}"
    for each, its_seed in group:
        hashes = _at(book, trees[1]).hashes(files | book.loaded(each, its_seed).keys())
        book.keep(each, its_seed, hashes, {"from": base, "to": commit(book.root), "compared": f"{row.id} {seed}"})
    return f"the same {len(after)} numbers"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base", help="the commit before the change, of whose code the figures are")
    parser.add_argument("--rows", default="*", metavar="GLOB", help="which rows, by their ids (all)")
    parser.add_argument("--file", type=Path, default=ROWS, help="the rows (benchmarks/rows.yaml)")
    parser.add_argument("--list", action="store_true", help="list the groups")
    return parser


def main(words: list[str]) -> None:
    given = _parser().parse_args(words)
    book = RowBook(given.file.resolve())
    if commit(book.root).endswith("+"):
        raise ConfigError("code differs from the last commit: commit it, so that results can name it")
    other = 0
    with checkout(book.root, given.base) as before, checkout(book.root, "HEAD") as after:
        found = groups(book, before, given.rows)
        runs = sum(map(len, found.values()))
        print(f"{runs} runs in {len(found)} groups have changed since {given.base}", flush=True)
        for group in found.values():
            row, seed = group[0]
            outcome = "" if given.list else ": " + compare(book, given.base, (before, after), group)
            other += not given.list and not outcome.startswith(": the same")
            print(f"{row.id} {seed}, for {len(group)} runs{outcome}", flush=True)
    if other:
        raise RunError(f"{other} groups remain outdated: python -m benchmarks.reproduce --again makes their runs")


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))  # the worktrees are removed on the way
    with program():
        main(sys.argv[1:])

"""The rows and results of `benchmarks.reproduce`.

`benchmarks/rows.yaml` declares the rows. A run of a row has one result, `results/<row>/<seed>.json` beside that file.
The project files that the run loaded are listed with their hashes in `results/code/<hash>.txt`, which runs of the same
code share. `results/older.yaml` has figures of earlier commits, which no hash describes.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from itertools import product
from math import sqrt
from pathlib import Path
from typing import Any

from core.errors import ConfigError, did_you_mean
from core.safe_files import FileError, read_json, read_text, read_yaml
from core.schema import Checked, checked_by, read, text, within, word

MAX_BYTES = 2 * 2**20  # of a result or a list of rows
CODE = (".py", ".yaml", ".safetensors", ".npz", ".html", ".js")  # suffixes of files that a run may depend on
SHORT = 12  # digits of a hash
OF_SWEEPS = ("trainers/sweeps/sweep.py",)  # Hydra loads this callback, which acts in sweeps alone; rows are single runs


@dataclass(frozen=True)
class RowKind(Checked):
    """How the rows of a kind are measured.

    steps: commands, one after another; {words}, {seed} and {folder} (of the run) are filled in. resume: the command in
    place of the first step where `resumable`, a glob in the folder, fits a file. read: the JSON file in the folder with
    the figures, or "printed": the last line of the last step that is a JSON object. frames: a JSON file with `frames`.
    """

    steps: list[str] = checked_by("the shell")
    read: str = checked_by("the run")
    resume: str | None = checked_by("the shell", default=None)
    resumable: str | None = checked_by("the run", default=None)
    frames: str | None = checked_by("the run", default=None)
    probe: list[str] | None = checked_by("the shell", default=None)


@dataclass(frozen=True)
class ReproducedRow(Checked):
    """One figure. The table is what its id has before the slash. label: what was measured; readme: that in README.

    of: the id of the row whose runs have the figure; else kind and words say how it is measured. figure, interval: keys
    of the JSON, joined by dots. total: the key of a number of which the figure is a part; the row shows the share, with
    Wilson's interval. budget: seconds of a run. digits: after the point.
    """

    id: str = text(r"[\w.-]+/[\w.-]+", "a table's name, a slash and a name of letters, digits and . _ -")
    label: str = checked_by("nothing", default="")
    kind: str | None = word(default=None)
    words: str = checked_by("the program that it is for", default="")
    of: str | None = checked_by("RowBook", default=None)
    seeds: list[int] = within(0, 2**31 - 1, count=(1, 100), default=(0,))
    budget: float = within(1, 86_400, default=600.0)
    bar: float | None = within(-1e9, 1e9, default=None)
    at_most: bool = checked_by("its type", default=False)
    figure: str = checked_by("the run", default="success_at_end")
    interval: str = checked_by("the run", default="ci95")
    total: str | None = checked_by("the run", default=None)
    digits: int = within(0, 6, default=3)
    readme: str | None = checked_by("nothing", default=None)

    @property
    def table(self) -> str:
        return self.id.partition("/")[0]

    def value_and_interval(self, figures: dict[str, Any]) -> tuple[float | None, list[float] | None]:
        """Return the figure and its interval, None where a run has none."""
        value, interval = figures.get(self.figure), figures.get(self.interval)
        if value is None or self.total is None:
            return value, interval
        return value / figures[self.total], wilson(value, figures[self.total])


class RowBook:
    """The rows of a file, and what was measured of them.

    Attributes:
        root: the folder of the project, in which commands run.
        store: the folder of results.
        pages: that have generated tables. matrices: tables with a column for each end of their rows' ids.
        compared: those of the matrices whose columns `benchmarks.comparison` compares.
        summary: the generated JSON file.
        kinds, rows: by name, in the file's order.
        older: by row, the figures of an earlier commit: values, and at will interval, frames, seconds.

    Raises:
        ConfigError: the file cannot be read, or a row is not right; one sentence that names it.
    """

    def __init__(self, path: Path) -> None:
        content = _read(read_yaml, path)
        expected = ("root", "pages", "matrices", "compared", "summary", "kinds", "rows")
        if not isinstance(content, dict) or set(content) != set(expected):
            raise ConfigError(f"{path} must have the keys {', '.join(expected)}")
        self.root = (path.parent / content["root"]).resolve()
        self.store = path.parent / "results"
        self.pages, self.summary = [self.root / page for page in content["pages"]], self.root / content["summary"]
        self.matrices: list[str] = content["matrices"]
        self.compared: list[str] = content["compared"]
        self.kinds = {name: read(RowKind, kind, f"kinds.{name}") for name, kind in content["kinds"].items()}
        self.rows: dict[str, ReproducedRow] = {}
        for number, entry in enumerate(content["rows"], 1):
            for single in _expanded(entry, number):
                self._add(read(ReproducedRow, single, f"rows.{single.get('id', number)}"), path)
        for name in self.compared:
            self._check_compared(name, path)
        older = self.store / "older.yaml"
        self.older: dict[str, dict[str, Any]] = _read(read_yaml, older) if older.exists() else {}
        for name in self.older:
            if name not in self.rows:
                raise ConfigError(f"{older} has the row {name}, which {path} lacks" + did_you_mean(name, self.rows))

    def _add(self, row: ReproducedRow, path: Path) -> None:
        """Add a row. Raises ConfigError if it is there already, or does not say how it is measured."""
        if row.id in self.rows:
            raise ConfigError(f"{path} has the row {row.id} twice")
        if (row.of is None) == (row.kind is None):
            raise ConfigError(f"rows.{row.id} must have either kind or of")
        if row.kind is not None and row.kind not in self.kinds:
            raise ConfigError(f"rows.{row.id}.kind={row.kind} is not a kind" + did_you_mean(row.kind, self.kinds))
        if row.of is not None and row.of not in self.rows:
            raise ConfigError(f"rows.{row.id}.of={row.of} is not a row above it" + did_you_mean(row.of, self.rows))
        self.rows[row.id] = row

    def _check_compared(self, name: str, path: Path) -> None:
        """Raise ConfigError unless a table is a matrix, and all of its rows have a seed in common."""
        if name not in self.matrices or not self.shared_seeds(name):
            raise ConfigError(f"{path}: compared has {name}, which must be a matrix whose rows share a seed")

    def shared_seeds(self, table: str) -> set[int]:
        """Return the seeds that all rows of a table have."""
        every = [set(self.measured(row).seeds) for row in self.rows.values() if row.table == table]
        return set.intersection(*every) if every else set()

    def measured(self, row: ReproducedRow) -> ReproducedRow:
        """Return the row whose runs have the figure."""
        return self.rows[row.of] if row.of else row

    def chosen(self, glob: str, seeds: list[int] | None = None) -> list[tuple[ReproducedRow, int]]:
        """Return rows whose id fits the glob, with each of their seeds. Raises ConfigError where none does."""
        rows = {self.measured(row).id: self.measured(row) for row in self.rows.values() if fnmatchcase(row.id, glob)}
        if not rows:
            raise ConfigError(f"--rows {glob} fits no row" + did_you_mean(glob, self.rows))
        return [(row, seed) for row in rows.values() for seed in row.seeds if seeds is None or seed in seeds]

    def keys(self, row: ReproducedRow) -> list[str]:
        """Return the keys of what a run stores: of this row's figure, and of those of rows that share its runs."""
        sharing = [each for each in self.rows.values() if self.measured(each).id == row.id]
        return list(dict.fromkeys(key for each in sharing for key in (each.figure, each.interval, each.total) if key))

    def file(self, row: ReproducedRow, seed: int) -> Path:
        return self.store / row.id / f"{seed}.json"

    def result(self, row: ReproducedRow, seed: int) -> dict[str, Any] | None:
        """Return the result of a run, None if there is none. Raises ConfigError for a damaged file."""
        path = self.file(row, seed)
        return _read_json(path) if path.exists() else None

    def save(self, row: ReproducedRow, seed: int, result: dict[str, Any], files: dict[str, str]) -> None:
        """Store a result. files: by path, the hashes of the project files that the run loaded."""
        from trainers.utils.files import write_json, write_text

        listed = "".join(f"{digest} {path}\n" for path, digest in sorted(files.items()))
        code = digest_of(listed.encode())
        for folder in (self.store / "code", self.file(row, seed).parent):
            folder.mkdir(parents=True, exist_ok=True)
        write_text(self.store / "code" / f"{code}.txt", listed)
        write_json(self.file(row, seed), result | {"code": code})

    def keep(self, row: ReproducedRow, seed: int, files: dict[str, str], note: dict[str, str]) -> None:
        """Note that a result is also that of newer files, by their hashes, and why (`benchmarks.same_bits`)."""
        result = dict(self.result(row, seed) or {})
        self.save(row, seed, result | {"kept": [*result.get("kept", []), note]}, files)

    def loaded(self, row: ReproducedRow, seed: int) -> dict[str, str]:
        """Return the hashes of the project files that a stored run loaded, by path."""
        code = (self.result(row, seed) or {})["code"]
        lines = _read(read_text, self.store / "code" / f"{code}.txt").splitlines()
        return dict(reversed(line.split(" ", 1)) for line in lines)

    def commands(self, row: ReproducedRow, seed: int) -> list[str]:
        """Return the commands of a run; {folder} is left in them."""
        steps = self.kinds[str(row.kind)].steps
        return [step.replace("{words}", row.words).replace("{seed}", str(seed)) for step in steps]

    def changed(self, row: ReproducedRow, seed: int) -> list[str]:
        """Return what has changed since a run: files of the project that it loaded, or its commands."""
        result = self.result(row, seed)
        if result is None:
            return []
        then = self.loaded(row, seed)
        changes = [path for path, digest in then.items() if self._hash(path) != digest and path not in OF_SWEEPS]
        return changes + ["its commands"] * (result["commands"] != self.commands(row, seed))

    def hashes(self, paths: set[str]) -> dict[str, str]:
        """Return the hashes of those of the paths that are files of the project and may change what a run does."""
        return {path: digest for path in paths if path.endswith(CODE) and (digest := self._hash(path))}

    def _hash(self, path: str) -> str:
        return hash_of(self.root / path)


@cache
def hash_of(path: Path) -> str:
    """Return the hash of a file, as the store has it; "" for one that is not there."""
    return digest_of(path.read_bytes()) if path.is_file() else ""


def digest_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:SHORT]


def _read(reader: Any, path: Path) -> Any:
    """Return what a reader of `core.safe_files` reads. Raises ConfigError that names the file."""
    try:
        return reader(path, MAX_BYTES)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None


def _read_json(path: Path) -> dict[str, Any]:
    value = _read(read_json, path)
    needed = ("commands", "figures", "commit", "date", "code", "seconds")
    missing = [key for key in needed if not isinstance(value, dict) or key not in value]
    if missing:
        raise ConfigError(f"{path} has no {missing[0]!r}; remove the file, and the run is made again")
    return dict(value)


def wilson(part: float, total: float, z: float = 1.959964) -> list[float]:
    """Return Wilson's 95 % interval of a share. `trainers.evaluation.wilson` takes seconds to import, with PyTorch."""
    middle, half = part + z * z / 2, z * sqrt(part * (total - part) / total + z * z / 4)
    return [(middle - half) / (total + z * z), (middle + half) / (total + z * z)]


def _expanded(entry: Any, number: int) -> list[dict[str, Any]]:
    """Return the rows of an entry: one for each combination of the values of its `grid`, whose names are filled in."""
    if not isinstance(entry, dict):
        raise ConfigError(f"rows: entry {number} must be a group of keys")
    grid = entry.get("grid", {})
    plain = {key: value for key, value in entry.items() if key != "grid"}
    rows = []
    for combination in product(*grid.values()):
        row = dict(plain)
        for name, value in zip(grid, combination, strict=True):
            row = {key: v.replace(f"{{{name}}}", str(value)) if isinstance(v, str) else v for key, v in row.items()}
        rows.append(row)
    return rows

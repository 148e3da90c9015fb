"""The database of a study: one SQLite file, to which each event is committed as it happens.

Several processes write to it. Its write-ahead log keeps what is committed when a process is killed. Workers only append
events; the server does the rest.
"""

from __future__ import annotations

import json
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from core.errors import ConfigError

FORMAT = 1  # of the database
BUSY = 30.0  # seconds to wait for another process's commit
TABLES = """
CREATE TABLE study (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE starts (id INTEGER PRIMARY KEY, time REAL NOT NULL, versions TEXT NOT NULL, revision TEXT NOT NULL);
CREATE TABLE goals (scene TEXT PRIMARY KEY, before BLOB NOT NULL, after BLOB NOT NULL, data TEXT NOT NULL);
CREATE TABLE participants (
  code TEXT PRIMARY KEY, number INTEGER UNIQUE, state TEXT NOT NULL, stage INTEGER NOT NULL,
  consented REAL, finished REAL);
CREATE TABLE trials (
  id INTEGER PRIMARY KEY AUTOINCREMENT, code TEXT NOT NULL REFERENCES participants ON DELETE CASCADE,
  trial INTEGER NOT NULL, condition TEXT NOT NULL, scene TEXT NOT NULL, begun REAL, ended REAL, clock REAL NOT NULL,
  result TEXT, goal INTEGER, UNIQUE (code, trial));
CREATE TABLE answers (
  code TEXT NOT NULL REFERENCES participants ON DELETE CASCADE, stage INTEGER NOT NULL, after TEXT NOT NULL,
  condition TEXT NOT NULL, scene TEXT NOT NULL, trial INTEGER NOT NULL, question TEXT NOT NULL, value TEXT NOT NULL,
  time REAL NOT NULL, PRIMARY KEY (code, stage, question));
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT, code TEXT NOT NULL REFERENCES participants ON DELETE CASCADE,
  trial INTEGER NOT NULL, time REAL NOT NULL, clock REAL, kind TEXT NOT NULL, data TEXT NOT NULL, state TEXT);
CREATE INDEX events_of ON events (code, trial);
"""


class StudyDatabase:
    """A connection to the database. Can be used by several threads.

    Args:
        path: of the file.
        worker: whether this process only appends events. It then waits for no disk: a killed process loses nothing, but
            a machine that loses its power may lose the last second.

    Raises:
        ConfigError: the file is no database of a study, or of another version.
    """

    def __init__(self, path: Path, worker: bool = False) -> None:
        self.path = path
        self._lock = threading.RLock()
        try:
            self._base = sqlite3.connect(path, BUSY, isolation_level=None, check_same_thread=False)
            self._base.row_factory = sqlite3.Row
            self._base.execute("PRAGMA journal_mode=WAL")
            self._base.execute(f"PRAGMA synchronous={'NORMAL' if worker else 'FULL'}")
            self._base.execute("PRAGMA foreign_keys=ON")
            self._base.execute("PRAGMA secure_delete=ON")  # what is deleted is overwritten
            if worker:
                self._base.execute("PRAGMA wal_autocheckpoint=0")  # it would wait for the disk
            else:
                self._make_tables()
        except sqlite3.Error as error:
            raise ConfigError(f"database={path} cannot be used as the database of a study: {error}") from None

    def _make_tables(self) -> None:
        version = self._base.execute("PRAGMA user_version").fetchone()[0]
        if version == 0 and not self.rows("SELECT 1 FROM sqlite_master"):
            self._base.executescript(f"BEGIN; {TABLES} PRAGMA user_version={FORMAT}; COMMIT;")
        elif version != FORMAT or not self.rows("SELECT 1 FROM sqlite_master WHERE name='participants'"):
            raise ConfigError(f"database={self.path} is no database of a study of this version; choose another file")

    def rows(self, query: str, values: Sequence[Any] = ()) -> list[sqlite3.Row]:
        """Return all rows of a query. A change that it makes is committed."""
        with self._lock:
            return self._base.execute(query, values).fetchall()

    def first(self, query: str, values: Sequence[Any] = ()) -> sqlite3.Row | None:
        """Return the first row of a query; None if there is none."""
        return next(iter(self.rows(query, values)), None)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Commit the changes of the block together, or none of them."""
        with self._lock:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._base.execute("ROLLBACK")
                raise
            self._base.execute("COMMIT")

    # ---- Events

    def log(
        self, code: str, trial: int, kind: str, data: Any = None, *, clock: float | None = None, state: Any = None
    ) -> int:
        """Append an event, which is committed when this returns. Returns its number; 0: the participant is gone.

        Args:
            code: of the participant.
            trial: its number; 0 outside of trials.
            kind: a key of `EVENTS`.
            data: what belongs to the kind, as plain values.
            clock: seconds of the world's clock since the trial began.
            state: of the world, as plain values.
        """
        values = (code, trial, time.time(), clock, kind, _json(data or {}), None if state is None else _json(state))
        columns = "code, trial, time, clock, kind, data, state"
        try:
            added = self.rows(f"INSERT INTO events ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?) RETURNING id", values)
        except sqlite3.IntegrityError:  # withdrawn meanwhile
            return 0
        return int(added[0][0])

    # ---- The study

    def get(self, key: str) -> Any:
        """Return a value of the study as a whole; None if there is none."""
        row = self.first("SELECT value FROM study WHERE key=?", (key,))
        return None if row is None else json.loads(row[0])

    def set(self, key: str, value: Any) -> None:
        """Keep a value of the study as a whole."""
        self.rows("INSERT OR REPLACE INTO study VALUES (?, ?)", (key, _json(value)))

    def checkpoint(self) -> None:
        """Move what is committed from the write-ahead log into the database's file, as far as nobody reads it."""
        self.rows("PRAGMA wal_checkpoint(PASSIVE)")

    def delete_participant(self, code: str) -> None:
        """Delete everything about a participant, the code as well, and overwrite it on the disk."""
        with self.together():
            for table in ("events", "answers", "trials", "participants"):
                self.rows(f"DELETE FROM {table} WHERE code=?", (code,))
        self.set("withdrawn", (self.get("withdrawn") or 0) + 1)
        self.rows("PRAGMA wal_checkpoint(TRUNCATE)")

    def close(self) -> None:
        """Close the connection."""
        with self._lock:
            self._base.close()


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)

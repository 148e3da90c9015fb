"""Starts the server of a study: `python play.py study=study.yaml`."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from core.command_line import check_file
from core.errors import ConfigError
from core.system import package_versions, system_info
from demo.page_gate import PageGate
from demo.study.database import StudyDatabase
from demo.study.progress import StudyProgress
from demo.study.study_config import StudyConfig, read_study
from trainers.run.run_folder import locked

KEYS = ("study", "database")
SUFFIXES = (".sqlite", ".db")
ROOT = Path(__file__).resolve().parents[2]


def serve_study(args: argparse.Namespace) -> None:
    """Serve a study until the process is interrupted. Raises ConfigError."""
    from trainers.collect import fork_server

    study, path = read_words(args.overrides)
    with _lock(path), closing(StudyDatabase(path)) as database:
        progress = StudyProgress(study, database)
        context = fork_server.start(["demo.study.trial_process"])
        record_start(database)
        _prepare(study, database, context)
        asyncio.run(_serve(args, progress, context))


def read_words(words: Sequence[str]) -> tuple[StudyConfig, Path]:
    """The study of a command line, and the path of its database. Raises ConfigError."""
    from core.command_line import split

    values, others = split(words, KEYS, "study=study.yaml")
    if others:
        raise ConfigError(
            f"{others[0]} does not go with study={values['study']}: a study file has robot, scenes and drivers"
        )
    source = Path(values["study"])
    study = read_study(source)
    return study, check_file("database", values.get("database") or source.with_suffix(".sqlite"), SUFFIXES)


async def _serve(args: argparse.Namespace, progress: StudyProgress, context: Any) -> None:
    from demo.study.study_server import StudyServer
    from demo.study.trial_host import TrialHost

    gate = PageGate(args.host, args.port, args.origin)
    server = StudyServer(progress, args.host, gate)
    server.trials = TrialHost(progress.study, progress.database.path, context, server.note)

    def on_ready() -> None:
        origin = args.origin[0] if args.origin else gate.address.partition("/?")[0]
        print(
            f"{gate.address.replace('?token=', '') + '/'} is the experimenter's page (press Ctrl-C to stop)", flush=True
        )
        print(f"the log is {progress.database.path}; links of the participants:", flush=True)
        for code in progress.codes():
            print(f"  {origin}/{code}/", flush=True)

    try:
        await server.serve(args.port, on_ready)
    except OSError as error:
        raise ConfigError(f"--port={args.port} cannot be used: {error.strerror}; try another --port") from None


def _prepare(study: StudyConfig, database: StudyDatabase, context: Any) -> None:
    """Check the study and make the pictures of its goals, unless the database has them. Raises ConfigError."""
    from demo.study.trial_host import prepare_study

    if database.get("prepared"):
        return
    print("One moment: the study is prepared; the scripted expert brings about its goals.", flush=True)
    database.rows("DELETE FROM goals")
    for name, (before, after, goal) in prepare_study(study, context).items():
        database.rows("INSERT OR REPLACE INTO goals VALUES (?, ?, ?, ?)", (name, before, after, goal))
    database.set("prepared", True)


def record_start(database: StudyDatabase) -> None:
    """Record what this server runs: versions and the commit of the project."""
    own = {}
    with suppress(PackageNotFoundError):
        own["deixis"] = version("deixis")
    versions = json.dumps({**own, **package_versions(), "system": system_info()["system"]})
    database.rows("INSERT INTO starts (time, versions, revision) VALUES (?, ?, ?)", (time.time(), versions, revision()))


def revision() -> str:
    """The commit of the project, with "+changes" where files differ from it; "" where it is no repository."""
    with suppress(OSError, subprocess.SubprocessError):
        ask = ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=40", "--dirty=+changes", "--exclude=*"]
        answer = subprocess.run(ask, capture_output=True, text=True, timeout=10, check=True)
        return answer.stdout.strip()
    return ""


@contextmanager
def _lock(database: Path) -> Iterator[None]:
    """Keep other servers from this database while the block runs. The system frees it if the process dies."""
    descriptor = locked(
        database.with_name(f"{database.name}.lock"),
        unusable=f"database={database} cannot be used",
        taken=f"database={database} is in use by another server; stop that one first",
        mode=0o600,
    )
    try:
        yield
    finally:
        os.close(descriptor)

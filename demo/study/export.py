"""The data of a study as CSV and JSON, with a data dictionary.

    deixis study export study.sqlite              into the folder study-data beside it
    deixis study export study.sqlite out=<folder>
    deixis study check study.yaml                 whether a study file is right, and its goals can be reached
    deixis study dictionary                       the data dictionary, as Markdown

A server may be writing the database meanwhile: the export has what was committed when it began.
"""

from __future__ import annotations

import csv
import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from core.command_line import out_folder
from core.errors import ConfigError, did_you_mean
from core.program import run_program
from core.safe_files import FileError, check_size

MAX_DATABASE = 64 * 2**30  # bytes
CODE = "the participant's code"
TRIAL = "number of the trial within the participant's study, from 1; 0 outside of trials"
CONDITION, SCENE = "name of the condition in the study file", "name of the scene in the study file"
TABLES: dict[str, dict[str, str]] = {  # table: column: what it means
    "participants": {
        "code": CODE,
        "number": "order of consent, from 0, which gives the order of conditions; empty before consent",
        "state": "invited, active, finished or stopped",
        "stage": "how many parts of the study are over",
        "consented": "when, in seconds since 1970 (UTC)",
        "finished": "when, in seconds since 1970 (UTC)",
    },
    "trials": {
        "code": CODE,
        "trial": TRIAL,
        "condition": CONDITION,
        "scene": SCENE,
        "begun": "when, in seconds since 1970 (UTC)",
        "ended": "when, in seconds since 1970 (UTC)",
        "clock": "seconds of the world's clock: of the trial without breaks; it stands while nobody looks",
        "result": "goal reached, done, gave up, or time is over; empty for one that has not ended",
        "goal": "1 if the goal was reached, 0 if not; empty for a scene without a goal",
    },
    "answers": {
        "code": CODE,
        "after": "what the question is about: scene, condition or study",
        "condition": "of what it is about; empty for the study",
        "scene": "of what it is about; empty for a condition or the study",
        "trial": "number of the latest trial before it",
        "question": "name of the question in the study file",
        "value": "the answer: a number of the scale, a choice, or text",
        "time": "when, in seconds since 1970 (UTC)",
    },
    "events": {
        "id": "number of the event; later ones have greater ones",
        "code": CODE,
        "trial": TRIAL,
        "time": "when it was written, in seconds since 1970 (UTC)",
        "clock": "seconds of the world's clock since the trial began; empty for events of the server",
        "kind": "one of the kinds of events",
        "data": "what belongs to the kind, as JSON",
        "state": "the world's state just then, as JSON; empty for events of the server",
    },
}
EVENTS: dict[str, str] = {  # kind: what it means, with the keys of its data
    "connected": "a page of the participant was opened",
    "disconnected": "a page of the participant was closed",
    "consented": "the participant agreed; number",
    "ready": "the robot was loaded before a trial; names of the objects as a sentence can have them",
    "begun": "the participant began a trial; condition, scene",
    "resumed": "the robot was loaded again within a trial, after a break; names, restored: objects put where they were",
    "preview": "what was typed so far, before Enter, and how it is understood; typed, kind, text",
    "utterance": "a sentence that was said; text",
    "correction": "a sentence that was said while the robot was at work; text",
    "reply": "what was understood or answered; entry, said, kind, understood, text, offers",
    "step": "a step of the plan in another state; entry, step, words, state (next, doing, done, failed, dropped)",
    "outcome": "how a plan ended; entry, result",
    "gesture": "the finger moved; by (click, handle, key), aim (metres), referent, probabilities; or unreachable",
    "button": "a button; button (stop, go where I point)",
    "message": "what the page said by itself; entry, said, kind, understood, text, offers",
    "state": "a sample of the state: while the robot moves, and every 5 seconds",
    "goal": "the goal holds",
    "time is over": "the scene's time is over",
    "ended": "the trial ended; result, goal",
    "answered": "an answer was given or changed; question, value, after",
    "submitted": "a questionnaire was sent; after",
    "finished": "the study was over for the participant",
    "stopped": "the experimenter stopped the participant",
    "continued": "the experimenter let the participant go on",
}
STATE: dict[str, str] = {  # key of a state: what it means
    "objects": "x, y and z of each object, metres, in the order of the names of ready",
    "gripper": "x, y and z of the gripper's centre, metres",
    "held": "index of the object that is held, or null",
    "busy": "whether the robot is at work",
    "about": "indices of the referent, and of the target if there is one",
    "moved": "how far devices (shares of their way) and fittings (metres, radians) are moved; left out if nothing is",
    "ray": "origin, metres, and direction of the pointing finger; left out before the first gesture",
}
STUDY: dict[str, str] = {  # key of study.json: what it means
    "config": "the study file, with all defaults",
    "starts": "each start of the server: time, versions of packages, commit of the project (+changes: with changes)",
    "goals": "by scene: where objects must be (places, metres), devices and fittings (shares) or the gripper; referent",
    "withdrawn": "number of participants who have withdrawn; nothing else is left of them",
    "dictionary": "this dictionary",
}


def cli() -> None:
    """Run the program with the words of this process."""
    run_program(main, __file__)


def main(words: Sequence[str]) -> None:
    """Run the program. Raises ConfigError."""
    actions = {"export": _export, "check": _check, "dictionary": lambda _: print(dictionary())}
    action, *rest = [*words, ""][: len(words) + 1]
    if action not in actions:
        wanted = "deixis study export study.sqlite, deixis study check study.yaml, or deixis study dictionary"
        raise ConfigError(
            f"{action or 'an action'} is missing or not known: {wanted}" + (did_you_mean(action, actions))
        )
    actions[action]([word for word in rest if word])


def _check(words: Sequence[str]) -> None:
    from demo.study.orders import stages
    from demo.study.study_config import check_policies, read_study
    from demo.study.trial_host import prepare_study
    from trainers.collect import fork_server

    if len(words) != 1:
        raise ConfigError("deixis study check needs one study file: deixis study check study.yaml")
    study = read_study(Path(words[0]))
    try:
        check_policies(study)
        if any(scene.goal for scene in study.scenes.values()):
            print("One moment: the scripted expert brings about the goals.", flush=True)
            prepare_study(study, fork_server.start(["demo.study.trial_process"]))
    except ConfigError as error:
        raise ConfigError(f"study={words[0]}: {error}") from None
    trials = sum(stage.kind == "trial" for stage in stages(study, 0))
    print(f"{words[0]}: {study.participants} participants, {len(study.conditions)} conditions, {trials} trials each")


def _export(words: Sequence[str]) -> None:
    path, folder = None, None
    for word in words:
        key, equals, value = word.partition("=")
        if equals and key == "out" and value:
            folder = value
        elif path is None and (not equals or Path(word).exists()):
            path = Path(word)
        else:
            raise ConfigError(f"{word} is not known: deixis study export study.sqlite out=<folder>")
    if path is None:
        raise ConfigError("deixis study export needs the database of a study: deixis study export study.sqlite")
    with _opened(path):  # before a folder is made
        out = out_folder(folder or str(path.with_name(f"{path.stem}-data")))
    counts = export(path, out)
    print(f"{out}: {', '.join(f'{count:,} {name}' for name, count in counts.items())}")


def export(path: Path, folder: Path) -> dict[str, int]:
    """Write the data of a study into a folder: a CSV of each table, study.json and dictionary.md.

    Returns:
        The number of rows of each table.

    Raises:
        ConfigError: the file is no database of a study.
    """
    counts = {}
    try:
        with _opened(path) as base:
            for table, columns in TABLES.items():
                rows = base.execute(f"SELECT {', '.join(columns)} FROM {table} ORDER BY rowid")
                counts[table] = _write_csv(folder / f"{table}.csv", list(columns), rows)
            _write_json(folder / "study.json", base)
    except (sqlite3.Error, ValueError) as error:
        raise ConfigError(f"{path} is no database of a study that can be read: {error}") from None
    (folder / "dictionary.md").write_text(dictionary(), encoding="utf-8")
    return counts


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a database for reading, as it is now."""
    try:
        check_size(path, MAX_DATABASE)
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, isolation_level=None)) as base:
        base.execute("PRAGMA trusted_schema=OFF")  # a database of others runs nothing
        base.execute("BEGIN")
        try:
            base.execute("SELECT 1 FROM study LIMIT 1")
        except sqlite3.Error as error:
            raise ConfigError(f"{path} is no database of a study that can be read: {error}") from None
        yield base


def _write_csv(path: Path, columns: Sequence[str], rows: Any) -> int:
    count = 0
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for count, row in enumerate(rows, 1):  # noqa: B007  the last one is the number of rows
            writer.writerow([_cell(column, value) for column, value in zip(columns, row, strict=True)])
    return count


def _cell(column: str, value: Any) -> Any:
    """A value for a table; answers are JSON in the database. Text that spreadsheets would compute is quoted."""
    if column == "value":
        value = json.loads(value)
    return f"'{value}" if isinstance(value, str) and value[:1] in tuple("=+-@\t\r") else value


def _write_json(path: Path, base: sqlite3.Connection) -> None:
    study = {key: json.loads(value) for key, value in base.execute("SELECT key, value FROM study")}
    starts = base.execute("SELECT time, versions, revision FROM starts ORDER BY id")
    answers = base.execute(f"SELECT {', '.join(TABLES['answers'])} FROM answers ORDER BY rowid")
    content = {
        "config": study.get("config"),
        "starts": [
            {"time": time, "versions": json.loads(versions), "commit": commit} for time, versions, commit in starts
        ],
        "goals": {scene: json.loads(data) for scene, data in base.execute("SELECT scene, data FROM goals")},
        "withdrawn": study.get("withdrawn") or 0,
        "dictionary": {"study": STUDY, **TABLES, "kinds of events": EVENTS, "keys of states": STATE},
    }
    for table in ("participants", "trials"):
        columns = list(TABLES[table])
        rows = base.execute(f"SELECT {', '.join(columns)} FROM {table} ORDER BY rowid")
        content[table] = [dict(zip(columns, row, strict=True)) for row in rows]
    columns = list(TABLES["answers"])
    content["answers"] = [
        {name: json.loads(value) if name == "value" else value for name, value in zip(columns, row, strict=True)}
        for row in answers
    ]
    with path.open("w", encoding="utf-8") as file:
        head = json.dumps(content, indent=1, ensure_ascii=False)
        file.write(head.removesuffix("\n}") + ',\n "events": [')
        columns = list(TABLES["events"])
        for number, row in enumerate(base.execute(f"SELECT {', '.join(columns)} FROM events ORDER BY id")):
            event = dict(zip(columns, row, strict=True))
            event |= {name: json.loads(event[name]) for name in ("data", "state") if event[name] is not None}
            file.write((",\n  " if number else "\n  ") + json.dumps(event, ensure_ascii=False))
        file.write("\n ]\n}\n")


def dictionary() -> str:
    """Return the data dictionary as Markdown."""
    parts = [
        *((f"{table}.csv, and {table} in study.json", columns, "column") for table, columns in TABLES.items()),
        ("Kinds of events", EVENTS, "kind"),
        ("Keys of states", STATE, "key"),
        ("Further keys of study.json", STUDY, "key"),
    ]
    lines = ["# Data dictionary", ""]
    for title, entries, name in parts:
        lines += [f"## {title}", "", f"| {name} | meaning |", "|---|---|"]
        lines += [f"| {key} | {about} |" for key, about in entries.items()] + [""]
    return "\n".join(lines)

"""The way of participants through a study, its database and its export."""

import csv
import json
import re
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import ConfigError
from deixis.cli import PROGRAMS
from demo.study.database import StudyDatabase
from demo.study.export import EVENTS, TABLES, dictionary, export, main
from demo.study.progress import NotNow, StudyProgress
from demo.study.serving import record_start
from demo.study.study_config import study_of

ROOT = Path(__file__).resolve().parents[2]
STUDY = {
    "title": "A study",
    "consent": "Do you agree?",
    "participants": 3,
    "conditions": {"a": {"driver": "expert"}, "b": {"driver": "expert"}},
    "scenes": {"one": {"task": "nl_reach", "text": "reach something"}},
    "questions": {
        "hard": {"text": "Hard?", "points": 5},
        "why": {"text": "Why?", "kind": "text", "required": False},
        "best": {"text": "Best?", "kind": "choice", "choices": ["a", "b"], "after": "study"},
    },
}
STATE = {"objects": [[0.4, 0.0, 0.025]], "gripper": [0.4, 0.0, 0.3]}
WRITER = """
import sys
from pathlib import Path
from demo.study.database import StudyDatabase
database = StudyDatabase(Path(sys.argv[1]), worker=True)
while True:
    print(database.log(sys.argv[2], 1, "state", {"x": "y" * 500}, clock=1.0), flush=True)
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "study.sqlite"


@pytest.fixture
def progress(path):
    database = StudyDatabase(path)
    yield StudyProgress(study_of(STUDY), database)
    database.close()


def do_trial(progress, code, result="done"):
    progress.begin(code)
    progress.database.log(code, progress.stage(code).trial, "utterance", {"text": "reach it"}, clock=2.5, state=STATE)
    progress.end_trial(code, result, None)


def go_through(progress, code):
    progress.consent(code)
    for _ in range(2):
        do_trial(progress, code)
        progress.answer(code, "hard", 3)
        progress.answer(code, "hard", 4)
        progress.answer(code, "why", '=1+1 it is, "you know"')
        progress.submit(code)
    progress.answer(code, "best", "b")
    progress.submit(code)


def test_a_participant_goes_from_consent_to_thanks_and_all_is_logged(progress):
    code = progress.codes()[0]
    assert progress.shown(code)["kind"] == "consent"
    go_through(progress, code)
    assert progress.shown(code)["kind"] == "thanks"
    assert progress.shown(code)["state"] == "finished"
    kinds = [row["kind"] for row in progress.database.rows("SELECT kind FROM events WHERE code=? ORDER BY id", (code,))]
    block = ["begun", "utterance", "ended", "answered", "answered", "answered", "submitted"]
    assert kinds == ["consented", *block, *block, "answered", "submitted", "finished"]
    assert [row["clock"] for row in progress.database.rows("SELECT clock FROM trials")] == [2.5, 2.5]


def test_conditions_are_given_in_balanced_order_and_that_of_a_withdrawn_one_is_given_again(progress):
    first, second, third = progress.codes()
    for code in (first, second):
        progress.consent(code)
    assert [progress.stage(code).condition for code in (first, second)] == ["a", "b"]
    progress.withdraw(first)
    progress.consent(third)
    assert progress.stage(third).condition == "a"


@pytest.mark.parametrize(
    ("name", "value"), [("hard", 6), ("hard", "3"), ("hard", True), ("best", "a"), ("nothing", 1), ("why", 3)]
)
def test_an_answer_that_is_none_is_refused_and_not_kept(progress, name, value):
    code = progress.codes()[0]
    progress.consent(code)
    do_trial(progress, code)
    with pytest.raises(NotNow):
        progress.answer(code, name, value)
    assert progress.answers(code) == {}
    with pytest.raises(NotNow, match="Please answer: Hard"):
        progress.submit(code)


def test_what_does_not_fit_where_a_participant_is_changes_nothing(progress):
    code = progress.codes()[0]
    for act in (progress.begin, progress.submit, lambda c: progress.end_trial(c, "done", None)):
        with pytest.raises(NotNow):
            act(code)
    with pytest.raises(NotNow, match="not valid"):
        progress.consent("nobody")
    progress.consent(code)
    with pytest.raises(NotNow, match="over already"):
        progress.consent(code)
    with pytest.raises(NotNow, match="has not begun"):
        progress.end_trial(code, "done", None)


def test_the_experimenter_stops_participants_and_the_study_and_lets_them_go_on(progress):
    code = progress.codes()[0]
    progress.consent(code)
    progress.stop(code, True)
    assert progress.shown(code)["kind"] == "stopped"
    assert progress.trial(code) is None
    with pytest.raises(NotNow, match="stopped"):
        progress.begin(code)
    progress.stop(code, False)
    progress.close(True)
    assert progress.shown(progress.codes()[1])["kind"] == "stopped"
    progress.close(False)
    progress.begin(code)
    assert progress.trial(code).begun


def test_nothing_of_a_withdrawn_participant_is_left_in_the_file(progress, path):
    code, other = progress.codes()[:2]
    go_through(progress, code)
    progress.consent(other)
    progress.database.log(other, 1, "utterance", {"text": "something else"})
    progress.withdraw(code)
    progress.database.close()
    content = b"".join(each.read_bytes() for each in path.parent.iterdir())
    assert code.encode() not in content
    assert b"you know" not in content
    assert other.encode() in content
    with sqlite3.connect(path) as base:
        assert base.execute("SELECT value FROM study WHERE key='withdrawn'").fetchone() == ("1",)
    base.close()


def test_a_late_event_of_a_withdrawn_participant_is_not_written(progress):
    code = progress.codes()[0]
    progress.consent(code)
    progress.withdraw(code)
    assert progress.database.log(code, 1, "state") == 0
    assert progress.database.rows("SELECT * FROM events") == []


def test_another_server_goes_on_where_participants_were(progress, path):
    code = progress.codes()[0]
    progress.consent(code)
    do_trial(progress, code)
    progress.answer(code, "hard", 2)
    database = StudyDatabase(path)
    again = StudyProgress(study_of(STUDY), database)
    assert again.codes() == progress.codes()
    assert again.shown(code) == progress.shown(code)
    assert [each["value"] for each in again.shown(code)["questions"]] == [2, None]
    database.close()


def test_another_study_does_not_go_with_a_database_once_somebody_has_begun(progress, path):
    study = STUDY | {"title": "Another title"}
    changed = StudyProgress(study_of(study), progress.database)
    assert changed.codes() == progress.codes()
    changed.consent(changed.codes()[0])
    other = study | {"conditions": {"a": {"driver": "expert", "answers": False}, "b": {"driver": "expert"}}}
    with pytest.raises(
        ConfigError, match=r"conditions.a.answers=False does not go with .* has conditions.a.answers=True"
    ):
        StudyProgress(study_of(other), progress.database)


def test_a_file_that_is_no_database_of_a_study_is_refused(tmp_path):
    (tmp_path / "text.sqlite").write_text("hello" * 1000)
    with sqlite3.connect(tmp_path / "other.sqlite") as base:
        base.execute("CREATE TABLE a (b)")
    base.close()
    for name in ("text", "other"):
        with pytest.raises(ConfigError, match="database="):
            StudyDatabase(tmp_path / f"{name}.sqlite")
        with pytest.raises(ConfigError, match="no database of a study"):
            export(tmp_path / f"{name}.sqlite", tmp_path)


def test_events_that_were_confirmed_outlive_a_process_that_is_killed(progress, path):
    code = progress.codes()[0]
    command = [sys.executable, "-c", WRITER, str(path), code]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    confirmed = [int(process.stdout.readline()) for _ in range(200)]
    process.send_signal(signal.SIGKILL)
    confirmed += [int(line) for line in process.stdout.read().splitlines() if line]
    process.wait()
    process.stdout.close()
    stored = {row["id"] for row in progress.database.rows("SELECT id FROM events")}
    assert stored >= set(confirmed)


def test_the_export_has_every_row_and_a_dictionary_of_every_column_and_kind(progress, path, tmp_path, capsys):
    code = progress.codes()[0]
    go_through(progress, code)
    main(["export", str(path), f"out={tmp_path / 'data'}"])
    assert "18 events" in capsys.readouterr().out
    tables = {name: list(csv.DictReader((tmp_path / "data" / f"{name}.csv").open(encoding="utf-8"))) for name in TABLES}
    assert {name: list(rows[0]) for name, rows in tables.items()} == {
        name: list(columns) for name, columns in TABLES.items()
    }
    assert [row["value"] for row in tables["answers"]][:3] == ["4", '\'=1+1 it is, "you know"', "4"]
    assert {row["kind"] for row in tables["events"]} <= set(EVENTS)
    content = json.loads((tmp_path / "data/study.json").read_text("utf-8"))
    assert len(content["events"]) == 18
    assert content["answers"][1]["value"].startswith("=1+1")
    assert content["config"]["conditions"]["a"]["driver"] == "expert"
    text = (tmp_path / "data/dictionary.md").read_text("utf-8")
    assert all(f"| {word} |" in text for word in (*EVENTS, *TABLES["events"], *TABLES["trials"]))
    assert "study" in PROGRAMS


@pytest.mark.slow
def test_the_notebook_runs_on_an_export(progress, path, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MPLBACKEND", "agg")
    record_start(progress.database)
    go_through(progress, progress.codes()[0])
    export(path, tmp_path)
    cells = json.loads((ROOT / "docs/examples/study.ipynb").read_text("utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    place = 'Path("outputs/study-data")'
    assert place in code
    exec(compile(code.replace(place, f"Path({str(tmp_path)!r})"), "study.ipynb", "exec"), {"__name__": "notebook"})
    assert "1 participants, 2 trials, 18 events" in capsys.readouterr().out


def test_the_page_of_docs_names_everything_in_the_data_dictionary():
    text = (ROOT / "docs/study.md").read_text("utf-8")
    names = re.findall(r"^\| (?!column |kind |key |---)([\w ]+) \|", dictionary(), re.MULTILINE)
    assert len(set(names)) >= 50
    assert [name for name in names if f"`{name}`" not in text] == []
    for table, columns in TABLES.items():
        assert f"| `{table}.csv` | {', '.join(f'`{column}`' for column in columns)}" in text.replace(" (JSON)", "")


@pytest.mark.slow
def test_a_goal_that_cannot_be_brought_about_is_found_before_the_study(tmp_path):
    text, file = (ROOT / "docs/examples/study.yaml").read_text("utf-8"), tmp_path / "study.yaml"
    file.write_text(text.replace("goal: reach the gray cube", "goal: flurb the gadget"), "utf-8")
    with pytest.raises(ConfigError, match=r"goal=flurb the gadget cannot be done.*flurb"):
        main(["check", str(file)])


@pytest.mark.parametrize(
    "words", [[], ["exprt"], ["export"], ["export", "a", "b"], ["check"], ["export", "missing.sqlite"]]
)
def test_wrong_words_of_the_command_get_one_line(words):
    with pytest.raises(ConfigError, match=r"deixis study|cannot be read"):
        main(words)

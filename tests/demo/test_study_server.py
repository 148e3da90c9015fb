"""The server of a study: links, sockets, the experimenter, robots of participants, and a server that is killed."""

import asyncio
import json
import re
import sqlite3
import subprocess
import sys
import threading
import time
from contextlib import closing
from types import SimpleNamespace

import pytest
import yaml

pytest.importorskip("viser", reason="viser is not installed")

from core.errors import ConfigError
from demo.page_gate import PageGate
from demo.study.database import StudyDatabase
from demo.study.progress import StudyProgress
from demo.study.serving import read_words
from demo.study.study_config import study_of
from demo.study.study_server import StudyServer
from demo.study.trial_host import FULL
from tools.browser import ROOT, free_port
from tools.page_client import PageClient, request, socket_headers
from tools.study_client import LOST, StudyClient

STUDY = {
    "title": "A study",
    "consent": "Do you agree?",
    "participants": 3,
    "at_once": 1,
    "conditions": {"words": {"driver": "expert", "input": "words"}},
    "scenes": {"one": {"task": "nl_reach", "seed": 1, "goal": "reach the gray cube"}},
    "questions": {"hard": {"text": "Hard?", "points": 5}},
}


class FakeTrials:
    """Robots that are ready at once, one at a time."""

    def __init__(self):
        self.running, self.ended = {}, []

    def start(self, trial):
        if trial.code not in self.running and not self.running:
            values = {"port": 1, "asked_port": 1, "token": "x", "failed": "", "goal": False, "run": 1, "clock": 0.0}
            self.running[trial.code] = SimpleNamespace(trial=trial, rate=1.0, left=time.monotonic(), **values)

    def end(self, code):
        if self.running.pop(code, None):
            self.ended.append(code)

    def end_all(self):
        self.running.clear()


@pytest.fixture
def study(tmp_path):
    """A server without robots in a thread: its address, progress and trials."""
    database = StudyDatabase(tmp_path / "study.sqlite")
    progress = StudyProgress(study_of(STUDY), database)
    database.rows("INSERT INTO goals VALUES ('one', ?, ?, '{}')", (b"\x89PNG before", b"\x89PNG after"))
    port, ready = int(free_port()), threading.Event()
    gate = PageGate("127.0.0.1", port)
    server = StudyServer(progress, "127.0.0.1", gate)
    server.trials = FakeTrials()
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=lambda: loop.run_until_complete(server.serve(port, ready.set)))
    thread.start()
    assert ready.wait(20)
    yield SimpleNamespace(
        base=f"http://127.0.0.1:{port}", gate=gate, progress=progress, trials=server.trials, codes=progress.codes()
    )
    loop.call_soon_threadsafe(server.stop)
    thread.join(20)
    loop.close()
    database.close()


def page_of(study, code):
    page = StudyClient(f"{study.base}/{code}/")
    page.wait(lambda: page.shown, 20)
    return page


def test_a_participant_goes_through_and_the_experimenter_sees_it(study):
    code = study.codes[0]
    experimenter, page = page_of(study, study.gate.token), page_of(study, code)
    page.act("consent")
    assert page.shown["kind"] == "trial"
    assert page.shown["ready"]
    page.act("begin")
    assert [code] == [each["code"] for each in experimenter_shows(experimenter) if each["robot"]]
    page.act("end", gave_up=True)
    assert study.trials.ended == [code]
    page.act("answer", question="hard", value=9)
    assert "must be a whole number from 1 to 5" in page.notes[-1]
    page.act("answer", question="hard", value=4)
    page.act("submit")
    assert page.shown["kind"] == "thanks"
    assert {each["code"]: each["state"] for each in experimenter_shows(experimenter)}[code] == "finished"
    page.close()
    experimenter.close()


def experimenter_shows(experimenter):
    experimenter.listen(1.2)
    return experimenter.shown["participants"]


def test_a_message_that_comes_again_does_not_count_twice(study):
    page = page_of(study, study.codes[0])
    page.act("consent")
    page.act("begin")
    page.send("end", stage=1)
    page.send("end", stage=1)
    assert page.shown["stage"] == 2
    assert page.shown["kind"] == "questions"
    page.close()


def test_who_comes_while_all_robots_are_in_use_waits_for_one(study):
    first, second = (page_of(study, code) for code in study.codes[:2])
    first.act("consent")
    second.act("consent")
    assert second.shown["note"] == FULL
    assert not second.shown["ready"]
    first.act("begin")
    first.act("end")
    second.wait(lambda: second.shown["ready"], 10)
    first.close()
    second.close()


def test_withdrawing_ends_the_robot_and_deletes_the_link(study):
    code = study.codes[0]
    page = page_of(study, code)
    page.act("consent")
    page.send("withdraw")
    assert page.shown["kind"] == "gone"
    assert study.trials.ended == [code]
    assert study.progress.codes() == study.codes[1:]
    assert "404" in request(study.base, f"/{code}/").splitlines()[0]
    page.close()


def test_the_experimenter_stops_and_deletes(study):
    code, other = study.codes[:2]
    experimenter, page = page_of(study, study.gate.token), page_of(study, code)
    page.act("consent")
    experimenter.send("stop", code=code, stopped=True)
    page.wait(lambda: page.shown["kind"] == "stopped", 10)
    experimenter.send("stop", code=code, stopped=False)
    page.wait(lambda: page.shown["kind"] == "trial", 10)
    experimenter.send("stop", code=other, stopped=True)
    assert experimenter.notes[-1] == "This participant is invited."
    experimenter.send("close", closed=True)
    page.wait(lambda: page.shown["kind"] == "stopped", 10)
    experimenter.send("delete", code=code)
    page.wait(lambda: page.shown["kind"] == "gone", 10)
    page.close()
    experimenter.close()


def test_only_links_codes_and_own_names_are_answered(study):
    code = study.codes[0]
    assert "200" in request(study.base, f"/{code}/").splitlines()[0]
    assert b"before".decode() in request(study.base, f"/{code}/goal/one/before.png")
    assert re.search(f"303.*Location: /{code}/", request(study.base, f"/{code}"), re.DOTALL)
    assert re.search(
        f"303.*Location: /{study.gate.token}/", request(study.base, f"/?token={study.gate.token}"), re.DOTALL
    )
    for path in (
        "/",
        "/?token=/evil.example",
        "/nothing/",
        f"/{code[:-1]}/",
        "/experimenter/",
        f"//{code}/",
        "/../",
        f"/x/{code}/",
    ):
        assert request(study.base, path).splitlines()[0].split()[1] in ("403", "404"), path
    for path in (f"/{code}/goal/one/data.png", f"/{code}/goal/two/after.png", f"/{code}/../study.sqlite", f"/{code}/x"):
        assert "404" in request(study.base, path).splitlines()[0], path
    for header in ("Host: evil.example", "Host: 127.0.0.1:1"):
        assert "403" in request(study.base, f"/{code}/", header).splitlines()[0]
    own = f"Host: {study.base.removeprefix('http://')}"
    assert "403" in request(study.base, f"/{code}/", own, "Origin: http://evil.example").splitlines()[0]
    foreign = request(study.base, f"/{code}/socket", own, "Origin: http://evil.example", *socket_headers("deixis"))
    assert "403" in foreign.splitlines()[0]


def test_messages_that_no_page_sends_are_dropped_and_the_server_goes_on(study):
    page = page_of(study, study.codes[0])
    for raw in (
        "",
        "{",
        "[]",
        "null",
        '{"do":"consent"}',
        '{"do":"stop","number":1,"code":"x","stopped":true}',
        "9" * 5000,
    ):
        page._socket.send(raw)
    page._socket.send(b"\x00\xff")
    page._socket.send(json.dumps({"do": "answer", "number": 1, "stage": 0, "question": "hard", "value": [1]}))
    page.act("consent")
    assert page.shown["kind"] == "trial"
    page.close()


@pytest.mark.parametrize(
    "words", [["study=a.yaml", "robot=panda"], ["study=missing.yaml"], ["study="], ["study=a", "study=b"]]
)
def test_wrong_words_get_one_line(words):
    with pytest.raises(ConfigError, match="study"):
        read_words(words)


# ---- With robots


def start(folder, port):
    command = [sys.executable, str(ROOT / "play.py"), f"study={folder / 'study.yaml'}", "--port", port]
    with (folder / "errors").open("a") as errors:
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=errors, text=True)
    links = []
    for line in process.stdout:
        links += [line.strip()] * line.startswith("  http")
        if len(links) == STUDY["participants"]:
            return process, links
    raise AssertionError((folder / "errors").read_text())


@pytest.mark.slow
def test_a_killed_server_loses_nothing_and_the_participant_goes_on(tmp_path):
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(STUDY))
    port = free_port()
    process, links = start(tmp_path, port)
    page = StudyClient(links[0])
    page.wait(lambda: page.shown)
    page.act("consent")
    page.wait(lambda: page.shown["ready"])
    page.act("begin")
    robot = PageClient(f"{links[0]}robot/")
    robot.wait_until_ready()
    robot.send("driver", value="hand")  # which the page of a trial does not take
    robot.send("nudge", to="left")
    robot.say("reach the purple cylinder")
    shown = robot.wait_for_text("reach the purple cylinder")
    process.kill()
    process.wait()
    process.stdout.close()
    with pytest.raises(LOST):
        page.listen(20)
    with closing(sqlite3.connect(tmp_path / "study.sqlite")) as base:
        kinds = [kind for (kind,) in base.execute("SELECT kind FROM events WHERE code=?", (page.code,))]
        said = base.execute("SELECT data FROM events WHERE kind='reply'").fetchone()[0]
        assert base.execute("SELECT revision FROM starts").fetchall()
    assert [k for k in kinds if k not in ("connected", "step", "state")] == [
        "consented",
        "ready",
        "begun",
        "utterance",
        "reply",
    ]
    assert shown in said

    process, again = start(tmp_path, port)
    assert again == links
    page = StudyClient(links[0])
    page.wait(lambda: page.shown.get("ready"))
    assert page.shown["begun"]
    robot = PageClient(f"{links[0]}robot/")
    robot.say("reach the gray cube")
    page.wait(lambda: page.shown["kind"] == "questions")
    page.close()
    process.terminate()
    assert process.wait(60) == 0
    process.stdout.close()
    with closing(sqlite3.connect(tmp_path / "study.sqlite")) as base:
        assert base.execute("SELECT result, goal FROM trials").fetchall() == [("goal reached", 1)]
        assert base.execute("SELECT count(*) FROM events WHERE kind='resumed'").fetchone() == (1,)
    assert (tmp_path / "errors").read_text() == ""

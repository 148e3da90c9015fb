"""The pages of a study in a browser, with made-up states in place of a server: layout, contrast, what is sent."""

import os
import re
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from demo.page_files import PageFiles
from demo.study.study_config import ConditionConfig
from demo.study.trial_files import TrialFiles
from tools.browser import CHROMIUM

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]

AXE = Path(os.environ.get("AXE_CORE", "node_modules/axe-core/axe.min.js"))  # npm install axe-core
SCREENS = {"wide": (1280, 800), "phone": (390, 844)}
BASE = {"title": "A study of robots", "code": "abcdefgh23", "state": "active", "stage": 1, "of": 5}
QUESTION = {"required": True, "value": None, "points": 7, "low": "not at all", "high": "very much", "choices": []}
TRIAL = {
    **{**BASE, "kind": "trial", "trial": 1, "trials": 4, "text": "Make it so.", "how": "Say it.", "input": "both"},
    **{"pictures": "goal/one", "seconds": 120, "clock": 0, "ready": True, "run": 1, "note": "", "reached": False},
}
STATES = {
    "consent": {**BASE, "kind": "consent", "state": "invited", "stage": 0, "text": "We ask you.\n\nDo you agree?"},
    "before a task": {**TRIAL, "begun": False},
    "task": {**TRIAL, "begun": True},
    "questionnaire": {
        **{**BASE, "kind": "questions", "stage": 2, "about": "condition"},
        "questions": [
            {**QUESTION, "name": "hard", "text": "Was it hard?", "kind": "likert"},
            {**QUESTION, "name": "best", "text": "Which was best?", "kind": "choice", "choices": ["words", "finger"]},
            {**QUESTION, "name": "why", "text": "Why?", "kind": "text", "required": False},
        ],
    },
    "thanks": {**BASE, "kind": "thanks", "state": "finished", "stage": 4, "text": "Thank you."},
    "stopped": {**BASE, "kind": "stopped", "state": "stopped"},
}
PERSON = {
    "stage": 2,
    "of": 5,
    "condition": "words",
    "scene": "one",
    "kind": "trial",
    "trial": 2,
    "events": 40,
    "latest": 990.0,
}
PEOPLE = [
    {
        **PERSON,
        "code": "abcdefgh23",
        "state": "active",
        "here": True,
        "robot": {"clock": 12.3, "rate": 1.0, "note": ""},
    },
    {**PERSON, "code": "bcdefghj34", "state": "stopped", "here": False, "robot": None},
    {**PERSON, "code": "cdefghjk45", "state": "invited", "here": False, "robot": None, "of": 0, "latest": None},
]
STATES["experimenter"] = {
    **{"title": "A study of robots", "open": True, "participants": PEOPLE, "withdrawn": 1},
    **{"database": "outputs/study.sqlite", "time": 1000.0},
}
SOCKET = """window.sent = [];
window.WebSocket = class {
  static OPEN = 1;
  constructor() { this.readyState = 1; window.socket = this; setTimeout(() => this.onopen()); }
  send(message) { window.sent.push(JSON.parse(message)); }
};"""


def opened(browser, files, name):
    """A tab with a page of these files."""
    picture = b'<svg xmlns="http://www.w3.org/2000/svg" width="4" height="3"/>', {"Content-Type": "image/svg+xml"}
    errors = []

    def answer(route):
        path = route.request.url.removeprefix("http://page.test/").partition("?")[0]
        found = picture if path.startswith("goal/") else files.get(path) if path != "robot/" else None
        found = found or (b"<!doctype html><title>robot</title>", {"Content-Type": "text/html"})
        route.fulfill(body=found[0], headers={"Content-Type": found[1]["Content-Type"]})

    tab = browser.new_page()
    tab.set_default_timeout(60_000)
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.route("http://page.test/**", answer)
    tab.add_init_script(SOCKET)
    tab.goto(f"http://page.test/{name}")
    tab.wait_for_function("Boolean(window.socket && window.socket.onmessage)")
    return tab, errors


@pytest.fixture(scope="module")
def pages(browser):
    """The participant's and the experimenter's page."""
    tabs = {name: opened(browser, PageFiles(), f"{name}.html") for name in ("study", "experimenter")}
    yield {name: tab for name, (tab, _) in tabs.items()}
    assert [errors for _, errors in tabs.values()] == [[], []]


def show(pages, state):
    tab = pages["experimenter" if state == "experimenter" else "study"]
    tab.evaluate("message => socket.onmessage({data: JSON.stringify(message)})", {"shown": STATES[state]})
    return tab


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed: npm install axe-core")
@pytest.mark.parametrize(("screen", "scheme"), [("wide", "light"), ("phone", "dark")])
def test_axe_finds_nothing_serious_and_nothing_leaves_the_screen(pages, screen, scheme):
    for tab in pages.values():
        tab.emulate_media(color_scheme=scheme)
        tab.set_viewport_size(dict(zip(("width", "height"), SCREENS[screen], strict=True)))
        tab.evaluate(AXE.read_text())
    for state in STATES:
        tab = show(pages, state)
        found = tab.evaluate("axe.run({iframes: false}).then(result => result.violations)")
        serious = [each for each in found if each["impact"] in ("serious", "critical")]
        assert [(state, each["id"], [node["html"][:150] for node in each["nodes"]]) for each in serious] == []
        assert tab.evaluate("document.documentElement.scrollWidth") <= SCREENS[screen][0], state


def test_consent_needs_a_tick_and_each_answer_is_sent_as_it_is_given(pages):
    tab = show(pages, "consent")
    tab.evaluate("window.sent = []")
    tab.get_by_role("button", name="Take part").click()
    assert "Tick the box" in tab.locator("#note").inner_text()
    tab.get_by_label("I agree to take part").check()
    tab.get_by_role("button", name="Take part").click()
    show(pages, "questionnaire")
    tab.get_by_role("radio", name=re.compile("7.*very much")).check()
    tab.get_by_label("Why?").fill("so")
    tab.get_by_role("button", name="Go on").click()
    assert "Please answer: Which was best?" in tab.locator("#note").inner_text()
    tab.get_by_role("radio", name="finger").check()
    tab.get_by_role("button", name="Go on").click()
    sent = [{key: value for key, value in each.items() if key != "number"} for each in tab.evaluate("window.sent")]
    assert sent == [
        {"do": "consent", "stage": 0},
        {"do": "answer", "stage": 2, "question": "hard", "value": 7},
        {"do": "answer", "stage": 2, "question": "why", "value": "so"},
        {"do": "answer", "stage": 2, "question": "best", "value": "finger"},
        {"do": "submit", "stage": 2},
    ]


def test_what_was_not_acknowledged_is_sent_again_after_a_lost_connection(pages):
    tab = show(pages, "before a task")
    tab.evaluate("window.sent = []")
    tab.get_by_role("button", name="Begin").click()
    (begin,) = tab.evaluate("window.sent")
    tab.evaluate("socket.onclose()")
    tab.wait_for_function("window.sent.filter(each => each.do === 'begin').length === 2")
    assert begin in tab.evaluate("window.sent.slice(1)")
    acknowledged = {"acknowledged": begin["number"], "note": ""}
    tab.evaluate("message => socket.onmessage({data: JSON.stringify(message)})", acknowledged)


def test_the_experimenter_stops_and_deletes_whom_a_row_names(pages):
    tab = show(pages, "experimenter")
    tab.evaluate("window.sent = []")
    tab.get_by_role("button", name="Stop abcdefgh23").click()
    tab.get_by_role("button", name="Let go on bcdefghj34").click()
    tab.get_by_role("button", name="Delete cdefghjk45").click()
    tab.get_by_role("button", name="Delete everything").click()
    sent = [{key: value for key, value in each.items() if key != "number"} for each in tab.evaluate("window.sent")]
    assert sent == [
        {"do": "stop", "code": "abcdefgh23", "stopped": True},
        {"do": "stop", "code": "bcdefghj34", "stopped": False},
        {"do": "delete", "code": "cdefghjk45"},
    ]
    assert tab.get_by_role("link", name="abcdefgh23").get_attribute("href").endswith("/abcdefgh23/")


@pytest.mark.parametrize(
    ("condition", "seen", "hidden"),
    [
        ({"input": "words"}, ["#say", "#stop"], ["#point", "#talk", ".bar", ".chips", ".left"]),
        ({"input": "finger"}, ["#stop", "#point"], ["#say", "#do", "#talk", ".preview", ".bar"]),
        ({"answers": False, "suggestions": True}, ["#say", "#point", ".chips"], [".preview", "#lab-button"]),
    ],
)
def test_the_page_of_a_trial_has_what_its_condition_allows(browser, condition, seen, hidden):
    tab, errors = opened(browser, TrialFiles(ConditionConfig(**condition)), "")
    tab.set_viewport_size({"width": 390, "height": 700 if "suggestions" in condition else 420})
    status = {
        "loading": False,
        "text": "",
        "busy": False,
        "note": "",
        "person": condition.get("input") != "words",
        "arm": "",
    }
    status |= {"driver": "policy", "policy": True, "acting": "policy", "hears": "", "real": False, "stopped": False}
    status |= {"viewpoint": "human", "left": ""}
    tab.evaluate(
        "message => socket.onmessage({data: JSON.stringify(message)})",
        {"status": status, "sayable": ["reach the cube"]},
    )
    tab.locator("body[data-ready]").wait_for()
    assert [name for name in seen if not tab.locator(name).first.is_visible()] == []
    assert [name for name in hidden if tab.locator(name).first.is_visible()] == []
    tab.keyboard.press("Control+m")
    assert tab.locator("#talk").get_attribute("aria-pressed") == "false"  # nobody listens
    if AXE.is_file():
        tab.evaluate(AXE.read_text())
        found = tab.evaluate("axe.run({iframes: false}).then(result => result.violations)")
        assert [each["id"] for each in found if each["impact"] in ("serious", "critical")] == []
    assert errors == []
    tab.close()

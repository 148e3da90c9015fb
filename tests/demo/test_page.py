"""The page in a real browser: people load it, type, answer, click, correct, change the robot, and leave."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 60_000  # milliseconds: without a graphics card, on a shared core

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = [
    pytest.mark.skipif("DEIXIS_BROWSER" not in os.environ, reason="DEIXIS_BROWSER=1 runs it: minutes without a GPU"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here"),
]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def served():
    """The address of a page, and its process."""
    port = free_port()
    command = [sys.executable, "play.py", "--port", str(port), "--seed", "3", "driver=expert"]
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    )
    for line in process.stdout:
        if line.startswith("http"):
            break
    yield f"http://127.0.0.1:{port}", process
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in errors


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def page(served, browser):
    return look(served[0], browser)


def look(address, browser):
    """A tab that shows the page."""
    tab = browser.new_page(viewport={"width": 900, "height": 800})
    tab.set_default_timeout(PATIENCE)
    tab.goto(address)
    field(tab, "Say").wait_for()
    return tab


def field(tab, label):
    """The input behind a label."""
    return tab.locator(f'xpath=//*[normalize-space(text())="{label}"]/following::input[1]')


def type_in(tab, sentence, enter=True):
    box = field(tab, "Say")
    box.fill(sentence)
    if enter:
        box.press("Enter")


def shows(tab, words):
    """Wait until the page says so."""
    tab.get_by_text(re.compile(words)).first.wait_for()


def objects(tab):
    """What stands there, as the page's own example and questions call it."""
    type_in(tab, "reach the elephant", enter=False)
    shows(tab, "there is a")
    said = tab.get_by_text(re.compile("there is a")).first.inner_text()
    return [f"the {name}" for name in re.findall(r"\ba (\w+ (?:cube|sphere|cylinder))", said.rpartition("there is")[2])]


def test_a_sentence_is_understood_while_it_is_typed_and_done_on_enter(page):
    name = objects(page)[0]
    type_in(page, f"reach {name}", enter=False)
    shows(page, f"understood: reach {name}")
    type_in(page, f"reach {name}")
    shows(page, "Done in")


def test_nonsense_is_told_where_it_goes_wrong_and_never_run(page):
    type_in(page, "<img src=x onerror=alert(1)> jump")
    shows(page, "is not understood")
    assert page.locator("img[src=x]").count() == 0


def test_an_open_sentence_is_asked_back_and_the_answer_is_done(page):
    names = objects(page)
    type_in(page, "reach the object")
    shows(page, "Do you mean")
    type_in(page, names[1])
    shows(page, f"(Doing: reach {names[1]}|Done in)")
    shows(page, "Done in")


def test_a_correction_in_motion_changes_what_is_meant(page):
    names = objects(page)
    type_in(page, f"reach {names[0]}")
    type_in(page, f"no, {names[2]}")
    shows(page, f"understood: reach {names[2]}")
    shows(page, "Done in")


def test_another_robot_comes_when_it_is_chosen(page):
    field(page, "Robot").click()
    page.get_by_role("option", name="panda").click()
    page.get_by_role("button", name="Change").click()
    shows(page, "Try: reach")
    type_in(page, f"reach {objects(page)[0]}")
    shows(page, "Done in")


def test_two_tabs_see_the_same_and_one_may_go(served, browser, page):
    other = look(served[0], browser)
    type_in(other, f"reach {objects(other)[1]}")
    shows(page, "(Doing|Done in)")
    other.close()
    shows(page, "Done in")


def test_it_is_the_same_after_a_reload(page):
    page.reload()
    field(page, "Say").wait_for()
    shows(page, "Done in")
    type_in(page, f"reach {objects(page)[0]}")
    page.get_by_text("Stop", exact=True).click()
    shows(page, "(Stopped|Done in)")


def test_the_clock_goes_in_real_time(page):
    for _ in range(30):
        rate = float(re.search(r"clock: ([\d.]+)", page.get_by_text(re.compile("clock:")).first.inner_text())[1])
        if abs(rate - 1) <= 0.05:
            return
        time.sleep(1)  # other tests run beside it
    pytest.fail(f"the clock goes at {rate}")

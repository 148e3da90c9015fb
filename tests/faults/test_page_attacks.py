"""play.py under attack: by other pages in the same browser, and by a program that has the address."""

from __future__ import annotations

import http.server
import re
import threading
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")
pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from tests.helpers.thorough import cases
from tools.browser import CHROMIUM, PageTab, PlayServer, headless_browser
from tools.hostile_messages import send_hostile_messages
from tools.page_client import PROTOCOL, TAB_PROTOCOL, PageClient, request, socket_address

REBOUND = "rebound.example"  # the browser takes it for a name of this machine, as after DNS rebinding
TRY_TO_OPEN = """([address, protocol]) => new Promise(done => {
    const socket = new WebSocket(address, [protocol]);
    socket.onopen = () => { socket.close(); done("open"); };
    socket.onerror = () => done("refused");
})"""
TRY_TO_READ = "address => fetch(address).then(answer => answer.text()).catch(() => 'refused')"
TRY_IN_A_FRAME = """([address, protocol]) => new Promise(done => {
    onmessage = event => done([event.origin, event.data]);
    const frame = document.createElement("iframe");
    frame.sandbox = "allow-scripts";
    frame.srcdoc = `<script>const socket = new WebSocket("${address}", ["${protocol}"]);
        socket.onopen = () => parent.postMessage("open", "*");
        socket.onerror = () => parent.postMessage("refused", "*");</` + "script>";
    document.body.append(frame);
})"""

pytestmark = pytest.mark.slow
in_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


@pytest.fixture(scope="module")
def server():
    server = PlayServer("--seed", "3", "driver=expert", "task=nl_reach")
    yield server
    errors = server.close()
    assert server.process.returncode == 0
    assert "Traceback" not in errors


@pytest.fixture(scope="module")
def browser():
    with headless_browser(f"--host-resolver-rules=MAP {REBOUND} 127.0.0.1") as browser:
        yield browser


@pytest.fixture(scope="module")
def other_port():
    """The port of a web server of somebody else on this machine."""

    class Empty(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>theirs</title>")

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Empty) as theirs:
        threading.Thread(target=theirs.serve_forever, args=(0.02,), daemon=True).start()
        yield theirs.server_port
        theirs.shutdown()


def with_token(server, host=None):
    """The page's address as its own page has it, under its own name or another."""
    parts = urlsplit(server.address)
    token = re.search("token=(.+)", parts.query)[1]
    return f"http://{host or parts.hostname}:{parts.port}/{token}/"


def sockets_of(address):
    """The addresses of both sockets of a page, and the protocols that they speak."""
    return [
        [socket_address(address, "socket", "1"), TAB_PROTOCOL],
        [socket_address(address, "scene", "1"), PROTOCOL],
    ]


@in_browser
def test_the_page_in_a_browser_opens_its_socket_and_keeps_the_token(server, browser):
    page = PageTab(browser, server.address, blank=True)
    assert page.tab.url.startswith(with_token(server))
    page.tab.reload()
    page.wait_until_ready()
    for each in sockets_of(with_token(server)):
        assert page.tab.evaluate(TRY_TO_OPEN, each) == "open"
    assert page.tab.context.cookies() == []
    page.tab.close()


@in_browser
@pytest.mark.parametrize("origin", ["127.0.0.1", "localhost", REBOUND])
def test_a_page_of_somebody_else_reaches_nothing_though_it_knows_the_token(server, browser, other_port, origin):
    tab = browser.new_page()
    tab.goto(f"http://{origin}:{other_port}/")
    for host in ("127.0.0.1", "localhost", REBOUND):
        address = with_token(server, host)
        for each in sockets_of(address):
            assert tab.evaluate(TRY_TO_OPEN, each) == "refused"
        assert tab.evaluate(TRY_TO_READ, address) == "refused"
    tab.close()


@in_browser
def test_a_page_without_an_origin_opens_no_socket(server, browser, other_port):
    tab = browser.new_page()
    tab.goto(f"http://127.0.0.1:{other_port}/")
    for each in sockets_of(with_token(server)):
        assert tab.evaluate(TRY_IN_A_FRAME, each) == ["null", "refused"]
    tab.goto("data:text/html,<title>x</title>")
    for each in sockets_of(with_token(server)):
        assert tab.evaluate(TRY_TO_OPEN, each) == "refused"
    tab.close()


@in_browser
def test_a_name_that_was_rebound_to_this_machine_reaches_nothing(server, browser):
    tab = browser.new_page()
    answer = tab.goto(with_token(server, REBOUND))
    assert answer.status == 403
    assert tab.evaluate("location.hostname") == REBOUND
    address = with_token(server, REBOUND)  # of the same origin as the page that asks
    for each in sockets_of(address):
        assert tab.evaluate(TRY_TO_OPEN, each) == "refused"
    assert "another name" in tab.evaluate(TRY_TO_READ, address)
    tab.close()


def test_another_user_of_the_machine_needs_the_token(server):
    for target in ("/", "/index.html", "/?token=guess"):
        assert request(server.address, target).startswith("HTTP/1.1 403 ")


@pytest.mark.parametrize("name", ["nothing", "empty", "text", "torch", "folder", "closed", "nul\0", "x" * 400])
def test_the_page_says_the_same_about_every_path_that_is_no_run(server, tmp_path, name):
    (tmp_path / "empty").touch()
    (tmp_path / "text").write_text("secret")
    (tmp_path / "torch").write_bytes(b"PK\x03\x04 no archive")
    (tmp_path / "folder" / "checkpoints").mkdir(parents=True)
    (tmp_path / "folder" / "checkpoints" / "last.pt").write_bytes(b"x")
    (tmp_path / "closed").mkdir(mode=0)
    with PageClient(server.address) as client:
        client.say("hello")
        client.wait_for_text("Say what I shall do", last=True)
        client.change(run=str(tmp_path / name))
        client.wait_for_text("the run folder is not a folder of a run that can be read here", last=True)
        assert str(tmp_path) not in client.text()


def test_a_sentence_that_would_take_the_parser_long_is_refused(server):
    with PageClient(server.address) as client:
        client.say("reach the cube between the cube and " * 40)
        client.wait_for_text("a sentence has at most 500 characters", last=True)


def unanswered(client, sentence):
    """Say a sentence and stop the robot again. Return what went wrong, or ""."""
    client.say(sentence)
    try:
        client.wait_for_text(f"{sentence} .*doing", last=True)
        client.press("stop")
        client.wait_for_text("Stopped", last=True)
    except TimeoutError as error:
        return f"{sentence}: {error}"
    return ""


def test_hostile_messages_to_the_page(row, server):
    """Another client is served meanwhile and afterwards. The row counts its sentences."""
    messages = cases(400, 2000)
    with PageClient(server.address) as other:
        names = other.names()
        for number in range(10):
            assert not unanswered(other, f"reach {names[number % len(names)]}")
        before = server.megabytes()
        sender = threading.Thread(
            target=send_hostile_messages, args=(np.random.default_rng(0), server.address, messages)
        )
        sender.start()
        while sender.is_alive():
            other.listen(0.1)
        other.start_over()
        names = other.names()
        for number in range(row.number(5, 20)):
            row.count(unanswered(other, f"reach {names[number % len(names)]}"))
        other.listen(5)  # until the clock has been measured anew
        clock, grown = other.sections["clock"]["rate"], server.megabytes() / before - 1
    row.figures |= {"messages": messages, "clock": clock, "memory_grew": round(grown, 4)}
    row.check()
    assert clock <= 1.05
    assert grown < 0.05
    assert other.closed is None

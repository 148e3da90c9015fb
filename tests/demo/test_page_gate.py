"""The gate of the page: names and token that a request needs, tried against a server that listens."""

from __future__ import annotations

from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

pytest.importorskip("viser", reason="viser is not installed")

from core.schema import ConfigError
from demo.guarded_server import MAX_SOCKETS, PageParts, open_guarded_server
from demo.page_gate import PageGate
from tools.browser import free_port
from tools.page_client import TAB_PROTOCOL, PageClient, request, socket_headers

FOREIGN_HOSTS = [  # HOST and PORT stand for those of the server
    "evil.example",
    "evil.example:PORT",
    "HOST",  # without a port: that of port 80
    "HOST:",
    "HOST:80",
    "HOST:1",
    "HOST:0PORT",
    "HOST:PORT0",
    "HOST:PORT:PORT",
    "HOST.:PORT",
    "HOST.evil.example:PORT",
    "evil.HOST:PORT",
    "evil@HOST:PORT",
    "HOST:PORT@evil.example",
    "HOST:PORT/",
    "HOST:PORT#evil.example",
    "HOST:PORT, evil.example",
    "evil.example, HOST:PORT",
    "http://HOST:PORT",
    "localhost.evil.example:PORT",
    "localhost.:PORT",
    "127.0.0.2:PORT",
    "127.1:PORT",
    "0.0.0.0:PORT",
    "2130706433:PORT",
    "0x7f000001:PORT",
    "0177.0.0.1:PORT",
    "[::1]:PORT",
    "[::ffff:127.0.0.1]:PORT",
    "192.168.0.1:PORT",
    "",
    "null",
    "*",
]
FOREIGN_ORIGINS = [
    "null",
    "",
    "*",
    "http://evil.example",
    "https://evil.example",
    "http://evil.example:PORT",
    "http://HOST",
    "http://HOST:80",
    "http://HOST:1",
    "http://HOST:PORT0",
    "http://HOST:PORT.evil.example",
    "http://HOST:PORT@evil.example",
    "http://HOST.evil.example:PORT",
    "http://evil.example#http://HOST:PORT",
    "http://HOST:PORT/",
    "http://HOST:PORT/page",
    "http://HOST:PORT, http://evil.example",
    "http://HOST:PORT http://evil.example",
    "https://HOST:PORT",
    "ws://HOST:PORT",
    "file://",
    "file://HOST:PORT",
    "HOST:PORT",
    "HOST",
    "http://localhost:PORT",  # of a page under a name that this request does not have
    "http://127.0.0.2:PORT",
    "http://127.1:PORT",
    "http://0.0.0.0:PORT",
    "http://2130706433:PORT",
    "http://[::1]:PORT",
    "http://[::ffff:127.0.0.1]:PORT",
    "HTTP://HOST:PORT",
    "http:HOST:PORT",
    "http:///HOST:PORT",
    "chrome-extension://abcdefghijklmnopabcdefghijklmnop",
    "moz-extension://HOST",
    "data:",
    "blob:http://HOST:PORT",
    "about:blank",
    "undefined",
]


@contextmanager
def served(*origins, host="127.0.0.1"):
    port = int(free_port())
    gate = PageGate(host, port, origins)
    server = open_guarded_server(host, port, gate, PageParts())
    yield gate
    server.stop()


@pytest.fixture(scope="module")
def gate():
    with served() as gate:
        yield gate


def answers(gate, *headers):
    """The answers to requests for the page, a file, the scene and both sockets, with the right token."""
    token = gate.token
    yield request(gate.address, f"/?token={token}", *headers)
    yield request(gate.address, f"/{token}/", *headers)
    yield request(gate.address, f"/{token}/main.js", *headers)
    yield request(gate.address, f"/{token}/scene/1/", *headers)
    yield request(gate.address, f"/{token}/scene/1", *headers, *socket_headers())
    yield request(gate.address, f"/{token}/socket/1", *headers, *socket_headers(TAB_PROTOCOL))


def is_refused(answer):
    return answer.startswith("HTTP/1.1 403 ") and "doctype" not in answer


def filled_in(text, gate):
    address = urlsplit(gate.address)
    return text.replace("HOST", address.hostname).replace("PORT", str(address.port))


@pytest.mark.parametrize("host", FOREIGN_HOSTS)
def test_another_host_is_refused_whatever_its_token(gate, host):
    assert all(map(is_refused, answers(gate, filled_in(f"Host: {host}", gate))))


@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_another_origin_is_refused_whatever_its_token(gate, origin):
    assert all(map(is_refused, answers(gate, filled_in(f"Origin: {origin}", gate))))


@pytest.mark.parametrize(
    "lines",
    [
        ("Host: evil.example", "Origin: http://evil.example"),  # a name that was rebound: the two agree
        ("Host: evil.example:PORT", "Origin: http://evil.example:PORT"),
        ("Host: HOST:PORT", "Host: evil.example"),
        ("Host: evil.example", "Host: HOST:PORT"),
        ("Origin: http://HOST:PORT", "Origin: http://evil.example"),
        ("Origin: http://HOST:PORT", "Origin: http://HOST:PORT"),
        ("Host: localhost:PORT", "Origin: http://HOST:PORT"),
        ("X-Forwarded-Host: HOST:PORT", "Host: evil.example"),
        ("Forwarded: host=HOST:PORT", "Host: evil.example"),
        ("oRiGiN: http://evil.example",),
    ],
)
def test_names_that_do_not_agree_are_refused(gate, lines):
    assert all(map(is_refused, answers(gate, *(filled_in(line, gate) for line in lines))))


def test_a_request_without_host_is_not_answered_with_the_page(gate):
    assert is_refused(request(gate.address, f"/?token={gate.token}", "Hostess: x"))


@pytest.mark.parametrize("host", ["HOST:PORT", "localhost:PORT"])
def test_the_page_opens_under_its_own_names(gate, host):
    host = filled_in(host, gate)
    moved, page, file, scene, scene_socket, page_socket = answers(gate, f"Host: {host}", f"Origin: http://{host}")
    assert moved.startswith("HTTP/1.1 303 ")
    assert f"Location: /{gate.token}/\r\n" in moved
    assert page.startswith("HTTP/1.1 200 ")
    assert "<!doctype html>" in page
    assert file.startswith("HTTP/1.1 200 ")
    assert scene.startswith("HTTP/1.1 200 ")
    assert scene_socket.startswith("HTTP/1.1 101 ")
    assert page_socket.startswith("HTTP/1.1 101 ")


@pytest.mark.parametrize(
    "target",
    [
        "/",
        "/index.html",
        "/?token=",
        "/?token=guess",
        "/?token=%ff",
        "/?token=\xff",
        "/\xff/",
        "//[",
        "/?tok",
        "/?TOKEN=TOKEN",
        "/?token=TOKENx",
        "/?token=xTOKEN",
        "/?token=TOKE",
        "/?token[]=TOKEN",
        "/TOKENx/",
        "//TOKEN/",
        "/./TOKEN/",
        "/x/TOKEN/",
        "TOKEN",
        "/x?token=TOKEN",
        "http://127.0.0.1/TOKEN/",
        "/?" + "&".join(["a=1"] * 500) + "&token=TOKEN",
    ],
)
def test_a_request_without_the_token_is_refused(gate, target):
    right = gate.token[:-1] if target.endswith("TOKE") else gate.token
    target = target.replace("TOKEN", right) if not target.endswith("TOKE") else target.replace("TOKE", right)
    for headers in ((), (f"Cookie: token={gate.token}; deixis_token={gate.token}",), socket_headers()):
        assert is_refused(request(gate.address, target, *headers))


@pytest.mark.parametrize(
    "path",
    [
        "../page.py",
        "%2e%2e/x",
        "..%5cx",
        "nothing.js",
        "//etc/passwd",
        "files/x/deixis.png",
        "scene/x/",
        "scene/1/../x",
    ],
)
def test_with_the_token_nothing_but_the_files_of_the_page_is_read(gate, path):
    assert request(gate.address, f"/{gate.token}/{path}").startswith("HTTP/1.1 404 ")


def test_the_address_keeps_what_else_it_asks_for(gate):
    answer = request(gate.address, f"/?fixedDpr=1&token={gate.token}&a=%0d%0ab")
    assert f"Location: /{gate.token}/?fixedDpr=1&a=%0D%0Ab\r\n" in answer
    assert request(gate.address, f"/?token={gate.token}&a=\xff").startswith("HTTP/1.1 303 ")


def test_the_page_is_not_stored_and_tells_nobody_its_address_and_only_its_own_page_frames_the_scene(gate):
    for number, answer in enumerate(answers(gate)):
        if "101 Switching" not in answer:
            assert "Cache-Control: no-store\r\n" in answer
            assert "Referrer-Policy: no-referrer\r\n" in answer
            assert f"X-Frame-Options: {'SAMEORIGIN' if number == 3 else 'DENY'}\r\n" in answer


def test_the_page_loads_nothing_from_elsewhere(gate):
    page = request(gate.address, f"/{gate.token}/")
    assert "Content-Security-Policy: default-src 'self'" in page
    assert "http" not in page.partition("<!doctype")[2]


@pytest.mark.parametrize(
    "lines", [("Upgrade: WebSocket",), ("Upgrade: websocket", "Upgrade: websocket"), ("Upgrade: h2c",)]
)
def test_a_malformed_request_for_the_socket_is_refused(gate, lines):
    assert request(gate.address, f"/{gate.token}/scene/1", *lines).startswith("HTTP/1.1 400 ")


def test_no_more_than_so_many_sockets_are_open(gate):
    clients = []
    answer = ""
    while not answer and len(clients) <= MAX_SOCKETS:
        try:
            clients.append(PageClient(gate.address))
        except Exception as error:  # of websockets
            answer = str(error)
    for client in clients:
        client.__exit__()
    assert len(clients) <= MAX_SOCKETS
    assert "503" in answer


def test_no_two_gates_have_one_token(gate):
    other = PageGate("127.0.0.1", 1)
    assert other.token != gate.token
    assert len(other.token) == 32


def test_a_server_before_the_page_may_have_another_name():
    with served("https://robot.example.org") as gate:
        page = f"/{gate.token}/"
        for host in (filled_in("HOST:PORT", gate), "robot.example.org"):
            answer = request(gate.address, page, f"Host: {host}", "Origin: https://robot.example.org")
            assert answer.startswith("HTTP/1.1 200 ")
        for origin in ("http://robot.example.org", "https://evil.robot.example.org", "https://robot.example.org:8443"):
            assert is_refused(request(gate.address, page, f"Origin: {origin}"))
            assert is_refused(request(gate.address, page, "Host: robot.example.org", f"Origin: {origin}"))


@pytest.mark.parametrize(
    "origin", ["robot.example.org", "https://robot.example.org/", "https://", "ftp://x", "*", "null"]
)
def test_an_origin_that_is_none_is_refused_at_the_start(origin):
    with pytest.raises(ConfigError, match=r"--origin=.* must be"):
        PageGate("127.0.0.1", 8080, [origin])


def test_on_all_addresses_the_page_opens_under_numbers_and_names_of_this_machine():
    with served(host="0.0.0.0") as gate:
        port = urlsplit(gate.address).port
        assert gate.address.startswith("http://127.0.0.1:")
        for host in ("127.0.0.1", "localhost"):
            assert request(gate.address, f"/{gate.token}/", f"Host: {host}:{port}").startswith("HTTP/1.1 200 ")
        for host in ("0.0.0.0", "10.1.2.3", "evil.example"):
            assert is_refused(request(gate.address, f"/{gate.token}/", f"Host: {host}:{port}"))


def test_addresses_of_ipv6_have_brackets():
    assert PageGate("::1", 8080).address.startswith("http://[::1]:8080/?token=")
    assert PageGate("::", 8080).address.startswith("http://[::1]:8080/?token=")

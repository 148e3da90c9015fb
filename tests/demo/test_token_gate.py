"""The token that other machines need to reach the page."""

from __future__ import annotations

import socket
import threading
from contextlib import closing
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from demo.token_gate import COOKIE, TokenGate


class Page(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"the page")

    def log_message(self, *_):
        pass


@pytest.fixture
def gate():
    server = HTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    with closing(TokenGate("127.0.0.1", 0, server.server_port)) as opened:
        yield opened
    server.shutdown()
    server.server_close()


def ask(gate, target="/", *headers):
    """The whole answer to a request."""
    with socket.create_connection(("127.0.0.1", gate.port), timeout=10) as connection:
        lines = [f"GET {target} HTTP/1.1", "Host: x", *headers, "", ""]
        connection.sendall("\r\n".join(lines).encode())
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(4096), b"")).decode()


@pytest.mark.parametrize("target", ["/", "/?token=", "/?token=guess", "/?token=%ff", "//[", "/?tok"])
def test_a_request_without_the_token_is_refused(gate, target):
    for headers in ((), (f"Cookie: {COOKIE}=guess",), ("Upgrade: websocket", "Connection: Upgrade")):
        answer = ask(gate, target, *headers)
        assert answer.startswith("HTTP/1.1 401")
        assert "the page" not in answer


def test_the_token_sets_a_cookie_that_opens_the_page(gate):
    answer = ask(gate, f"/?token={gate.token}")
    assert answer.startswith("HTTP/1.1 303")
    assert "Location: /\r\n" in answer
    assert f"{COOKIE}={gate.token}; HttpOnly; SameSite=Strict" in answer
    opened = ask(gate, "/", f"Cookie: other=1; {COOKIE}={gate.token}")
    assert "200" in opened.splitlines()[0]
    assert opened.endswith("the page")


def test_no_two_gates_have_one_token(gate):
    with closing(TokenGate("127.0.0.1", 0, 1)) as other:
        assert other.token != gate.token
        assert len(other.token) == 32

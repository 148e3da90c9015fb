"""The gate before the page, its files and its socket: who may ask, by the names and the token in the request.

A request must name the server as the person does who started it: another Host is a name that an attacker has pointed at
this machine (DNS rebinding), another Origin is a page of somebody else that is open in the same browser. And it must
have the token of the printed address, which other users of the machine do not know. The token is part of the path of
the page, and the page asks for its socket under the same path: no cookie carries it, so that the browser sends it
nowhere else.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlencode, urlsplit

from core.schema import ConfigError

LOOPBACK_NAMES = {"localhost", "127.0.0.1", "[::1]"}
MAX_FIELDS = 20  # of a query
FOREIGN = (
    "This page has another name, or another page asks for it: open the address that play.py has printed. "
    "If a server or a tunnel is before it, start play.py with --origin and the address that browsers know.\n"
)
NO_TOKEN = "This page needs the address with the token that play.py has printed.\n"


@dataclass(frozen=True)
class Verdict:
    """What is done with a request: one of the three is given.

    refused: the reason, for the person. moved_to: where the browser should ask instead. path: what is asked for,
    without the token.
    """

    refused: str | None = None
    moved_to: str | None = None
    path: str | None = None


class PageGate:
    """Decides about requests. token: what they must have, 32 letters that nobody can guess.

    Args:
        host: the address that the server listens on.
        port: its port.
        origins: further addresses of the page, such as `https://robot.example.org`, if another server or a tunnel is
            before it. Raises ConfigError for one that is no origin.
    """

    def __init__(self, host: str, port: int, origins: Sequence[str] = ()) -> None:
        self.token = secrets.token_urlsafe(24)
        self._host, self._port = host.lower(), port
        self._origins = {_checked_origin(origin) for origin in origins}
        self._fronts = {urlsplit(origin).netloc for origin in self._origins}

    @property
    def address(self) -> str:
        """The address to open on this machine, with the token."""
        host = self._host
        if _is_wildcard(host):
            host = "::1" if ":" in host else "127.0.0.1"
        return self.with_token(f"http://{_in_url(host)}:{self._port}")

    def with_token(self, origin: str) -> str:
        """The address to open where browsers know the page by another origin."""
        return f"{origin}/?token={self.token}"

    def check(
        self, target: str, hosts: Sequence[str], origins: Sequence[str], local_ip: str, is_socket: bool = False
    ) -> Verdict:
        """Decide about a request.

        Args:
            target: path and query.
            hosts: the values of all Host headers.
            origins: the values of all Origin headers.
            local_ip: address of this machine that the request has arrived at.
            is_socket: whether it asks for the socket, which cannot be sent elsewhere.
        """
        if not self.is_named_right(hosts, origins, local_ip):
            return Verdict(refused=FOREIGN)
        path, _, query = target.partition("?")
        first, _, rest = path.removeprefix("/").partition("/")
        if path.startswith("/") and self._is_token(first):
            return Verdict(path=f"/{rest}")
        fields = _fields(query) if path == "/" else []
        if not any(name == "token" and self._is_token(value) for name, value in fields):
            return Verdict(refused=NO_TOKEN)
        if is_socket:
            return Verdict(path="/")
        others = urlencode([(name, value) for name, value in fields if name != "token"], errors="replace")
        return Verdict(moved_to=f"/{self.token}/" + (f"?{others}" if others else ""))

    def is_named_right(self, hosts: Sequence[str], origins: Sequence[str], local_ip: str) -> bool:
        """Whether Host is a name of this server, and Origin, if there is one, the page itself."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        own = hosts[0] in self._authorities(local_ip)
        if not own and hosts[0] not in self._fronts:
            return False
        return not origins or origins[0] in self._origins or (own and origins[0] == f"http://{hosts[0]}")

    def _authorities(self, local_ip: str) -> set[str]:
        """What Host may be. An address as a number is never rebound, so the one that was asked is always right."""
        names = {_in_url(local_ip.partition("%")[0])}
        if not _is_wildcard(self._host):
            names.add(_in_url(self._host))
        if not is_loopback(self._host):
            name = socket.gethostname().lower()
            names |= LOOPBACK_NAMES | {name, f"{name}.local"}
        elif self._host in ("127.0.0.1", "::1", "localhost"):
            names.add("localhost")
        return {f"{name}:{self._port}" for name in names} | (names if self._port == 80 else set())

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "surrogateescape"), self.token.encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _is_wildcard(host: str) -> bool:
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_unspecified
    return not host


def _in_url(host: str) -> str:
    """A host as URLs have it: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


def _fields(query: str) -> Iterable[tuple[str, str]]:
    with suppress(ValueError):
        return parse_qsl(query, keep_blank_values=True, max_num_fields=MAX_FIELDS)
    return []


def _checked_origin(origin: str) -> str:
    with suppress(ValueError):
        parts = urlsplit(origin)
        if parts.scheme in ("http", "https") and parts.hostname and origin == f"{parts.scheme}://{parts.netloc}":
            return origin.lower()
    raise ConfigError(f"--origin={origin} must be scheme and name of the page alone, as in https://robot.example.org")

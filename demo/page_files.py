"""The files of the page: its own, in `demo/web`, and pictures and videos that a tab downloads."""

from __future__ import annotations

import secrets
from pathlib import Path

WEB = Path(__file__).parent / "web"
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mp4": "video/mp4",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".zip": "application/zip",
}
MOST_DOWNLOADS = 4  # that are kept; the oldest one goes first
POLICY = "; ".join(  # of the page's own files: nothing from elsewhere is loaded
    (
        "default-src 'self'",
        "img-src 'self' data:",
        "style-src 'self' 'unsafe-inline'",
        "connect-src 'self' ws: wss:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)


class PageFiles:
    """Files by their paths under the address of the page."""

    def __init__(self) -> None:
        self._own = {path.name: path.read_bytes() for path in WEB.iterdir() if path.suffix in TYPES}
        self._downloads: dict[str, bytes] = {}

    def offer(self, name: str, content: bytes) -> str:
        """Keep a file for a download. Return its path, which nobody can guess."""
        path = f"files/{secrets.token_urlsafe(12)}/{name}"
        self._downloads[path] = content
        while len(self._downloads) > MOST_DOWNLOADS:
            self._downloads.pop(next(iter(self._downloads)))
        return path

    def get(self, path: str) -> tuple[bytes, dict[str, str]] | None:
        """The content of a file and its headers; None if there is none at this path, which begins with no slash."""
        name = path.partition("?")[0] or "index.html"
        content = self._own.get(name, self._downloads.get(name))
        if content is None:
            return None
        headers = {"Content-Type": TYPES[Path(name).suffix], "Content-Security-Policy": POLICY}
        if name in self._downloads:
            headers["Content-Disposition"] = f'attachment; filename="{Path(name).name}"'
        return content, headers

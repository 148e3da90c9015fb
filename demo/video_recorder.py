"""A film of what goes on, with the words below it."""

from __future__ import annotations

import tempfile
from pathlib import Path

from demo.session import Session
from trainers.rollout.video import caption, writer

FPS, EVERY = 10, 2  # frames a second, and control steps a frame: drawing one takes most of a step


class Tape:
    """path: where the film goes; none: nowhere for good, `close` gives it."""

    def __init__(self, path: Path | None = None) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="deixis-film-")
        self._path = path or Path(self._folder.name) / "film.mp4"
        self._film = writer(self._path, FPS)
        self._steps = 0

    def add(self, session: Session) -> None:
        """What is to be seen after a control step."""
        self._steps += 1
        if self._steps % EVERY != 1:
            return
        show = session.show
        ending = "success" if show.status.startswith("Done") else show.status
        self._film.append_data(caption(session.stage.render(), show.hears or show.status, ending))

    def close(self) -> bytes:
        """The film."""
        self._film.close()
        content = self._path.read_bytes()
        self._folder.cleanup()
        return content

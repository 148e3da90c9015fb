"""Video of a session, with the sentence, the status and whose left is meant below the picture."""

from __future__ import annotations

import tempfile
from pathlib import Path

from demo.session import Session
from trainers.evaluation.video import add_caption, open_video

FPS = 10
STEPS_PER_FRAME = 2  # rendering a frame takes most of a control step


class VideoRecorder:
    """Writes an mp4. path: its file; None: a temporary file, whose content `close` returns."""

    def __init__(self, path: Path | None = None) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="deixis-video-")
        self._path = path or Path(self._folder.name) / "video.mp4"
        self._writer = open_video(self._path, FPS)
        self._steps = 0

    def add(self, session: Session) -> None:
        """Adds a frame, at every STEPS_PER_FRAME-th call. To be called after each control step."""
        self._steps += 1
        if self._steps % STEPS_PER_FRAME != 1:
            return
        view = session.view
        ending = "success" if view.status.startswith("Done") else view.status
        sentence = view.sentence or view.policy_sentence or view.status
        self._writer.append_data(add_caption(session.env.render(), sentence, ending, session.whose_left))

    def close(self) -> bytes:
        """Ends the video. Returns the content of the mp4."""
        self._writer.close()
        content = self._path.read_bytes()
        self._folder.cleanup()
        return content

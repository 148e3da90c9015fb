"""Pictures and videos of the page, which a tab downloads."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from demo.page_files import PageFiles
from demo.session import Session
from demo.shared_state import SharedState, Tab
from demo.video_recorder import VideoRecorder


class RecordingPanel:
    """Takes a picture or a video, which the tab that asks for it downloads.

    A video that no tab has asked for when the last one leaves, or when the server ends, is saved in `folder`.

    Args:
        state: of the page; `recording` is whether a video is being recorded.
        files: where downloads are kept.
        folder: where videos are saved.
        show: shows a message on the page.
    """

    def __init__(self, state: SharedState, files: PageFiles, folder: Path, show: Callable[[str], None]) -> None:
        self._state, self._files, self._folder, self._show = state, files, folder, show
        self._recorder: VideoRecorder | None = None
        self._state.put("recording", False)

    def update(self, session: Session) -> None:
        """Add a frame to the video that is being recorded, if any. To be called after each control step."""
        if self._recorder is None:
            return
        if self._state.is_watched:
            self._recorder.add(session)
        else:
            self.save()

    def save(self) -> None:
        """End the video that is being recorded, if any, and save it."""
        if self._recorder is None:
            return
        path = self._folder / time.strftime("deixis-%Y%m%d-%H%M%S.mp4")
        try:
            path.write_bytes(self._stop())
            self._show(f"The video is saved in {path}")
            print(f"the video is saved in {path}", flush=True)
        except OSError as error:
            print(f"the video cannot be saved in {path}: {error.strerror}", flush=True)

    def send_picture(self, session: Session, tab: Tab) -> None:
        """Let a tab download a picture."""
        file = io.BytesIO()
        Image.fromarray(session.env.render()).save(file, "png")
        tab.send("download", self._files.offer("deixis.png", file.getvalue()))

    def toggle(self, tab: Tab) -> None:
        """Begin a video, or end it and let a tab download it."""
        if self._recorder is not None:
            tab.send("download", self._files.offer("deixis.mp4", self._stop()))
        else:
            self._recorder = VideoRecorder()
            self._state.put("recording", True)

    def _stop(self) -> bytes:
        """End the video. Returns the content of the mp4."""
        assert self._recorder is not None
        recorder, self._recorder = self._recorder, None
        self._state.put("recording", False)
        return recorder.close()

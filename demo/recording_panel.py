"""The part of the page that takes pictures and records videos."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser
from PIL import Image

from demo.real_time_loop import RealTimeLoop
from demo.session import Session
from demo.video_recorder import VideoRecorder

START, STOP = "Start video", "Stop video"


class RecordingPanel:
    """Buttons of a page for a picture and a video, which the browser that presses them downloads.

    A video that no browser has asked for when the last one leaves, or when the server ends, is saved in `folder`.

    Args:
        server: of the page.
        loop: runs the session.
        folder: where videos are saved.
        show: shows a message on the page.
    """

    def __init__(
        self, server: viser.ViserServer, loop: RealTimeLoop, folder: Path, show: Callable[[str], None]
    ) -> None:
        self._server, self._loop, self._folder, self._show = server, loop, folder, show
        self._recorder: VideoRecorder | None = None
        gui: Any = server.gui
        with gui.add_folder("Record", expand_by_default=False):
            picture = gui.add_button("Picture")
            self._video = gui.add_button(START)
        picture.on_click(lambda event: loop.ask(lambda session: self._send_picture(session, event.client)))
        self._video.on_click(lambda event: loop.ask(lambda session: self._toggle(event.client)))
        server.on_client_disconnect(lambda _: self._on_disconnect())

    def add(self, session: Session) -> None:
        """Add a frame to the video that is being recorded, if any. To be called after each control step."""
        if self._recorder is not None:
            self._recorder.add(session)

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

    def _on_disconnect(self) -> None:
        if not self._server.get_clients():
            self._loop.ask(lambda session: self.save())

    def _send_picture(self, session: Session, client: Any) -> None:
        file = io.BytesIO()
        Image.fromarray(session.env.render()).save(file, "png")
        client.send_file_download("deixis.png", file.getvalue())

    def _toggle(self, client: Any) -> None:
        if self._recorder is not None:
            client.send_file_download("deixis.mp4", self._stop())
        else:
            self._recorder, self._video.label = VideoRecorder(), STOP

    def _stop(self) -> bytes:
        """End the video. Returns the content of the mp4."""
        assert self._recorder is not None
        recorder, self._recorder, self._video.label = self._recorder, None, START
        return recorder.close()

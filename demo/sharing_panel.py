"""Taking a scene home from the page: its link, its episodes as a dataset, and the scenes that others have prepared."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Literal, cast

from core.errors import ConfigError
from demo.page_files import PageFiles
from demo.session import Session
from demo.shared_scene import CHOICES, PREPARED, Event, EventLog, EventReplay, Pointed, PutThere, Said, SharedScene
from demo.shared_state import SharedState, Tab


class SharingPanel:
    """What happens in the scene, and what is still to happen because a link says so.

    name: of the prepared scene that is shown, or "".

    Args:
        state: of the page; `exporting` is whether a dataset is being written.
        files: where downloads are kept.
        show: shows a message on the page. Called in any thread.
    """

    def __init__(self, state: SharedState, files: PageFiles, show: Callable[[str], None]) -> None:
        self._state, self._files, self._show = state, files, show
        self._log, self._replay = EventLog(), EventReplay((), 0)
        self.name = ""
        self._state.put("exporting", False)

    @property
    def sentences(self) -> Sequence[str]:
        """What can be clicked in the prepared scene."""
        return PREPARED[self.name].sentences if self.name else ()

    def begin(self, session: Session, events: Sequence[Said | Pointed | PutThere] = (), name: str = "") -> None:
        """Begin a scene, in which these events are to happen. name: of the prepared scene, or ""."""
        self._log.clear(session.steps)
        self._replay, self.name = EventReplay(events, session.steps), name

    def stop(self) -> None:
        """Let nothing more happen by itself."""
        self._replay = EventReplay((), 0)

    def due(self, session: Session) -> Event | None:
        """Return what is to happen now, or None. To be called after each control step."""
        return self._replay.next(session.steps, session.busy)

    def did(self, event: Said | Pointed | PutThere, session: Session) -> None:
        """Note what a person did, before it takes effect."""
        self._log.add(event, session.steps, session.busy)

    def send_link(self, session: Session, tab: Tab) -> None:
        """Tell a tab the code of the scene."""
        config = session.config
        scene = SharedScene(
            **{name: getattr(config, name) for name in CHOICES},
            viewpoint=cast(Literal["robot", "human"], session.viewpoint),
            seed=session.seed,
            events=self._log.events,
        )
        tab.send("link", scene.code)

    def export(self, session: Session, tab: Tab, kind: str) -> None:
        """Let a tab download the episodes as a dataset. Writing takes seconds, so another thread does it."""
        export = session.episodes.export(kind)
        self._state.put("exporting", True)

        def write() -> None:
            try:
                tab.send("download", self._files.offer(export.name, export.packed()))
            except (ConfigError, OSError) as error:
                self._show(f"The episodes cannot be exported: {error}")
            finally:
                self._state.put("exporting", False)

        threading.Thread(target=write, name="export", daemon=True).start()

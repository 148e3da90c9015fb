"""Imported by the fork server, and by nothing else, since it changes the process's signals.

The server ignores SIGINT, which a terminal sends to all processes, and ends with the main process, whatever the way
that one ends. The workers end with the server.
"""

from __future__ import annotations

import signal

from core.platform_tuning import paused_collector
from core.system import signal_at_parent_death

signal.signal(signal.SIGINT, signal.SIG_IGN)
signal_at_parent_death()

with paused_collector():
    import trainers.collect.worker  # noqa: F401  # the slow part, with torch's compiler: collecting imports it

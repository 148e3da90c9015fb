"""What the fork server imports; nothing else may import it, since it changes the process's signals.

The server ignores SIGINT, which a terminal sends to all processes, and ends with the main process, whatever the way
that one ends. The workers end with the server.
"""

import signal

from trainers.utils.lean_imports import lean_imports
from trainers.utils.parent_death import signal_at_parent_death

signal.signal(signal.SIGINT, signal.SIG_IGN)
signal_at_parent_death(signal.SIGKILL)

with lean_imports():
    import trainers.rollout.worker_process  # noqa: F401  # the slow part

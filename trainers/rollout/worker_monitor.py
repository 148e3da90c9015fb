"""Notices when a worker process of the collector dies."""

from __future__ import annotations

import multiprocessing.connection
import signal
import threading
from collections.abc import Sequence
from typing import Any

from conf.schema import RunError

WORKER_DIED = "collecting in worker processes failed: one of them died (exit code -9, if it was killed)"
GRACE_SECONDS = 5.0  # time for TorchRL to notice the death of a worker itself


class CollectionError(RunError):
    """A worker process has died or hangs. The run cannot continue."""


class WorkerMonitor:
    """Raises CollectionError in the main thread if a worker process dies and TorchRL does not notice it.

    TorchRL checks its processes while it waits for a batch, but waits forever for a worker that dies just before it
    would have acknowledged new weights.
    """

    def __init__(self, processes: Sequence[Any]) -> None:
        self.ended = threading.Event()
        self.sentinels = [process.sentinel for process in processes]
        self.previous_handler: Any = None
        if hasattr(signal, "SIGUSR1") and threading.current_thread() is threading.main_thread():
            self.previous_handler = signal.signal(signal.SIGUSR1, self._raise)
            threading.Thread(target=self._watch, daemon=True).start()

    def close(self) -> None:
        """Stop monitoring, before the workers are shut down."""
        self.ended.set()
        if self.previous_handler is not None:
            signal.signal(signal.SIGUSR1, self.previous_handler)
            self.previous_handler = None

    def _watch(self) -> None:
        """Wait for the end of a worker, then interrupt the main thread, repeatedly.

        TorchRL swallows an exception raised while it waits for a worker's acknowledgement, once for each worker.
        """
        multiprocessing.connection.wait(self.sentinels)
        while not self.ended.wait(GRACE_SECONDS):
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)

    def _raise(self, *_: object) -> None:
        raise CollectionError(WORKER_DIED)

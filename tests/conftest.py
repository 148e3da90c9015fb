"""Settings that all tests share."""

import gc
import os

# Before anything imports torch: two workers share the cores, and threads that wait for each other are slow.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def pytest_collection_finish():
    """Imported objects stay for good, so the garbage collector need not look at them again and again."""
    gc.freeze()

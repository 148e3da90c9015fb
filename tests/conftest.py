"""Settings that all tests share."""

import gc
import os

# Before anything imports torch: two workers share the cores, and threads that wait for each other are slow.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def pytest_collection_finish():
    """What has been imported stays: the garbage collector need not look at it again and again."""
    gc.freeze()

"""The process that collection workers are forked from. It has imported their modules, so they start at once.

This file imports no torch, so that a program can start the server before its own slow imports.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import forkserver
from multiprocessing.context import BaseContext

SETUP = "trainers.collect.fork_server_setup"  # first: it has the server end with this process


def start(modules: Sequence[str] = ()) -> BaseContext:
    """Start the server unless it runs already. It imports while this process goes on.

    To be called by the main thread: the server ends with the thread that started it. It belongs to one process: a fork
    of this one cannot use it.

    Args:
        modules: imported by the server beside the collection of batches; ignored if it runs already.

    Returns:
        The context in which to start processes: that of the server, or one that starts a new interpreter for each.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():  # Windows
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([SETUP, *modules])
    try:
        with _import_path():
            forkserver.ensure_running()
    except ChildProcessError:  # the server is the parent's
        return multiprocessing.get_context("spawn")
    return context


@contextmanager
def _import_path() -> Iterator[None]:
    """Have processes that are started find the modules that this one finds: Python does not tell the server."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(path or os.getcwd() for path in sys.path)
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before

"""PyBullet clients without the memory that they fill with zeros and hardly use: 21 of the 28 MiB of each.

A client writes zeros to the buffers of a renderer, and to messages of 8 MiB, of which it uses some KiB. The kernel
takes such pages back at no loss: they read as zeros, and take memory again once something else is written to them.
A thread that writes to a page just then would lose what it wrote. PyBullet has no threads; while Python has others, all
pages are kept.
"""

from __future__ import annotations

import ctypes
import mmap
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet as bullet

MAPS = Path("/proc/self/maps")  # Linux only: elsewhere, nothing is given back
SHORTEST = 256 * 1024  # bytes: shorter runs of zeros are kept
Span = tuple[int, int]  # addresses: the first, and the one after the last


def connect() -> int:
    """A new client without a window."""
    if not MAPS.exists() or threading.active_count() > 1:
        return bullet.connect(bullet.DIRECT)
    before = _writable()
    client = bullet.connect(bullet.DIRECT)
    for span in _added(before, _writable()):
        _give_back_zeros(*span)
    return client


def _writable() -> set[Span]:
    """The process's private memory that is backed by no file."""
    rows = [line.split() for line in MAPS.read_text().splitlines()]
    spans = [row[0].split("-") for row in rows if row[1] == "rw-p" and row[5:] in ([], ["[heap]"])]
    return {(int(start, 16), int(end, 16)) for start, end in spans}


def _added(before: set[Span], after: set[Span]) -> Iterator[Span]:
    """The addresses only in `after`. The kernel joins neighbouring spans, so that a new one can contain old ones."""
    gone = sorted(before - after)
    for start, end in sorted(after - before):
        for low, high in gone:
            if low < end and start < high:
                if start < low:
                    yield start, low
                start = high
        if start < end:
            yield start, end


def _give_back_zeros(start: int, end: int) -> None:
    """Give the kernel back the long runs of pages in this span that hold nothing but zeros."""
    libc = ctypes.CDLL(None)
    words = np.ctypeslib.as_array((ctypes.c_uint64 * ((end - start) // 8)).from_address(start))
    empty = ~words.reshape(-1, mmap.PAGESIZE // 8).any(1)
    edges = np.flatnonzero(np.diff(empty, prepend=False, append=False))
    for first, last in (edges.reshape(-1, 2) * mmap.PAGESIZE).tolist():
        if last - first >= SHORTEST:
            libc.madvise(ctypes.c_void_p(start + first), ctypes.c_size_t(last - first), mmap.MADV_DONTNEED)

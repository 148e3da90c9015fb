"""Clients give back the memory that they have filled with zeros, and nothing else."""

from __future__ import annotations

import ctypes
import mmap
import subprocess
import sys
import threading

import numpy as np
import pybullet as bullet
import pytest

from envs.sim import lean_client
from envs.sim.lean_client import MAPS, SHORTEST, _added, _give_back_zeros, connect

pytestmark = pytest.mark.skipif(not MAPS.exists(), reason="memory is given back on Linux alone")
MEASURE = """
from pathlib import Path
from envs.sim.lean_client import connect

def private():
    rows = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(row.split()[1]) for row in rows if row.startswith("Private_")) / 1024

connect()
before = private()
for _ in range(4):
    connect()
print((private() - before) / 4)
"""


def test_client_takes_a_third_of_its_memory() -> None:
    """28 MiB before. In a process of its own: memory is not given back while a test runner's threads are about."""
    done = subprocess.run([sys.executable, "-c", MEASURE], capture_output=True, text=True, check=True)
    assert float(done.stdout.splitlines()[-1]) < 12


def test_nothing_is_given_back_beside_other_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lean_client, "_give_back_zeros", lambda *span: pytest.fail("given back"))
    stop = threading.Event()
    thread = threading.Thread(target=stop.wait)
    thread.start()
    try:
        bullet.disconnect(connect())
    finally:
        stop.set()
        thread.join()


def test_what_was_written_stays() -> None:
    """Long zeros are given back, and what lies between them stays; zeros can be written to again."""
    pages = np.frombuffer(mmap.mmap(-1, 4 * SHORTEST), np.uint8).reshape(4, SHORTEST)
    pages[:] = 0
    pages[1], pages[2, SHORTEST // 2] = 7, 9
    expected = pages.copy()
    start = ctypes.addressof(ctypes.c_char.from_buffer(pages))
    _give_back_zeros(start, start + pages.nbytes)
    assert np.array_equal(pages, expected)
    pages[0] = 1
    assert pages[0].all()


def test_new_memory_is_told_from_old() -> None:
    before = {(0, 10), (20, 30), (50, 60)}
    after = {(0, 10), (15, 40), (50, 65), (70, 80)}  # the second and third have grown
    assert list(_added(before, after)) == [(15, 20), (30, 40), (60, 65), (70, 80)]

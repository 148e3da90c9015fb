"""Workarounds for what other libraries do slowly, or with more memory than they use. They change no result.

`DEIXIS_TUNING=off` in the environment leaves all of them out; whoever suspects one of them can compare. What each one
saves stands in its docstring; docs/experiments/platform_tuning.md has the measurements.

| function | library | saves |
|---|---|---|
| `lean_imports` | torch, TorchRL, TensorDict | 3.1 of 4.6 s of imports; 0.8 s of them come later, beside other work |
| `paused_collector` | Python | 0.95 of 4.6 s of imports |
| `without_zero_pages` | PyBullet | 19 of 28 MiB a client |
| `as_bytes` | PyBullet for Python 3.12 and later | 37 of 230 ms of a picture of 480 x 480 |
| `fast_products` | torch | 172 of 325 us of a product of 256 x 256 matrices |

This module imports neither torch nor PyBullet, so that what is light stays so.
"""

from __future__ import annotations

import ctypes
import gc
import mmap
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

SWITCH = "DEIXIS_TUNING"  # an environment variable: "off" for none of what is in this module
COMPILER, RAY = "torch._dynamo", "ray"
MAPS = Path("/proc/self/maps")  # of Linux: elsewhere, no pages are given back
SHORTEST = 256 * 1024  # bytes: shorter runs of zeros are kept
WORTH = 2**22  # multiplications of a product from which oneDNN is faster; a small one takes it 10 us more
SIZE = 256  # of the matrices whose product is checked
ROUNDED = 1e-3  # error of such a product of normal numbers: about 3e-5 with 32 bits, and 0.1 with bfloat16
Span = tuple[int, int]  # addresses: the first, and the one after the last


def tuned() -> bool:
    """Whether the workarounds are used: unless the environment has DEIXIS_TUNING=off."""
    return os.environ.get(SWITCH, "").lower() != "off"


# ---- Imports


@contextmanager
def paused_collector() -> Iterator[None]:
    """Within this block, which only imports, the garbage collector is off. Afterwards it ignores what was imported.

    It finds nothing there, and takes 0.95 of the 4.6 s of the imports of a training.
    """
    if not tuned():
        yield
        return
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


@contextmanager
def lean_imports() -> Iterator[None]:
    """Within this block, what is imported finds no Ray, and a compiler whose marks change nothing.

    TensorDict and TorchRL import torch's compiler to mark functions for it, and Ray for buffers on a cluster. Nothing
    is compiled here, and Ray is imported in `trainers.cluster`. A module that was imported before stays as it is.
    After the block both can be imported as always. To be used for imports alone, and while no other thread imports.
    With the collector paused, the imports of a training take 1.4 s in place of 4.6 s.
    """
    if not tuned():
        yield
        return
    with paused_collector():
        import torch.compiler

        stubs = {COMPILER: _compiler(torch.compiler.is_compiling), RAY: None}
        added: dict[str, Any] = {name: stub for name, stub in stubs.items() if name not in sys.modules}
        sys.modules.update(added)
        try:
            yield
        finally:
            for name in added:
                sys.modules.pop(name, None)


def import_compiler() -> None:
    """Import the compiler, 0.8 s, while there is time: otherwise the first step of an optimizer imports it."""
    with paused_collector():
        import_module(COMPILER)


def _compiler(is_compiling: Callable[[], bool]) -> ModuleType:
    module = ModuleType(COMPILER)
    marks = dict.fromkeys(("allow_in_graph", "assume_constant_result", "disable"), _mark)
    module.__dict__.update(marks, is_compiling=is_compiling)
    return module


def _mark(function: Any = None, *_: Any, **__: Any) -> Any:
    """A decorator with or without arguments that returns the function itself."""
    return (lambda decorated: decorated) if function is None else function


# ---- Memory of PyBullet's clients


def without_zero_pages(connect: Callable[[], int]) -> int:
    """Connect a client of PyBullet, without the memory that it fills with zeros and hardly uses.

    A client writes zeros to the buffers of a renderer, and to messages of 8 MiB, of which it uses some KiB. The kernel
    takes such pages back at no loss: they read as zeros, and take memory again once something else is written to them.
    A thread that writes to a page just then would lose what it wrote. PyBullet has no threads; while Python has others,
    all pages are kept. A client takes 8.7 MiB in place of 28.0 MiB, and 4 ms more to connect.

    Args:
        connect: connects a client and returns its number.

    Returns:
        The number of the client.
    """
    if not tuned() or not MAPS.exists() or threading.active_count() > 1:
        return connect()
    before = _writable()
    client = connect()
    for span in _added(before, _writable()):
        _give_back_zeros(*span)
    return client


def as_bytes(pixels: Any) -> Any:
    """Return the pixels of a picture as NumPy reads them fast.

    PyBullet's fork for Python 3.12 and later gives a tuple of numbers, which NumPy reads one by one: 55 of 230 ms of a
    picture of 480 x 480; as bytes, 18 ms.
    """
    return memoryview(bytes(pixels)) if isinstance(pixels, tuple) and tuned() else pixels


def _writable() -> set[Span]:
    """Return the process's private memory that is backed by no file."""
    rows = [line.split() for line in MAPS.read_text(encoding="utf-8").splitlines()]
    spans = [row[0].split("-") for row in rows if row[1] == "rw-p" and row[5:] in ([], ["[heap]"])]
    return {(int(start, 16), int(end, 16)) for start, end in spans}


def _added(before: set[Span], after: set[Span]) -> Iterator[Span]:
    """Yield the addresses only in `after`. The kernel joins neighbouring spans: a new one can contain old ones."""
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
    import numpy as np

    libc = ctypes.CDLL(None)
    words = np.ctypeslib.as_array((ctypes.c_uint64 * ((end - start) // 8)).from_address(start))
    empty = ~words.reshape(-1, mmap.PAGESIZE // 8).any(1)
    edges = np.flatnonzero(np.diff(empty, prepend=False, append=False))
    for first, last in (edges.reshape(-1, 2) * mmap.PAGESIZE).tolist():
        if last - first >= SHORTEST:
            libc.madvise(ctypes.c_void_p(start + first), ctypes.c_size_t(last - first), mmap.MADV_DONTNEED)


# ---- Matrix products


@contextmanager
def fast_products(size: int) -> Iterator[None]:
    """Within this block, oneDNN computes products of 32-bit numbers on the CPU if that is faster and as exact.

    Torch has MKL compute them, and MKL uses half of the width of AVX-512 on processors that are not Intel's. oneDNN
    uses all of it. Torch lets oneDNN compute them only where it may round the factors to bfloat16; it does so with AMX
    alone, and not on the processors that are chosen here. It is a setting of the whole process. A product of matrices
    of 256 x 256 takes 153 us in place of 325 us.

    Args:
        size: multiplications of the largest product.
    """
    if size < WORTH or not tuned() or not prefers_onednn():
        yield
    else:
        with _onednn():
            yield


@cache
def prefers_onednn() -> bool:
    """Whether this processor has AVX-512 and is not Intel's, and oneDNN rounds nothing to bfloat16 on it."""
    import torch

    has = torch.cpu.get_capabilities()
    if not torch.backends.mkldnn.is_available() or not has.get("avx512_f") or "Intel" in str(has.get("cpu_name")):
        return False
    a, b = torch.randn(2, SIZE, SIZE, generator=torch.Generator().manual_seed(0))
    with _onednn():
        error = (a @ b).double() - a.double() @ b.double()
    return bool(error.abs().max() < ROUNDED)


@contextmanager
def _onednn() -> Iterator[None]:
    import torch

    matmul = torch.backends.mkldnn.matmul  # type: ignore[attr-defined]
    before = matmul.fp32_precision
    matmul.fp32_precision = "bf16"
    try:
        yield
    finally:
        matmul.fp32_precision = before

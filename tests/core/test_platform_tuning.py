"""Workarounds for other libraries: lean imports, memory of clients, products by oneDNN; and their switch."""

from __future__ import annotations

import ctypes
import gc
import mmap
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pybullet as bullet
import pytest
import torch

from core import platform_tuning
from core.platform_tuning import (
    MAPS,
    SHORTEST,
    SWITCH,
    WORTH,
    _added,
    _give_back_zeros,
    as_bytes,
    fast_products,
    paused_collector,
    prefers_onednn,
    without_zero_pages,
)

ROOT = Path(__file__).parents[2]


def run_python(code: str, **environment: str) -> str:
    """What a fresh interpreter prints last."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, env=os.environ | environment
    )
    assert done.returncode == 0, done.stderr
    return (done.stdout.splitlines() or [""])[-1]


# ---- imports ---------------------------------------------------------------------------------------------------------

LEAN = """
import sys
from core.platform_tuning import lean_imports
with lean_imports():
    import trainers.run.train_loop
heavy = [name for name in ("torch._dynamo", "ray", "sympy", "transformers", "matplotlib") if name in sys.modules]
assert not heavy, heavy
"""
COMPILED = """
import torch
assert torch.compile(lambda x: x + 1, backend="eager")(torch.ones(())) == 2
assert torch._dynamo is sys.modules["torch._dynamo"] and torch._dynamo.__file__
"""


@pytest.mark.slow
def test_a_run_imports_no_compiler_and_no_ray_and_code_can_still_be_compiled():
    run_python(LEAN + COMPILED)


@pytest.mark.slow
def test_a_compiler_that_was_imported_before_stays():
    code = "import sys, torch._dynamo as before\n" + LEAN.partition("heavy")[0]
    run_python(code + "assert sys.modules['torch._dynamo'] is before")


# ---- memory of clients -----------------------------------------------------------------------------------------------

linux = pytest.mark.skipif(not MAPS.exists(), reason="memory is given back on Linux alone")
MEASURE = """
from pathlib import Path
import pybullet as bullet
from core.platform_tuning import without_zero_pages

def connect():
    return without_zero_pages(lambda: bullet.connect(bullet.DIRECT))

def private():
    rows = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(row.split()[1]) for row in rows if row.startswith("Private_")) / 1024

connect()
before = private()
for _ in range(4):
    connect()
print((private() - before) / 4)
"""


def connect() -> int:
    return bullet.connect(bullet.DIRECT)


@linux
def test_client_takes_a_third_of_its_memory() -> None:
    """28 MiB before. In a process of its own: memory is not given back while a test runner's threads are about."""
    assert float(run_python(MEASURE)) < 12


@linux
def test_nothing_is_given_back_beside_other_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform_tuning, "_give_back_zeros", lambda *span: pytest.fail("given back"))
    stop = threading.Event()
    thread = threading.Thread(target=stop.wait)
    thread.start()
    try:
        bullet.disconnect(without_zero_pages(connect))
    finally:
        stop.set()
        thread.join()


@linux
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


# ---- products --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(256, 256, 256), (256, 30, 256), (128, 256, 1), (1, 7, 3)])
def test_products_are_as_exact_as_those_of_torch(shape):
    a, b = torch.randn(shape[:2], generator=torch.manual_seed(0)), torch.randn(shape[1:])
    with fast_products(WORTH):
        fast = a @ b
    exact = a.double() @ b.double()
    assert (fast - exact).abs().max() <= 4 * (a @ b - exact).abs().max() + 1e-6


@pytest.mark.parametrize(("size", "used"), [(WORTH, True), (WORTH - 1, False)])
def test_only_large_products_use_it_and_the_setting_is_put_back(size, used):
    matmul = torch.backends.mkldnn.matmul
    before = matmul.fp32_precision
    with fast_products(size):
        assert (matmul.fp32_precision != before) == (used and prefers_onednn())
    assert matmul.fp32_precision == before


@pytest.mark.parametrize(
    "capabilities",
    [{"avx512_f": True, "cpu_name": "Intel(R) Xeon(R)"}, {"avx512_f": False, "cpu_name": "AMD EPYC"}, {}],
)
def test_processors_on_which_torch_uses_all_of_its_width_keep_torch_s_products(monkeypatch, capabilities):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)
    assert prefers_onednn.__wrapped__() is False


def test_a_library_that_rounds_to_bfloat16_is_not_used(monkeypatch):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_f": True, "cpu_name": "AMD EPYC"})
    product = torch.Tensor.__matmul__

    def rounded(a, b):
        return product(a.bfloat16(), b.bfloat16()).float() if a.dtype == torch.float32 else product(a, b)

    monkeypatch.setattr(torch.Tensor, "__matmul__", rounded)
    assert prefers_onednn.__wrapped__() is False


# ---- the switch ------------------------------------------------------------------------------------------------------


def test_the_switch_leaves_all_of_them_out(monkeypatch):
    monkeypatch.setenv(SWITCH, "off")
    monkeypatch.setattr(platform_tuning, "prefers_onednn", lambda: pytest.fail("asked"))
    monkeypatch.setattr(platform_tuning, "_writable", lambda: pytest.fail("asked"))
    monkeypatch.setattr(gc, "disable", lambda: pytest.fail("disabled"))
    bullet.disconnect(without_zero_pages(connect))
    with paused_collector(), fast_products(WORTH):
        assert gc.isenabled()
    with platform_tuning.lean_imports():
        assert sys.modules.get("ray", ...) is not None


def test_pixels_of_a_build_without_numpy_are_read_as_bytes(monkeypatch):
    pixels = (0, 7, 255, 128)
    for switch in ("on", "off"):
        monkeypatch.setenv("DEIXIS_TUNING", switch)
        assert np.asarray(as_bytes(pixels), np.uint8).tolist() == list(pixels)
    kept = np.arange(4, dtype=np.uint8)
    assert as_bytes(kept) is kept

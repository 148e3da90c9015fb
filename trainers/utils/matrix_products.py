"""Matrix products of updates by oneDNN, where torch's default takes twice as long.

Torch has MKL compute products of 32-bit numbers, and MKL uses half of the width of AVX-512 on processors that are not
Intel's. oneDNN uses all of it. Torch lets oneDNN compute them only where it may round the factors to bfloat16; it does
so with AMX alone, and not on the processors that are chosen here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import torch

WORTH = 2**22  # multiplications of a product from which oneDNN is faster; a small one takes it 10 us more
SIZE = 256  # of the matrices whose product is checked
ROUNDED = 1e-3  # error of such a product of normal numbers: about 3e-5 with 32 bits, and 0.1 with bfloat16


@contextmanager
def fast_products(size: int) -> Iterator[None]:
    """Within this block, oneDNN computes products of 32-bit numbers on the CPU if that is faster and as exact.

    It is a setting of the whole process.

    size: multiplications of the largest product.
    """
    if size < WORTH or not prefers_onednn():
        yield
    else:
        with _onednn():
            yield


@cache
def prefers_onednn() -> bool:
    """Whether this processor has AVX-512 and is not Intel's, and oneDNN rounds nothing to bfloat16 on it."""
    has = torch.cpu.get_capabilities()
    if not torch.backends.mkldnn.is_available() or not has.get("avx512_f") or "Intel" in str(has.get("cpu_name")):
        return False
    a, b = torch.randn(2, SIZE, SIZE, generator=torch.Generator().manual_seed(0))
    with _onednn():
        error = (a @ b).double() - a.double() @ b.double()
    return bool(error.abs().max() < ROUNDED)


@contextmanager
def _onednn() -> Iterator[None]:
    matmul = torch.backends.mkldnn.matmul  # type: ignore[attr-defined]
    before = matmul.fp32_precision
    matmul.fp32_precision = "bf16"
    try:
        yield
    finally:
        matmul.fp32_precision = before

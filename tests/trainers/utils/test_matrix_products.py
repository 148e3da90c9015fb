"""Products by oneDNN: as exact as torch's own, only where they are large, and only within the block."""

from __future__ import annotations

import pytest
import torch

from trainers.utils.matrix_products import WORTH, fast_products, prefers_onednn


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

import pytest
import torch

from trainers.models import networks
from trainers.models.networks import BatchRenorm


def test_the_correction_stays_bounded_after_the_warm_up(monkeypatch):
    monkeypatch.setattr(networks, "WARMUP_STEPS", 3)
    layer = BatchRenorm(2)
    torch.manual_seed(0)
    for _ in range(20):
        layer(torch.randn(64, 2) * 3 + 5)
        assert layer.num_batches_tracked <= 4
    assert layer.eval()(torch.randn(1000, 2) * 3 + 5).shape == (1000, 2)


def test_an_evaluated_layer_normalises_with_its_running_statistics():
    layer = BatchRenorm(2).eval()
    layer.running_mean.fill_(5.0)
    layer.running_var.fill_(9.0)
    out = layer(torch.tensor([[5.0, 8.0]]))
    assert out.flatten().tolist() == pytest.approx([0.0, 1.0], abs=1e-4)

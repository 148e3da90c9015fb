"""Batch renormalisation, Ioffe 2017 (arXiv:1702.03275), for CrossQ's critics."""

from __future__ import annotations

from torch import Tensor
from torchrl.modules import BatchRenorm1d

WARMUP_STEPS = 5_000


class BatchRenorm(BatchRenorm1d):
    """TorchRL's BatchRenorm1d with a counter that stops at the end of the warm-up.

    TorchRL 0.14.1 discards the result of its `clamp_max`, so the counter grows on and the correction is multiplied by
    2, 3, ... after two, three, ... times `warmup_steps`.
    """

    def __init__(self, features: int) -> None:
        super().__init__(features, warmup_steps=WARMUP_STEPS)

    def forward(self, x: Tensor) -> Tensor:
        self.num_batches_tracked.clamp_(max=self.warmup_steps)
        return super().forward(x)

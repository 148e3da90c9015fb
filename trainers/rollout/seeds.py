"""Seeds of a run's parts, derived from the run's seed."""

from __future__ import annotations

import numpy as np

NOISE = 2  # the third word of noise seeds; that of other seeds is 0 or 1


def derive_seed(seed: int, index: int, evaluation: bool = False) -> int:
    """A seed of 31 bits for worker or evaluation `index` of a run.

    Bit 30 separates evaluation from training, so that an evaluation never uses a seed of training.
    """
    word = int(np.random.SeedSequence([seed, index, int(evaluation)]).generate_state(1)[0])
    return (word & 0x3FFFFFFF) | (int(evaluation) << 30)


def noise_seed(seed: int, worker: int, iteration: int) -> int:
    """The seed of a worker's exploration noise in one batch, so that no worker's generator need be saved."""
    return int(np.random.SeedSequence([seed, worker, NOISE, iteration]).generate_state(1, np.uint64)[0])

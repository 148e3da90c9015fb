"""Training of the ray reader."""

import numpy as np
import pytest
import torch

from human.camera import fit, ray_loss
from human.ray_reader import as_input


@pytest.mark.slow
def test_the_loss_falls_on_a_few_frames(frames):
    every = np.arange(len(frames.tips))

    def loss(network):
        with torch.no_grad():
            return float(ray_loss(network(as_input(frames.pictures)), frames, every))

    before = loss(fit(frames, 1, seed=0))
    assert loss(fit(frames, 25, seed=0)) < 0.6 * before


@pytest.mark.slow
def test_training_repeats_bit_for_bit_with_the_seed(frames):
    one, again, other = (fit(frames, 2, seed).state_dict() for seed in (3, 3, 4))
    assert all(torch.equal(value, again[name]) for name, value in one.items())
    assert not all(torch.equal(value, other[name]) for name, value in one.items())

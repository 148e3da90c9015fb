import numpy as np
import torch
from gymnasium import spaces
from torchrl.data import Binary, Bounded, Categorical

from core.spaces import action_space, space_of


def test_a_spec_of_many_worlds_becomes_the_space_of_one():
    box = space_of(Bounded(-2.0, 3.0, shape=(4, 5), dtype=torch.float32))
    assert box == spaces.Box(-2.0, 3.0, (5,), np.float32)
    assert space_of(Binary(3, shape=(4, 3), dtype=torch.bool)) == spaces.MultiBinary(3)
    assert space_of(Categorical(7, shape=(4,), dtype=torch.int64)) == spaces.Discrete(7)
    assert space_of(Categorical(7, shape=(4, 2), dtype=torch.int64)) == spaces.MultiDiscrete([7, 7])


def test_actions_are_between_minus_one_and_one():
    assert action_space(Bounded(-1.0, 1.0, shape=(4, 3))) == spaces.Box(-1.0, 1.0, (3,), np.float32)

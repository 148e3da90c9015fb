"""Gymnasium spaces of TorchRL's specs, and which keys of an observation a policy may read."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from torchrl.data import Binary, Bounded, TensorSpec

PRIVILEGED = "privileged"  # for losses and tests: no policy reads what is under this key
OUTCOMES = ("success", "wrong_object", "wrong_target", "at_goal", "reward_terms")  # of the last step: nothing to act on
ENDS = ("reward", "done", "terminated", "truncated")


def space_of(spec: TensorSpec) -> spaces.Space:
    """Return the space of one world's values. spec: of N worlds; Bounded, Binary or Categorical."""
    if isinstance(spec, Bounded):
        low, high = spec.space.low[0].numpy(), spec.space.high[0].numpy()
        return spaces.Box(low, high, dtype=low.dtype.type)
    if isinstance(spec, Binary):
        return spaces.MultiBinary(spec.shape[-1])
    count = int(spec.space.n)
    return spaces.MultiDiscrete([count] * spec.shape[-1]) if len(spec.shape) > 1 else spaces.Discrete(count)


def action_space(spec: TensorSpec) -> spaces.Box:
    """Return the space of one world's actions. spec: of N worlds."""
    return spaces.Box(-1.0, 1.0, (spec.shape[-1],), np.float32)


def public_keys(observed: Any) -> list[str]:
    """Return the keys that a policy may read, in order. observed: an observation spec, or a TensorDict of one step."""
    others = {PRIVILEGED, *OUTCOMES, *ENDS}
    return [key for key in observed.keys() if key not in others]

"""The action that a step is given, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from core.errors import UseError


class NotFiniteError(ValueError):
    """A step was given an action that is not finite.

    frame: (N,), the input of the step. A training run that this error ends saves it.
    """

    def __init__(self, frame: TensorDictBase) -> None:
        super().__init__(f"{_not_finite(frame)} is not a finite number")
        self.frame = frame.detach().clone()


def read_action(frame: TensorDictBase, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return the action (N, A) of a frame (N,), clipped to [-1, 1].

    Raises:
        UseError: there is no action, or one of another shape or type.
        NotFiniteError: it is not finite.
    """
    given = frame.get("action", None)
    wanted = f"a floating-point tensor of shape {shape}: a row for each world"
    if given is None:
        raise UseError(f"step got no action: its TensorDict needs the key action, {wanted}")
    if tuple(given.shape) != shape or not given.is_floating_point():
        raise UseError(f"step got an action of shape {tuple(given.shape)} and {given.dtype}; it must be {wanted}")
    action = given.detach().numpy().astype(np.float64)
    if not np.isfinite(action).all():
        raise NotFiniteError(frame)
    return np.clip(action, -1.0, 1.0, out=action)


def _not_finite(frame: TensorDictBase) -> str:
    """Return the name of the value that is not finite: an observation if there is one, otherwise the action."""
    for key, value in frame.items():
        if key != "action" and isinstance(value, Tensor) and value.is_floating_point() and not value.isfinite().all():
            return f"the observation {key}"
    return "an action"

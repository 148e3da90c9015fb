"""The outcome of a control step in every world: reward terms, success and failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conf.schema import ConfigError, did_you_mean
from envs.tasks.types import Array, TaskConfig


@dataclass(frozen=True)
class Outcome:
    """Outcome of a control step, (N,) each. terms: unweighted reward terms by name.

    wrong_target: the referent was brought to another target; None if the task has no targets.
    failed: success has become impossible in another way; None if the task cannot fail so.
    """

    terms: dict[str, Array]
    success: NDArray[np.bool_]
    wrong_object: NDArray[np.bool_]
    at_goal: NDArray[np.bool_]
    wrong_target: NDArray[np.bool_] | None = None
    failed: NDArray[np.bool_] | None = None

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """(N,) whether the instruction has ended in success or failure; time limits do not count."""
        ends = (self.success, self.wrong_object, self.wrong_target, self.failed)
        return np.any([flags for flags in ends if flags is not None], axis=0)


def check_terms(config: TaskConfig, terms: Sequence[str]) -> None:
    """Raises ConfigError unless the config weights each reward term of the task, and no other."""
    for name in config.reward:
        if name not in terms:
            raise ConfigError(
                f"task.reward.{name} is not a known term of task.name={config.name}" + did_you_mean(name, terms)
            )
    for name in terms:
        if name not in config.reward:
            raise ConfigError(
                f"task.reward.{name} has no value: task.name={config.name} needs a weight for each of "
                f"{', '.join(terms)}; 0 switches a term off"
            )

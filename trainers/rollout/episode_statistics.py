"""Statistics of the training episodes, from the collected batches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from tensordict import TensorDictBase


class EpisodeStatistics:
    """Success, return and length of the episodes that end in each batch. Running episodes continue in the next batch.

    reward_names: the names of the columns of reward_terms.
    """

    def __init__(self, reward_names: Sequence[str] = ()) -> None:
        self.reward_names = reward_names
        self._running: np.ndarray | None = None  # (2, worlds) return and length so far

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names that `measure` returns."""
        names = ("success", "wrong_object", "return", "length", "episodes")
        return (*(f"train/{name}" for name in names), *(f"reward/{name}" for name in self.reward_names))

    def state_dict(self) -> dict[str, Any]:
        """The returns and lengths of the running episodes, as plain values."""
        return {"running": None if self._running is None else self._running.tolist()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue the episodes of a `state_dict`."""
        self._running = None if state["running"] is None else np.array(state["running"])

    def measure(self, batch: TensorDictBase) -> dict[str, float]:
        """Means over the episodes that end in a batch (worlds, steps), and over all steps for the reward terms.

        NaN if no episode ends.
        """
        after = batch["next"]
        done = after["done"].squeeze(-1).numpy()
        returns, lengths = self._accumulate(after["reward"].squeeze(-1).numpy(), done)
        flags = (after[name].squeeze(-1).numpy()[done] for name in ("success", "wrong_object"))
        means = [float(x.mean()) if len(x) else float("nan") for x in (*flags, returns, lengths)]
        terms = after["reward_terms"].flatten(0, 1).mean(0).tolist() if self.reward_names else []
        return dict(zip(self.metrics, [*means, float(done.sum()), *terms], strict=True))

    def _accumulate(self, reward: np.ndarray, done: np.ndarray) -> np.ndarray:
        """Returns and lengths (2, ended) of the episodes that ended, in the order of the steps.

        reward, done: (worlds, steps).
        """
        running = np.zeros((2, len(reward))) if self._running is None else self._running
        ended = []
        for step_reward, step_done in zip(reward.T, done.T, strict=True):
            running = running + np.stack([step_reward, np.ones_like(step_reward)])
            ended.append(running[:, step_done])
            running = np.where(step_done, 0.0, running)
        self._running = running
        return np.concatenate(ended, axis=1)

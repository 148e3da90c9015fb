"""How many frames a run still has, and after which of them it is evaluated."""

from __future__ import annotations

from trainers.config import Plan, frames_per_batch


class FrameBudget:
    """The frames of a run's plan: of the run, which may stop early, and of its schedule. All worlds step together."""

    def __init__(self, plan: Plan) -> None:
        self._plan, self._batch = plan, frames_per_batch(plan)

    def left_of_schedule(self, frames: int) -> int:
        """Frames of whole steps of all worlds until the end of the schedule. frames: used so far."""
        return self._left(self._plan.schedule_frames, frames)

    def exhausted(self, frames: int) -> bool:
        """Whether another batch would exceed total_frames. The last one of the schedule is shortened to fit."""
        batch = min(self._batch, self.left_of_schedule(frames))
        return not 0 < batch <= self._left(self._plan.run.total_frames, frames)

    def evaluation_due(self, frames: int) -> bool:
        """Whether to evaluate now: once every eval.interval frames, but not just before the final evaluation."""
        interval = self._plan.eval.interval
        return frames // interval > (frames - self._batch) // interval and self.left_of_schedule(frames) > 0

    def _left(self, most: int, frames: int) -> int:
        worlds = self._plan.collector.worlds
        return max(0, most - frames) // worlds * worlds

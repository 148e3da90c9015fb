"""Statistics of episodes in which a person at the window chose the referent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from trainers.rollout.evaluation import wilson


class Played(Protocol):
    """How such an episode ended."""

    @property
    def success(self) -> bool: ...

    @property
    def wrong_object(self) -> bool: ...


def summarize_by_hand(played: Sequence[Played]) -> dict[str, Any]:
    """Plain values for JSON."""
    successes = sum(each.success for each in played)
    return {
        "by_hand": True,
        "episodes": len(played),
        "success_at_end": successes / max(len(played), 1),
        "wrong_object": sum(each.wrong_object for each in played) / max(len(played), 1),
        "ci95": list(wilson(successes, len(played))),
        "played": [vars(each) for each in played],
    }

"""Which observations an environment has, read from its spec or from what it returned."""

from __future__ import annotations

from typing import Any

PRIVILEGED = "privileged"  # for losses and tests: no policy reads what is under this key
OUTCOMES = ("success", "wrong_object", "wrong_target", "at_goal", "reward_terms")  # of the last step: nothing to act on
ENDS = ("reward", "done", "terminated", "truncated")


def public_keys(observed: Any) -> list[str]:
    """The keys that a policy may read, in their order. observed: an observation spec, or a TensorDict of one step."""
    others = {PRIVILEGED, *OUTCOMES, *ENDS}
    return [key for key in observed.keys() if key not in others]

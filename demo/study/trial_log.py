"""The log of a trial: events with the world's state, committed before anything of them is shown."""

from __future__ import annotations

from typing import Any

from demo.session import Session
from demo.study.database import StudyDatabase
from demo.study.goals import shares_of


class TrialLog:
    """Writes the events of one trial. To be used by the thread that steps the session.

    clock: seconds of the world's clock that were over when this log began. session: None until the robot is loaded.
    """

    def __init__(self, database: StudyDatabase, code: str, trial: int, clock: float) -> None:
        self._database, self._code, self._trial = database, code, trial
        self.clock = clock
        self.session: Session | None = None

    def write(self, kind: str, data: Any = None) -> int:
        """Append an event, which is committed when this returns. Returns its number; 0: the participant is gone."""
        state = None if self.session is None else state_of(self.session)
        return self._database.log(self._code, self._trial, kind, data, clock=round(self.clock, 3), state=state)


def state_of(session: Session) -> dict[str, Any]:
    """The world's state as plain values; lengths in metres. Objects are numbered as in `names` of the event `ready`."""
    env, view = session.env, session.view
    state: dict[str, Any] = {
        "objects": env.scene().positions.round(4).tolist(),
        "gripper": env.gripper[0].round(4).tolist(),
        "held": env.held,
        "busy": session.busy,
        "about": list(view.highlighted),
    }
    shares = {name: round(share, 4) for name, share in shares_of(session).items() if abs(share) > 1e-4}
    if shares:
        state["moved"] = shares
    if view.ray is not None:
        state["ray"] = [each.round(4).tolist() for each in view.ray]
    return state

"""Goals of scenes: the expert brings them about before the study, for pictures of before and after, and for checks."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from core.errors import ConfigError
from demo.session import Session
from demo.study.study_config import SceneConfig, StudyConfig, session_config
from language import LanguageError, Plan

Array = NDArray[np.float64]
MOVED, NEAR = 0.02, 0.05  # metres: what counts as moved, and how near to its place in the picture it must be
TURNED, ALMOST = 0.2, 0.2  # the same of devices and fittings, in shares of their way
REACHED = 0.08  # metres of the gripper, where a goal moves nothing
MOST_STEPS = 2400  # control steps: two minutes
SEEN_FROM = (  # of the pictures: from where the person sees the page
    "workspace.cameras.film.target=[0.42,0.0,0.08]",
    "workspace.cameras.film.distance=0.83",
    "workspace.cameras.film.yaw=82.0",
    "workspace.cameras.film.pitch=-47.0",
    "workspace.cameras.film.fov=60.0",
)


@dataclass(frozen=True)
class SceneGoal:
    """What must hold at the end of a scene.

    places: where objects must be, by index, metres. shares: how far devices and fittings must be moved, by name.
    gripper: where the gripper must be if nothing is moved, metres. referent: index of the object that it is about.
    """

    places: dict[int, list[float]]
    shares: dict[str, float]
    gripper: list[float] | None
    referent: int

    def holds(self, session: Session) -> bool:
        """Whether it holds now."""
        positions, shares = session.env.scene().positions, shares_of(session)
        if session.env.held is not None and self.places:
            return False
        if any(np.linalg.norm(positions[index] - place) > NEAR for index, place in self.places.items()):
            return False
        if any(abs(shares[name] - share) > ALMOST for name, share in self.shares.items()):
            return False
        return self.gripper is None or bool(np.linalg.norm(session.env.gripper[0] - self.gripper) < REACHED)

    def to_json(self) -> str:
        """The goal as text."""
        return json.dumps(vars(self))

    @classmethod
    def from_json(cls, text: str) -> SceneGoal:
        """The goal of a text that `to_json` made."""
        values = json.loads(text)
        return cls(**values | {"places": {int(index): place for index, place in values["places"].items()}})


def shares_of(session: Session) -> dict[str, float]:
    """How far devices (shares of their way) and fittings (metres or radians) are moved, by name."""
    devices = {f"device {index}": float(share) for index, share in enumerate(session.env.moved())}
    return devices | {name: float(value[0]) for name, value in session.env.fittings.items()}


def prepare_goal(study: StudyConfig, name: str, scene: SceneConfig) -> tuple[bytes, bytes, str]:
    """Let the expert bring a goal about. Returns the pictures of before and after, as PNG, and the goal as JSON.

    Raises:
        ConfigError: the goal is not understood, or is not reached.
    """
    config = session_config(study, None, scene, f"scenes.{name}")
    session = Session(replace(config, overrides=list(SEEN_FROM)), scene.seed)
    try:
        session.set_viewpoint("human")
        before, beginning, shares = _picture(session), session.env.scene().positions, shares_of(session)
        referent = _carry_out(session, f"scenes.{name}.goal", str(scene.goal))
        goal = _goal(session, beginning, shares, referent)
        return before, _picture(session), goal.to_json()
    finally:
        session.close()


def _carry_out(session: Session, key: str, sentence: str) -> int:
    """Have the expert do what a sentence says. Returns the index of its object."""
    names = ", ".join(session.object_names())
    try:
        outcome: Any = session.say(sentence)
    except LanguageError as error:
        raise ConfigError(f"{key}={sentence} cannot be done: {error} (the objects are {names})") from None
    if not isinstance(outcome, Plan) or not outcome.steps:
        text = outcome.message if hasattr(outcome, "message") else "it asks for nothing to be done"
        raise ConfigError(f"{key}={sentence} cannot be done: {text} (the objects are {names})")
    for _ in range(MOST_STEPS):
        if not session.busy:
            break
        session.step()
    if not session.view.status.startswith("Done"):
        raise ConfigError(
            f"{key}={sentence} was not brought about by the expert ({session.view.status}): choose another"
        )
    return int(outcome.steps[-1].object)


def _goal(session: Session, before: Array, shares_before: dict[str, float], referent: int) -> SceneGoal:
    after, shares = session.env.scene().positions, shares_of(session)
    moved = np.flatnonzero(np.linalg.norm(after - before, axis=1) > MOVED)
    places = {int(index): after[index].round(4).tolist() for index in moved}
    turned = {name: round(share, 3) for name, share in shares.items() if abs(share - shares_before[name]) > TURNED}
    gripper = None if places or turned else session.env.gripper[0].round(4).tolist()
    return SceneGoal(places, turned, gripper, referent)


def _picture(session: Session) -> bytes:
    file = io.BytesIO()
    Image.fromarray(session.env.render()).save(file, "png")
    return file.getvalue()

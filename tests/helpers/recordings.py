"""Small recordings of the scripted expert, in each format."""

from __future__ import annotations

from pathlib import Path

import record
from envs import make_env
from envs.experts import expert
from trainers.datasets.demonstrations import Demonstration, demonstrate

WITH_GESTURE = ["task=nl_reach_gesture", "gesture.switch=1.0", "gesture.noise_deg=3"]
FORMATS = ("lerobot", "minari")
EPISODES, SEED = 3, 5


def record_formats(folder: Path) -> None:
    """Record `EPISODES` episodes with a moving gesture in each format."""
    for form in FORMATS:
        out = f"out={directory_of(folder, form)}"
        record.main(["expert=true", f"episodes={EPISODES}", f"format={form}", out, f"seed={SEED}", *WITH_GESTURE])


def directory_of(folder: Path, form: str) -> Path:
    """Return the directory of the recording in this format."""
    return folder / f"{form}-v3"  # minari wants a version at the end


def expected_episodes() -> list[Demonstration]:
    """The same episodes, as the environment gives them."""
    env = make_env(WITH_GESTURE)
    try:
        return list(demonstrate(env, expert(env), EPISODES, SEED))
    finally:
        env.close()

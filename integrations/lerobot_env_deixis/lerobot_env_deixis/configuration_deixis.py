"""The options of `--env.type=deixis`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs import EnvConfig

from core.errors import ConfigError, RunError
from lerobot_env_deixis.sim_env import AGENT, OBJECTS, DeixisSimEnv

PIXELS = "pixels/"  # before the name of a camera
PACKAGE = __name__.partition(".")[0]
GYM_ID = f"{PACKAGE}/Deixis-v0"
RENAMED = {AGENT: "observation.state", OBJECTS: "observation.environment_state", "action": "action"}


@EnvConfig.register_subclass("deixis")
@dataclass
class DeixisEnvConfig(EnvConfig):
    """One task of Deixis. A policy gets the state of the arm, a picture and the sentence.

    task, robot, control: options of those config groups.
    overrides: more Hydra overrides: '["task.num_objects=6", "workspace.cameras.film.width=128"]'.
    checkpoint: the environment of this policy of Deixis instead: a run, a file, or the name of a pretrained policy. The
        overrides then apply to its config; task, robot and control are not used.
    cameras: of which cameras of `workspace.cameras` policies get pictures: '["front", "wrist"]'. Videos are made by
        `film` in any case.
    objects: whether policies also get what no camera tells: the rows of the objects, and all else that policies of
        Deixis read.
    """

    task: str | None = "nl_reach"
    robot: str = "kuka"
    control: str = "step"
    overrides: list[str] = field(default_factory=list)
    checkpoint: str | None = None
    cameras: list[str] = field(default_factory=lambda: ["film"])
    objects: bool = False
    fps: int = 20

    def __post_init__(self) -> None:
        """Read names and shapes of the observations from an environment. Raises RunError for what none has.

        LeRobot's parser hides the text of a ConfigError, which is a ValueError.
        """
        try:
            env = DeixisSimEnv(**self.gym_kwargs)
        except ConfigError as error:
            raise RunError(str(error)) from None
        try:
            self.features = {name: PolicyFeature(_type(name), shape) for name, shape in env.shapes().items()}
            self.features_map = {name: _policy_key(name) for name in self.features}
            self.fps = env.metadata["render_fps"]
        finally:
            env.close()

    @property
    def package_name(self) -> str:
        """The module that registers `gym_id`."""
        return PACKAGE

    @property
    def gym_id(self) -> str:
        """The id of all tasks with Gymnasium."""
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """The arguments of `DeixisSimEnv`."""
        names = ("task", "robot", "control", "overrides", "checkpoint", "cameras", "objects")
        return {name: getattr(self, name) for name in names}


def _policy_key(name: str) -> str:
    """Return the key under which LeRobot hands an observation to policies; "action" is the action."""
    if name.startswith(PIXELS):
        return f"observation.images.{name.removeprefix(PIXELS)}"
    return RENAMED.get(name, f"observation.{name}")


def _type(name: str) -> FeatureType:
    """Return the kind of feature that LeRobot takes it for."""
    if name == "action":
        return FeatureType.ACTION
    if name.startswith(PIXELS):
        return FeatureType.VISUAL
    return FeatureType.ENV if name == OBJECTS else FeatureType.STATE

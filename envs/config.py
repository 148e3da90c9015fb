"""The configuration of an environment: a composed Hydra config, checked and turned into dataclasses."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from core.errors import ConfigError, did_you_mean
from core.schema import read
from envs.mdp.controls import ControlConfig
from envs.mdp.pictures_config import PicturesConfig
from envs.perception.config import STATE, PerceptionConfig
from envs.sim.gripper import GripperConfig
from envs.sim.robot_config import RobotConfig, urdf_path
from envs.sim.workspace import WorkspaceConfig
from envs.sim.world import PhysicsConfig
from envs.tasks import NO_CURRICULUM, TASKS, RandomizeConfig, TaskConfig
from human import GestureConfig


@dataclass(frozen=True, kw_only=True)
class EnvConfig:
    """The checked config groups that an environment is built from. pictures: what policies see; None: no pictures."""

    robot: RobotConfig
    control: ControlConfig
    workspace: WorkspaceConfig
    task: TaskConfig
    physics: PhysicsConfig
    gesture: GestureConfig
    gripper: GripperConfig
    perception: PerceptionConfig = STATE
    pictures: PicturesConfig | None = None

    def without_curriculum(self) -> EnvConfig:
        """Return the config for evaluation: one instruction an episode, no curriculum and no domain randomisation."""
        task = replace(self.task, curriculum=NO_CURRICULUM, instructions=1)
        return replace(self, task=task).randomized(RandomizeConfig())

    def drawn(self) -> EnvConfig:
        """Return the config of scenes that words are learned from without simulation: they may have more objects."""
        most = max(self.task.num_objects, self.task.drawn_objects)
        return replace(self, task=replace(self.task, num_objects=most))

    def drawn_anywhere(self) -> EnvConfig:
        """Return the config of such scenes in pictures: the gripper may be anywhere in its box."""
        drawn = self.without_curriculum().drawn()
        return replace(drawn, task=replace(drawn.task, curriculum=replace(NO_CURRICULUM, near=1.0)))

    def with_instructions(self, count: int) -> EnvConfig:
        """Return the config whose episodes have `count` instructions, one after another."""
        return replace(self, task=replace(self.task, instructions=count))

    def randomized(self, randomize: RandomizeConfig) -> EnvConfig:
        """Return the config with this domain randomisation."""
        return replace(self, task=replace(self.task, randomize=randomize))


def read_env(config: Any) -> EnvConfig:
    """Return the groups of a composed config, checked. Raises ConfigError before anything is loaded."""
    for name, default in (("gesture", "none"), ("gripper", "own")):
        if name not in config:
            raise ConfigError(f"{name} is missing: this config is older than the group; give {name}={default}")
    robot = read(RobotConfig, config["robot"], "robot")
    urdf_path(robot)
    workspace = read(WorkspaceConfig, config["workspace"], "workspace")
    perception = read(PerceptionConfig, config["perception"], "perception") if "perception" in config else STATE
    task = read(TaskConfig, config["task"], "task")
    if task.name not in TASKS:
        raise ConfigError(f"task.name={task.name} is not a task" + did_you_mean(task.name, TASKS))
    gripper = read(GripperConfig, config["gripper"], "gripper")
    if gripper.of(robot) == "hinge":
        robot = robot.with_jaws()
    workspace = workspace.within_reach(robot.reach) if robot.reach else workspace
    traits = TASKS[task.name].traits
    if gripper.rod and traits.moves:
        robot = gripper.on_rod(robot)
    if task.devices and not traits.continues:
        raise ConfigError(f"task.devices={task.devices} must be 0 in task.name={task.name}: take task=anything")
    if task.hand and not task.devices:
        raise ConfigError(f"task.hand=true needs devices, and task.devices={task.devices}: take task=anything")
    if task.curriculum.off_centre and gripper.of(robot) != "magnet":
        raise ConfigError(
            f"task.curriculum.off_centre={task.curriculum.off_centre} must be 0 with {gripper.of(robot)}: only a "
            "magnet holds objects off its middle"
        )
    if traits.stacks:
        _check_board(task, workspace)
    gesture = read(GestureConfig, config["gesture"], "gesture")
    if perception.sees:
        perception.check(workspace)
        gesture = replace(gesture, source="camera") if gesture.source == "ray" else gesture
    return EnvConfig(
        robot=robot,
        control=read(ControlConfig, config["control"], "control"),
        workspace=workspace,
        task=task,
        physics=read(PhysicsConfig, config["physics"], "physics"),
        gesture=gesture,
        gripper=gripper,
        perception=perception,
        pictures=_read_pictures(config, workspace, perception),
    )


def _read_pictures(config: Any, workspace: WorkspaceConfig, perception: PerceptionConfig) -> PicturesConfig | None:
    """Return which pictures the policy of a composed config asks for; None if it asks for none."""
    policy = config.get("policy", {})
    if not hasattr(policy, "get") or policy.get("pictures") is None:
        return None
    if perception.sees:
        raise ConfigError("perception=camera is for policies that are told what is seen: take perception=state")
    pictures = read(PicturesConfig, policy["pictures"], "policy.pictures")
    pictures.check(workspace)
    return pictures


def _check_board(task: TaskConfig, workspace: WorkspaceConfig) -> None:
    """Raise ConfigError unless the cells of the task are those of the workspace's board."""
    board = workspace.board
    if board is None:
        raise ConfigError(f"task.name={task.name} needs a board, which workspace={workspace.name} lacks: choose board")
    if list(workspace.object_area) != board.area:
        raise ConfigError(f"workspace.object_area={workspace.object_area} must be the board's area={board.area}")
    for name, value, wanted in (("spacing", task.spacing, board.cell), ("levels", task.levels, board.levels)):
        if value > wanted if name == "levels" else value != wanted:
            raise ConfigError(
                f"task.{name}={value} does not fit the board of workspace={workspace.name}: it must be {wanted}"
            )


def dataset_facts(config: EnvConfig, grips: bool) -> dict[str, Any]:
    """Return what every dataset tells of its environment. grips: whether the task's gripper holds objects."""
    from envs.mdp.observations import robot_names  # slow to import

    period = config.physics.time_step * config.physics.substeps
    return {
        "config": asdict(config),
        "robot": config.robot.name,
        "fps": max(1, round(1 / period)),
        "names": {"robot": robot_names(config.robot.joints, grips)},
    }

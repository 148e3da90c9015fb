"""From the words of a command line to an environment with an arm: `arm=sim arm.latency=0.06 safety.speed=0.5`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from core.command_line import check_file
from core.errors import ConfigError, did_you_mean
from core.schema import read
from deployment.arm import ARMS, NEVER, Arm, Array, make_arm
from deployment.command_log import CommandLog
from deployment.mirror import FixedScene, MirrorEnv, Perception, TwinPerception, check_perceived
from deployment.safe_arm import Person, SafeArm
from deployment.safety import Limits, Safety, SafetyConfig
from deployment.twin import TwinArm
from envs.config import EnvConfig
from envs.mdp.gestures import make_person
from envs.tasks import EpisodeSpec
from envs.workspace_env import make_kinematics, make_task
from language import LanguageError
from language.scene_file import read_scene

OWN = ("arm", "scene", "log", "predict")


@dataclass(frozen=True)
class ArmChoice:
    """The arm that a person chose.

    name: a key of ARMS. settings: of its adapter. rules: of `SafetyConfig`. scene: a YAML file that says where objects
    are; None: the arm's own perception does. log: file of the commands; None: none. predicts: whether the policy is
    shown where the arm will be once it has done what it was sent, rather than where it was measured.
    """

    name: str
    settings: dict[str, str] = field(default_factory=dict)
    rules: dict[str, str] = field(default_factory=dict)
    scene: str | None = None
    log: str | None = None
    predicts: bool = True


def split_arm(words: Sequence[str]) -> tuple[ArmChoice | None, list[str]]:
    """Return the arm that words choose, None for none, and the other words. Raises ConfigError.

    Without an arm, scene=... is one of the other words: of the page, it is a prepared scene.
    """
    own: dict[str, str] = {}
    others = []
    for word in words:
        key, _, value = word.partition("=")
        if key not in OWN and key.partition(".")[0] not in ("arm", "safety"):
            others.append(word)
        elif key in own:
            raise ConfigError(f"{word}: {key} is given twice, with {key}={own[key]} before; give it once")
        elif not value:
            raise ConfigError(f"{word} has no value; give {key}=<value>, or leave it out")
        else:
            own[key] = value
    if "arm" not in own:
        others += [f"scene={own.pop('scene')}"] if "scene" in own else []
        if own:
            raise ConfigError(f"{next(iter(own))} needs an arm: arm={' or arm='.join(ARMS)}")
        return None, others
    if own["arm"] not in ARMS:
        raise ConfigError(f"arm={own['arm']} is not an arm{did_you_mean(own['arm'], ARMS)}")
    settings, rules = (
        {key.removeprefix(f"{group}."): value for key, value in own.items() if key.startswith(f"{group}.")}
        for group in ("arm", "safety")
    )
    read(SafetyConfig, rules, "safety")
    predict = own.get("predict", "true")
    if predict not in ("true", "false"):
        raise ConfigError(f"predict={predict} must be true or false")
    return ArmChoice(own["arm"], settings, rules, own.get("scene"), own.get("log"), predict == "true"), others


def connect(choice: ArmChoice, setup: EnvConfig, person: Person | None = None, seed: int = 0) -> MirrorEnv:
    """Connect to the arm, and return the environment in which a policy drives it.

    Args:
        choice: the arm.
        setup: of the environment that the policy was trained in.
        person: is asked between commands whether to stop.
        seed: of the scenes that the twin draws.

    Raises:
        ConfigError: something does not fit.
        ArmError: the arm does not answer.
    """
    arm = make_arm(choice.name, choice.settings, setup)
    task = make_task(setup, 1, make_person(setup.workspace.human, setup.gesture))
    check_perceived(setup, task)
    log = CommandLog(None if choice.log is None else _new_file(choice.log))
    rules = read(SafetyConfig, choice.rules, "safety")
    kinematics = make_kinematics(setup, task)
    limits = Limits(setup, kinematics, rules, magnet=setup.gripper.of(setup.robot) == "magnet")
    safe = SafeArm(arm, Safety(rules, limits), log=log, predicts=choice.predicts, person=person)
    try:
        perception = _perception(choice, arm, safe, setup)
        safe.connect()
        return MirrorEnv(setup, safe, perception, seed)
    except BaseException:
        safe.close()
        raise


def _new_file(log: str) -> Path:
    """Return the file of the log. Raises ConfigError if it exists: what an arm has done is not overwritten."""
    file = check_file("log", log)
    if file.exists():
        raise ConfigError(f"log={log} exists already and is not overwritten; choose another name")
    return file


def about(choice: ArmChoice) -> str:
    """Return the first line that a person reads: what is known of the adapter."""
    from importlib import import_module

    module, _, adapter = ARMS[choice.name].partition(":")
    told = getattr(import_module(module), adapter).on_hardware
    warning = "; keep your hand at the emergency stop of the arm itself" if told == NEVER else ""
    return f"arm={choice.name}: {told}{warning}"


def in_force(choice: ArmChoice, setup: EnvConfig) -> str:
    """Return the limits of an arm in one line: a person sees what overrides and checkpoints have made of them."""
    robot, rules = setup.robot, read(SafetyConfig, choice.rules, "safety")
    x0, x1, y0, y1, z0, z1 = setup.workspace.gripper_box
    speeds = [rules.speed * speed for speed in robot.max_speed]
    return (
        f"limits: joints at most {min(speeds):.2f} to {max(speeds):.2f} rad/s; gripper within x {x0:g} to {x1:g}, "
        f"y {y0:g} to {y1:g}, z {z0:g} to {z1:g} m; base at {', '.join(f'{each:g}' for each in robot.base)} m"
    )


def _perception(choice: ArmChoice, arm: Arm, safe: SafeArm, setup: EnvConfig) -> Perception:
    """Return what tells where objects are. Raises ConfigError where nothing does."""
    scene = None if choice.scene is None else episode_of(Path(choice.scene), setup)
    if isinstance(arm, TwinArm):
        return TwinPerception(arm, safe, scene)
    if scene is not None:
        return FixedScene(safe, scene)
    raise ConfigError(f"arm={choice.name} sees no objects: give scene=<YAML file> that says where they are")


def episode_of(file: Path, setup: EnvConfig) -> EpisodeSpec:
    """Return the episode of a scene file, with its first object as referent until an instruction names one.

    Raises ConfigError for a file that cannot be read, or whose objects are not those of the task.
    """
    try:
        scene = read_scene(file, setup.task.viewpoint).scene
    except LanguageError as error:
        raise ConfigError(f"scene={file}: {error}") from None
    task = setup.task
    reals, targets = int((~scene.targets).sum()), int(scene.targets.sum())
    if not 0 < reals <= task.num_objects or targets > task.num_targets:
        raise ConfigError(
            f"scene={file} has {reals} objects and {targets} targets; the policy was trained with up to "
            f"{task.num_objects} and {task.num_targets}"
        )
    wrong = np.flatnonzero(np.abs(scene.sizes - task.object_size) > 0.2 * task.object_size)
    if len(wrong):
        raise ConfigError(
            f"scene={file}: object {wrong[0] + 1} is {scene.sizes[wrong[0]]:g} m wide; the policy was trained with "
            f"objects of {task.object_size:g} m"
        )
    _check_places(file, scene.positions, setup)
    heights = np.maximum(scene.positions[:, 2], task.object_size / 2)  # of their centres: none is in the table
    scene = scene.moved(np.column_stack((scene.positions[:, :2], heights)))
    apart = np.linalg.norm(scene.positions[:, None] - scene.positions, axis=2) + task.object_size * np.eye(len(scene))
    i, j = np.argwhere((apart < 0.9 * task.object_size) & ~scene.targets & ~scene.targets[:, None])[:1].T
    if len(i):
        raise ConfigError(f"scene={file}: object {i[0] + 1} is inside object {j[0] + 1}")
    return EpisodeSpec(scene=scene, referent=0, target=int(np.argmax(scene.targets)) if targets else None)


def _check_places(file: Path, positions: Array, setup: EnvConfig) -> None:
    """Raise ConfigError for an object (K, 3), metres, that the gripper cannot get to, or that is in the table."""
    x0, x1, y0, y1, _, top = setup.workspace.gripper_box
    for number, (x, y, z) in enumerate(positions, 1):
        if not (x0 <= x <= x1 and y0 <= y <= y1 and z <= top):
            raise ConfigError(
                f"scene={file}: object {number} at {x:g}, {y:g}, {z:g} is outside of where the gripper gets to: "
                f"x {x0:g} to {x1:g}, y {y0:g} to {y1:g}, z 0 to {top:g} m"
            )
        if z < 0:
            raise ConfigError(f"scene={file}: object {number} has z={z:g} m, which is below the top of the table")

"""Demonstrations for other libraries: `python record.py checkpoint=<run dir or file> format=lerobot`.

    checkpoint=...    a run directory, a checkpoint file, or a published policy (pretrained/<name>)
    episodes=100      fresh episodes, deterministic policy
    format=lerobot    or minari; both need pip install -e ".[record]"
    expert=false      true: the task's scripted expert acts, in the checkpoint's environment, or without a checkpoint in
                      the one of the other words (task=nl_push robot=panda)
    camera=false      true: with the pictures of the workspace's camera
    seed=0            of the episodes; no training or evaluation has them
    out=<dir>         where the dataset goes; a numbered directory in outputs/ otherwise
    task.num_objects=6 ...   any key of the config, to record elsewhere than it was trained

    replay=<dir>      instead: play the episodes of such a dataset again, and compare all that was recorded
    tolerance=0       how far a number may be from the recorded one; 0: bit for bit

docs/recording.md tells what is in a dataset, and how others load it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conf.arguments import run, split
from conf.overrides import apply, check, compose
from conf.schema import Checked, ConfigError, one_of, read, within

if TYPE_CHECKING:
    from envs.config import EnvConfig
    from envs.workspace_env import WorkspaceEnv


@dataclass(frozen=True, kw_only=True)
class RecordConfig(Checked):
    checkpoint: str | None
    episodes: int = within(1, 10_000_000)
    format: str = one_of("lerobot", "minari")
    expert: bool
    camera: bool
    seed: int = within(0, 2**31 - 1)
    out: str | None
    replay: str | None
    tolerance: float = within(0.0)


DEFAULTS = {
    "checkpoint": None,
    "episodes": 100,
    "format": "lerobot",
    "expert": False,
    "camera": False,
    "seed": 0,
    "out": None,
    "replay": None,
    "tolerance": 0.0,
}


def parse(arguments: list[str]) -> tuple[RecordConfig, list[str]]:
    """Our own keys, and the overrides of the config that are left. Raises ConfigError."""
    names = [field.name for field in fields(RecordConfig)]
    own, overrides = split(arguments, names, "checkpoint=<run dir>")
    config = read(RecordConfig, DEFAULTS | own, "")
    aside = [word for word in arguments if not word.startswith(("replay=", "tolerance="))]
    if config.replay and aside:
        raise ConfigError(f"{aside[0]}: replay=<dir> takes no other key but tolerance: the recording tells the rest")
    if not (config.replay or config.checkpoint or config.expert):
        raise ConfigError("checkpoint=<run dir or file> is missing; or give expert=true, or replay=<dir>")
    return config, overrides


def main(arguments: list[str]) -> None:
    """Record, or replay, and print what came of it. Raises ConfigError."""
    config, overrides = parse(arguments)
    if config.replay:
        _replay(Path(config.replay), config.tolerance)
    else:
        _record(config, overrides)


def _record(config: RecordConfig, overrides: list[str]) -> None:
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.dataset import write
    from trainers.rollout.evaluation import Interrupted
    from trainers.run.train_loop import Stop
    from trainers.utils.atomic_io import refuse_existing
    from trainers.utils.optional_imports import import_optional

    import_optional(*{"lerobot": ["pyarrow"], "minari": ["minari", "h5py"]}[config.format])
    saved, whole = _asked(config, overrides)
    made = _judged(whole)
    place = Path(config.out) if config.out else _numbered(made, config)
    refuse_existing(place)
    with closing(WorkspaceEnv(made, 1, 0, config.camera)) as env, Stop() as stop:
        about = _about(env, config, whole.get("choices", {}))
        try:
            told = write(
                place,
                config.format,
                env,
                _actor(env, config, saved, whole),
                config.episodes,
                config.seed,
                about,
                config.camera,
                stop,
            )
        except Interrupted:
            raise SystemExit(128 + stop.signal) from None
    low, high = told["ci95"]
    print(f"{told['episodes']} episodes, {told['steps']} steps, success_at_end {told['success_at_end']:.3f} ", end="")
    print(f"(95 %: {low:.3f}-{high:.3f}): {place}")


def _asked(config: RecordConfig, overrides: list[str]) -> tuple[dict[str, Any] | None, Any]:
    """The checkpoint, if there is one, and the whole config. Raises ConfigError."""
    if config.checkpoint is None:
        check(overrides)
        return None, compose(overrides)
    from trainers.run import checkpoint

    saved = checkpoint.load(checkpoint.find(Path(config.checkpoint)))
    return saved, apply(saved["config"], overrides)


def _judged(config: Any) -> EnvConfig:
    from envs.config import read_env

    return read_env(config).judged()


def _actor(env: WorkspaceEnv, config: RecordConfig, saved: dict[str, Any] | None, whole: Any) -> Any:
    """Who acts: the checkpoint's policy, or the expert. Raises ConfigError where they don't fit."""
    if config.expert or saved is None:
        from envs.experts import expert

        return expert(env)
    from trainers.algorithms.build import fitted_policy

    return fitted_policy(saved, whole, env).act


def _about(env: WorkspaceEnv, config: RecordConfig, choices: Mapping[str, str]) -> dict[str, Any]:
    """What the formats want to know of the environment beside its episodes."""
    made = env.config
    period = made.physics.time_step * made.physics.substeps
    joints = [f"{joint}.{of}" for of in ("angle", "speed") for joint in made.robot.joints]
    places = [f"gripper.{axis}" for axis in "xyz"]
    turned = [f"gripper.{column}.{axis}" for column in "xy" for axis in "xyz"]
    names = [*joints, *places, *turned, "opening", *(["shut", "holds"] if env.task.grips else [])]
    return {
        "config": asdict(made),
        "actor": "expert" if config.expert else f"policy of {config.checkpoint}",
        "instruction": f"{made.task.name} with {made.robot.name}, {made.control.name}",
        "robot": made.robot.name,
        "fps": max(1, round(1 / period)),
        "names": {"robot": names},
        "gym": _gym_spec(made, choices),
    }


def _gym_spec(config: EnvConfig, choices: Mapping[str, str]) -> Any:
    """The spec with which Gymnasium makes the environment; None if no overrides compose its config.

    Args:
        config: of the environment.
        choices: the option of each config group that it was composed from; empty if an earlier version trained it.
    """
    from gymnasium.envs.registration import EnvSpec

    from envs.config import read_env
    from trainers.sweeps.overrides_of import overrides_of

    if not choices:
        return None
    words = overrides_of(asdict(config) | {"choices": choices})
    try:
        check(words)
        if read_env(compose(words)) != config:
            return None
    except ConfigError:
        return None
    groups = ("task", "robot", "control")
    others = [word for word in words if word.partition("=")[0] not in groups]
    kwargs = {**{group: choices[group] for group in groups}, "overrides": others}
    return EnvSpec(f"Deixis/{config.task.name}-v0", entry_point="envs.gym_env:GymEnv", kwargs=kwargs)


def _numbered(made: EnvConfig, config: RecordConfig) -> Path:
    """A directory that does not exist yet, called as Minari calls its versions."""
    name = f"{made.task.name}-{made.robot.name}-{'expert' if config.expert else 'policy'}-{config.format}"
    places = (Path("outputs") / f"{name}-v{i}" for i in range(10_000))
    return next(place for place in places if not place.exists())


def _replay(folder: Path, tolerance: float) -> None:
    """Raises ConfigError where an episode comes out otherwise than it was recorded."""
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.dataset import read
    from trainers.datasets.verify_replay import replay

    about, episodes = read(folder)
    with closing(WorkspaceEnv(_judged(about["config"]), 1, 0)) as env:
        result = replay(env, episodes)
    if result.largest > tolerance or not result.episodes:
        raise ConfigError(
            f"{folder}: {result.differing} of {result.episodes} episodes differ from their recording; the most in "
            f"{result.key} of episode {result.episode}, by {result.largest:g} where tolerance={tolerance:g}"
        )
    exactly = "bit for bit" if result.largest == 0 else f"within {result.largest:g}"
    print(f"{result.episodes} episodes, {result.steps} steps: all states as recorded, {exactly}")


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run(main, __doc__, words)


if __name__ == "__main__":
    cli()

"""Compose, build, fit, evaluate, report: `python train.py robot=panda algo=sac`. See `python train.py --help`.

The only file that knows every room. What is slow to import waits until it is needed.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hydra

from conf.overrides import apply, check, quoted
from conf.schema import ConfigError, RunError
from trainers.sweeps.sweep import arguments

if TYPE_CHECKING:
    from envs.config import EnvConfig
    from envs.workspace_env import WorkspaceEnv


def build_env(config: EnvConfig, num_worlds: int, seed: int, render: bool = False) -> WorkspaceEnv:
    """A picklable way to the environment, for worker processes."""
    from envs.workspace_env import WorkspaceEnv

    return WorkspaceEnv(config, num_worlds, seed, render)


def run(config: Any, folder: Path) -> dict[str, Any]:
    """Train by the composed config and leave the report in folder. Raises ConfigError before any long work."""
    from omegaconf import OmegaConf

    from envs.config import read_env
    from language import Tokenizer
    from trainers.config import read_plan

    env_config, plan = read_env(config), read_plan(config)

    from trainers.algorithms.build import find_device
    from trainers.run.checkpoint import find
    from trainers.run.train_loop import fit

    find_device(plan.run.device)
    plain: Any = OmegaConf.to_container(config, resolve=True)
    folder.mkdir(parents=True, exist_ok=True)
    OmegaConf.save(config, folder / "config.yaml", resolve=True)
    return fit(
        plan,
        make_env=partial(build_env, env_config),
        make_judge=partial(build_env, env_config.judged()),
        folder=folder,
        config=plain,
        vocabulary=list(Tokenizer.default().vocabulary),
        resume=find(folder) if config.resume else None,
        make_video_env=partial(build_env, env_config.judged(), 1, plan.run.seed, True),
    )


def resumed(path: str, overrides: list[str]) -> tuple[Any, Path]:
    """The config and folder of the run to go on with, these overrides on top. Raises ConfigError."""
    from trainers.run.checkpoint import find, load

    file = find(Path(path))
    overrides = [word for word in overrides if not word.startswith("resume=")]
    config = apply(load(file, to_train=True)["config"], overrides)
    config.resume = path
    return config, file.parent.parent


@hydra.main(version_base="1.3", config_path="conf", config_name="config")
def main(config: Any) -> dict[str, Any] | None:
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    job = HydraConfig.get()
    fresh = folder = Path(job.runtime.output_dir)
    if job.mode == RunMode.MULTIRUN:
        from trainers.sweeps.job import work

        work(Path(__file__), config, list(job.overrides.task), folder)
        return None
    try:
        if config.resume:
            config, folder = resumed(config.resume, list(job.overrides.task))
        result = run(config, folder)
    except (ConfigError, RunError) as error:
        sys.exit(f"error: {error}")
    finally:
        if fresh.is_dir() and not any(fresh.iterdir()):
            fresh.rmdir()  # Hydra's, which a refused or a resumed run does not use
    print(summary(result, folder))
    return result


def summary(result: dict[str, Any], folder: Path) -> str:
    """The result in one line, and where it is."""
    low, high = result["ci95"]
    return (
        f"success_at_end {result['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f}, {result['episodes']} episodes), "
        f"wrong object {result['wrong_object']:.3f}, {result['frames']} frames in {result['wall_s']:.0f} s: {folder}"
    )


def cli() -> None:
    """Check what was typed, then hand it to Hydra."""
    try:
        words = arguments(sys.argv[1:])
        check(words)
    except ConfigError as error:
        sys.exit(f"error: {error}")
    sys.argv[1:] = quoted(words)
    main()


if __name__ == "__main__":
    cli()

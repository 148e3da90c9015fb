"""Train a policy: `python train.py robot=panda algo=sac`. See `python train.py --help`.

Composes the config, builds the environment, trains, evaluates and writes the report. This program connects all
packages. Modules that are slow to import are imported where they are used.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import hydra

from core.command_line import check_run
from core.composition import quoted, raised_by_hydra, split_run_folder, with_choices
from core.errors import ConfigError
from core.machine_limits import require_threads
from core.overrides import apply
from core.path_keys import escaped, from_hydra
from core.platform_tuning import lean_imports
from core.plugins import search_words, take_config_dir
from core.program import program
from core.system import cores
from trainers.cluster.supervised_run import RunWords, is_supervised, ray_errors, report_end, run_apart, supervise
from trainers.sweeps.arguments import expand_resume, register_resolvers

if TYPE_CHECKING:
    from envs.config import EnvConfig
    from envs.workspace_env import WorkspaceEnv
    from trainers.config import TrainingConfig


SWEEP_ENDED = (
    "sweep; the jobs that have finished keep their results: go on with python train.py -m sweep.resume=<its folder> "
    "hydra/launcher=ray"
)
OWN_FOLDER: dict[str, Path | None] = {"run": None}  # a folder of the run that Hydra is not told, by `split_run_folder`


def build_env(
    config: EnvConfig, num_worlds: int, seed: int, render: bool = False, labelled: bool = False
) -> WorkspaceEnv:
    """Build the environment. A module-level function, so that worker processes can unpickle it.

    Args:
        config: of the environment.
        num_worlds: N.
        seed: of the worlds.
        render: whether visual shapes are loaded.
        labelled: whether it observes the actions of the task's expert.

    Raises:
        ConfigError: the environment cannot be built, or the task has no expert.
    """
    from envs.experts.labelled_env import LabelledEnv
    from envs.workspace_env import WorkspaceEnv

    return (LabelledEnv if labelled else WorkspaceEnv)(config, num_worlds=num_worlds, seed=seed, render=render)


def run(config: Any, folder: Path) -> dict[str, Any]:
    """Train with a composed config, print the result, write the report, and return the values of eval.json.

    Args:
        config: as `core.overrides.compose` returns it.
        folder: of the run; created if missing.

    Raises:
        ConfigError: for a bad value, before anything slow is done.
        RunError: the run had to end early.
    """
    from omegaconf import OmegaConf

    from envs.config import read_env
    from language import Tokenizer
    from trainers.collect import fork_server
    from trainers.config import read_training, uses_processes
    from trainers.run.progress import Progress
    from trainers.run.requirements import check_start

    env_config, training = read_env(config), choose_compilation(config, read_training(config))
    check_start(training, folder, new=not config.resume)
    if uses_processes(training.collector):
        fork_server.start(["hydra", "envs.workspace_env"])  # it imports while this process imports
    with Progress(training.run.total_frames) as progress:
        with lean_imports():
            from trainers.run.train_loop import fit
        from trainers.algorithms.algorithm import find_device
        from trainers.run.checkpoint import find
        from trainers.run.run_folder import FolderLock, name_semaphores
        from trainers.utils.files import write_checked_yaml

        find_device(training.run.device)
        name_semaphores()
        with FolderLock(folder):
            write_checked_yaml(folder / "config.yaml", OmegaConf.to_yaml(config, resolve=True))
            return fit(
                training,
                make_env=partial(build_env, env_config, labelled=training.algo.imitates),
                make_eval_env=partial(build_env, env_config.without_curriculum()),
                folder=folder,
                config=saved_config(config),
                vocabulary=list(Tokenizer.default().vocabulary),
                resume=find(Path(config.resume)) if config.resume else None,
                init=find(Path(training.run.init), key="init") if training.run.init and not config.resume else None,
                make_video_env=partial(build_env, env_config.without_curriculum(), 1, training.run.seed, True),
                progress=progress,
                on_result=lambda result: print(summary(result, folder), flush=True),
            )


def choose_compilation(config: Any, training: TrainingConfig) -> TrainingConfig:
    """Return the settings of a run with the choice in place of algo.compile=auto.

    It is written to the config, too, so that it holds where the run is resumed.
    """
    from trainers.algorithms.settings import ReplayConfig
    from trainers.config import PixelsConfig

    algo = training.algo
    if not isinstance(algo, ReplayConfig) or isinstance(training.policy, PixelsConfig):
        return training
    choice = algo.choose_compilation(training.run.total_frames, training.run.device)
    if choice == algo.compile:
        return training
    config.algo.compile = choice
    return replace(training, algo=replace(algo, compile=choice))


def saved_config(config: Any) -> dict[str, Any]:
    """Return a composed config as a checkpoint holds it: plain, and without the places that the run began with."""
    from omegaconf import OmegaConf

    plain = cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))
    return plain | {"resume": None, "init": None}


def resumed(path: str, overrides: list[str]) -> tuple[Any, Path | None]:
    """Load the config of a run to resume, and find its folder; None for a file in no run's checkpoints/.

    Args:
        path: the run's directory or checkpoint.
        overrides: applied on top of the run's config.

    Raises:
        ConfigError: there is no checkpoint, an override does not apply to it, or it has more frames than are wanted.
    """
    from trainers.run.checkpoint import find, load

    file = find(Path(path), key="resume")
    overrides = [word for word in overrides if not word.startswith("resume=")]
    payload = load(file, to_train=True, given=overrides)
    config, frames = apply(payload["config"], overrides), payload["counters"]["frames"]
    if config.seed != (seed := payload["config"]["seed"]):
        raise ConfigError(f"seed={config.seed}: resume={path} was trained with seed={seed}, and keeps it")
    if config.total_frames < frames:
        raise ConfigError(
            f"total_frames={config.total_frames} is less than the {frames} frames of resume={path}; give more"
        )
    if file != Path(path) and file.name == "best.pt":
        print(f"{path} has no last.pt: its best.pt of {frames} frames goes on, with new episodes", flush=True)
    config.resume = escaped(path)
    return config, file.parent.parent if file.parent.name == "checkpoints" else None


def check_same_folder(own: Path, wished: Path, resume: str, words: Sequence[str]) -> None:
    """Check that the command line names no other folder for a run that is resumed.

    Args:
        own: folder of that run.
        wished: Hydra's folder.
        resume: the run as it was given.
        words: Hydra's overrides.

    Raises:
        ConfigError: hydra.run.dir names another folder.
    """
    named = OWN_FOLDER["run"] is not None or any(word.startswith("hydra.run.dir=") for word in words)
    if named and wished.resolve() != own.resolve():
        raise ConfigError(f"hydra.run.dir={wished}: resume={resume} goes on in {own}; leave out hydra.run.dir")


@contextmanager
def said_when_interrupted() -> Iterator[None]:
    """Within this block, Ctrl-C before the training loop, which handles signals itself, says that nothing is saved."""
    try:
        yield
    except KeyboardInterrupt:
        print("stopped before training began: nothing is saved", flush=True)
        raise


def supervised(config: Any, folder: Path, words: Sequence[str]) -> None:
    """Train on a Ray cluster in a process of its own. Exits with its code if that is not 0. Raises RunError.

    Args:
        config: composed.
        folder: of the run.
        words: overrides of the command line.
    """
    from trainers.config import read_training

    command = RunWords([word for word in words if not word.startswith("hydra")], folder)
    code = supervise(Path(__file__), command, read_training(config).collector.restarts)
    if code:
        raise SystemExit(code)


@hydra.main(version_base="1.3", config_path="pkg://conf", config_name="config")
def main(config: Any) -> dict[str, Any] | None:
    """Run with the config that Hydra composed, in the folder that Hydra chose; in a sweep, run one of its jobs."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    job = HydraConfig.get()
    hydra_folder = folder = OWN_FOLDER["run"] or Path(job.runtime.output_dir)
    if job.mode == RunMode.MULTIRUN:
        from trainers.sweeps.job import run_job

        run_job(Path(__file__), config, list(job.overrides.task), folder, job.runtime.choices["hydra/launcher"])
        return None
    try:
        with program(), said_when_interrupted():  # here: Hydra would add lines of its own
            if config.resume:
                place, words = config.resume, [from_hydra(word) for word in job.overrides.task]
                config, own_folder = resumed(place, words)
                folder = own_folder or hydra_folder
                check_same_folder(folder, hydra_folder, place, list(job.overrides.hydra))
            else:
                config = with_choices(config, job.runtime.choices)
            if config.collector.name == "ray" and not is_supervised():
                supervised(config, folder, [from_hydra(word) for word in job.overrides.task])
                return None
            with ray_errors():
                return run(config, folder)
    finally:
        report_end()
        if hydra_folder.is_dir() and not any(hydra_folder.iterdir()):
            hydra_folder.rmdir()  # not used by a refused or a resumed run


def summary(result: dict[str, Any], folder: Path) -> str:
    """Return the result and its folder in one line."""
    from trainers.sweeps.runs import share_cell

    low, high = result["ci95"]
    return (
        f"success_at_end {result['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f}, {result['episodes']} episodes), "
        f"wrong object {result['wrong_object']:.3f}, disturbed {share_cell(result['disturbed'])}, "
        f"{result['frames']} frames in {result['wall_s']:.0f} s: {folder}"
    )


def cli(words: Sequence[str] | None = None) -> None:
    """Check the overrides, then start Hydra. Exits with one line for bad input.

    Args:
        words: command-line words; by default those of this process.
    """
    with program():
        require_threads(2 * cores())
        register_resolvers()
        given = take_config_dir(sys.argv[1:] if words is None else words)
        words = expand_resume(given)
        check_run(words)
        words, OWN_FOLDER["run"] = split_run_folder(words)
        sys.argv[1:] = [*quoted(words), *search_words()]  # Hydra reads them there
        if "hydra/launcher=ray" in words:
            run_apart(_start_hydra, Path(__file__), given, SWEEP_ENDED)
        else:
            _start_hydra()


def _start_hydra() -> None:
    with raised_by_hydra():
        main()


if __name__ == "__main__":
    cli()

"""Record demonstrations as datasets of other libraries: `python record.py checkpoint=<run dir or file> format=lerobot`.

    checkpoint=...    a run directory, a checkpoint file, or a pretrained policy by name
    episodes=100      number of fresh episodes, with the deterministic policy
    format=lerobot    or minari; both need pip install -e ".[record]"
    expert=false      true: the task's scripted expert acts, in the checkpoint's environment; without a checkpoint, in
                      the environment of the other words (task=nl_push robot=panda)
    cameras=[]        [front,side,wrist]: with pictures of these cameras of workspace.cameras at each control step
    seed=0            of the episodes; neither training nor evaluation uses the same ones
    collector=local   ray: on a Ray cluster, with the same result: docs/cluster.md
    out=<dir>         directory of the dataset; default: a numbered one in outputs/
    task.num_objects=6 ...   any key of the config, to record under other conditions than in training

    replay=<dir>      instead: replay the episodes of a dataset and compare everything that was recorded
    tolerance=0       the greatest difference allowed in any number; 0: bit for bit

docs/recording.md describes the datasets and how other libraries load them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.command_line import check_folder, split
from core.errors import ConfigError
from core.machine_limits import require_docstrings, require_threads
from core.overrides import apply, check, compose
from core.program import run_program
from core.schema import Checked, any_path, one_of, read, within, word
from core.system import cores

if TYPE_CHECKING:
    from core.system import StopSignal
    from envs.config import EnvConfig
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.demonstrations import Demonstration

BLOCK = 25  # episodes of a task on a cluster


@dataclass(frozen=True, kw_only=True)
class RecordConfig(Checked):
    """The program's own keys; see the top of this file."""

    checkpoint: str | None = any_path()
    episodes: int = within(1, 10_000_000)
    format: str = one_of("lerobot", "minari")
    expert: bool
    cameras: list[str] = word()
    seed: int = within(0, 2**31 - 1)
    collector: str = one_of("local", "ray")
    out: str | None = any_path()
    replay: str | None = any_path()
    tolerance: float = within(0.0, 1e9)


DEFAULTS: dict[str, Any] = {
    "checkpoint": None,
    "episodes": 100,
    "format": "lerobot",
    "expert": False,
    "cameras": [],
    "seed": 0,
    "collector": "local",
    "out": None,
    "replay": None,
    "tolerance": 0.0,
}


def parse(arguments: list[str]) -> tuple[RecordConfig, list[str]]:
    """Read the program's own keys, and return the remaining words: overrides of the config. Raises ConfigError."""
    names = [field.name for field in fields(RecordConfig)]
    own, overrides = split(arguments, names, "checkpoint=<run dir>")
    given: dict[str, Any] = DEFAULTS | own
    if "cameras" in own:
        given["cameras"] = [name.strip() for name in own["cameras"].strip("[] ").split(",") if name.strip()]
    config = read(RecordConfig, given, "")
    others = [word for word in arguments if not word.startswith(("replay=", "tolerance="))]
    if config.replay and others:
        raise ConfigError(f"{others[0]}: replay=<dir> takes no other key than tolerance; the recording holds the rest")
    if not (config.replay or config.checkpoint or config.expert):
        raise ConfigError("checkpoint=<run dir or file> is missing; or give expert=true, or replay=<dir>")
    return config, overrides


def main(arguments: list[str]) -> None:
    """Record or replay episodes, and print the result. Raises ConfigError."""
    require_docstrings()
    require_threads(2 * cores())
    config, overrides = parse(arguments)
    if config.replay:
        _replay(Path(config.replay), config.tolerance)
    else:
        _record(config, overrides)


def _record(config: RecordConfig, overrides: list[str]) -> None:
    """Record episodes. Raises ConfigError; SystemExit with 128 + signal after SIGINT and SIGTERM."""
    from core.errors import Interrupted
    from core.system import StopSignal, import_optional
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.dataset import write
    from trainers.datasets.minari_dataset import check_minari_name
    from trainers.utils.files import refuse_existing

    import_optional(*{"lerobot": ["pyarrow"], "minari": ["minari", "h5py"]}[config.format])
    saved, whole = _load_config(config, overrides)
    env_config = _eval_config(whole)
    cameras = env_config.workspace.named_cameras("cameras", config.cameras)
    place = Path(config.out) if config.out else _numbered(env_config, config)
    if config.format == "minari":
        check_minari_name(place)
    refuse_existing(place)
    check_folder("out", str(place))
    with closing(WorkspaceEnv(env_config, num_worlds=1, seed=0, render=bool(cameras))) as env, StopSignal() as stop:
        about = _about(env, config, whole.get("choices", {}))
        recorded = _episodes(env, config, saved, whole, stop)
        try:
            metadata = write(
                place=place,
                kind=config.format,
                env=env,
                recorded=recorded,
                episodes=config.episodes,
                seed=config.seed,
                about=about,
                cameras=cameras,
                stop=stop,
            )
        except Interrupted:
            raise SystemExit(128 + stop.signal) from None
    low, high = metadata["ci95"]
    counts = f"{metadata['episodes']} episodes, {metadata['steps']} steps"
    print(f"{counts}, success_at_end {metadata['success_at_end']:.3f} (95 %: {low:.3f}-{high:.3f}): {place}")


def _episodes(
    env: WorkspaceEnv, config: RecordConfig, saved: dict[str, Any] | None, whole: Any, stop: StopSignal
) -> Iterator[Demonstration]:
    """Record the episodes here or on a cluster. Raises ConfigError if the actor does not fit, and Interrupted."""
    from trainers.datasets.demonstrations import demonstrate

    actor = _actor(env, config, saved, whole)
    if config.collector == "local":
        return demonstrate(env, actor, config.episodes, config.seed, config.cameras)
    from trainers.cluster.ray_map import map_on_cluster

    blocks = range(0, config.episodes, BLOCK)
    parts = map_on_cluster(partial(_record_block, config, saved, whole), blocks, "recording", stop=stop)
    return chain.from_iterable(parts)


def _record_block(config: RecordConfig, saved: dict[str, Any] | None, whole: Any, first: int) -> list[Demonstration]:
    """Record the episodes from number `first` on, at most BLOCK of them, on any machine."""
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.demonstrations import demonstrate

    count = min(BLOCK, config.episodes - first)
    cameras = config.cameras
    with closing(WorkspaceEnv(_eval_config(whole), num_worlds=1, seed=0, render=bool(cameras))) as env:
        actor = _actor(env, config, saved, whole)
        return list(demonstrate(env, actor, count, config.seed, cameras, first))


def _load_config(config: RecordConfig, overrides: list[str]) -> tuple[dict[str, Any] | None, Any]:
    """Load the checkpoint's payload, None without one, and compose the config. Raises ConfigError."""
    if config.checkpoint is None:
        check(overrides)
        return None, compose(overrides)
    from trainers.run import checkpoint

    saved = checkpoint.load(checkpoint.find(Path(config.checkpoint)), given=overrides)
    return saved, apply(saved["config"], overrides)


def _eval_config(config: Any) -> EnvConfig:
    """Read the environment's config for evaluation."""
    from envs.config import read_env

    return read_env(config).without_curriculum()


def _actor(env: WorkspaceEnv, config: RecordConfig, saved: dict[str, Any] | None, whole: Any) -> Any:
    """Build the actor: the checkpoint's policy, or the task's expert. Raises ConfigError if it does not fit."""
    if config.expert or saved is None:
        from envs.experts import expert

        return expert(env)
    from trainers.run.checkpoint import fitted_policy

    return fitted_policy(saved, whole, env).act


def _about(env: WorkspaceEnv, config: RecordConfig, choices: Mapping[str, str]) -> dict[str, Any]:
    """Return the facts about the environment that the formats and the metadata need."""
    from envs.config import dataset_facts

    env_config = env.config
    return {
        **dataset_facts(env_config, env.task.traits.grips),
        "actor": "expert" if config.expert else f"policy of {config.checkpoint}",
        "instruction": f"{env_config.task.name} with {env_config.robot.name}, {env_config.control.name}",
        "gym": _gym_spec(env_config, choices),
    }


def _gym_spec(config: EnvConfig, choices: Mapping[str, str]) -> Any:
    """Return the spec with which Gymnasium makes the environment; None if no overrides compose its config.

    Args:
        config: of the environment.
        choices: the option of each config group that it was composed from; empty if an earlier version trained it.
    """
    from gymnasium.envs.registration import EnvSpec

    from envs.config import read_env
    from envs.registration import ENTRY_POINT, VECTOR_ENTRY_POINT, gym_id
    from trainers.sweeps.runs import overrides_of

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
    name = gym_id(choices["task"])
    return EnvSpec(name, entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=kwargs)


def _numbered(env_config: EnvConfig, config: RecordConfig) -> Path:
    """Return a directory in outputs/ that does not exist yet, with a version number as Minari has them."""
    name = f"{env_config.task.name}-{env_config.robot.name}-{'expert' if config.expert else 'policy'}-{config.format}"
    places = (Path("outputs") / f"{name}-v{i}" for i in range(10_000))
    return next(place for place in places if not place.exists())


def _replay(folder: Path, tolerance: float) -> None:
    """Replay a recording. Raises ConfigError if an episode differs from it by more than the tolerance."""
    from envs.workspace_env import WorkspaceEnv
    from trainers.datasets.dataset import read
    from trainers.datasets.demonstrations import verify_replay

    try:
        metadata, episodes = read(folder)
    except ConfigError as error:
        raise ConfigError(f"replay={error}") from None
    with closing(WorkspaceEnv(_eval_config(metadata["config"]), num_worlds=1, seed=0)) as env:
        result = verify_replay(env, episodes)
    if result.max_difference > tolerance or not result.episodes:
        raise ConfigError(
            f"{folder}: {result.differing} of {result.episodes} episodes differ from their recording; the most "
            f"in {result.key} of episode {result.episode}, by {result.max_difference:g} with tolerance={tolerance:g}"
        )
    match = "bit for bit" if result.max_difference == 0 else f"within {result.max_difference:g}"
    print(f"{result.episodes} episodes, {result.steps} steps: all states as recorded, {match}")


def cli(words: Sequence[str] | None = None) -> None:
    """Run `main` with `words`, by default those of this process. Exits with one line for bad input."""
    run_program(_main, __file__, words)


def _main(arguments: list[str]) -> None:
    if "collector=ray" not in arguments:
        main(arguments)
        return
    from trainers.cluster.supervised_run import run_apart

    run_apart(partial(main, arguments), Path(__file__), arguments, "recording: nothing is saved; start it again")


if __name__ == "__main__":
    cli()

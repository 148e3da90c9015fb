"""The base of all algorithms, and what they share: the grounding loss, checks of numbers, and gradient steps."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from typing import Any

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.data import Composite, LazyTensorStorage, ReplayBuffer, TensorDictReplayBuffer

from core.errors import ConfigError, RunError
from core.platform_tuning import fast_products
from trainers.algorithms.settings import AlgorithmConfig, ReplayConfig, import_class
from trainers.config import TrainingConfig
from trainers.environment import DEFAULT_READERS, Readers, Relabel
from trainers.models.critics import CriticBuilder
from trainers.models.grounding import grounding_loss
from trainers.models.policy import ExpertMixture, MoveBounds, Policy, build_policy

GROUNDING_METRICS = ("loss/grounding", "grounding/accuracy")
LEAST_SHARE = 1 / 8  # least share of gradient steps with scenes, however small the error
OTHERS = ("privileged", "reward", "reward_terms")  # keys of a step that are no observation
SMOOTHING = 0.5  # weight of the latest batch in the error

Part = Callable[[], dict[str, Tensor]]  # a part of a gradient step: adds gradients, and returns the measured values


def build_algorithm(
    training: TrainingConfig,
    observation_spec: Composite,
    action_unit: Sequence[float],
    vocabulary: Sequence[str] = (),
    relabel: Relabel | None = None,
    readers: Readers = DEFAULT_READERS,
) -> tuple[Policy, Algorithm]:
    """Return networks on run.device and the algorithm that trains them.

    Args:
        training: of the run.
        observation_spec: of the environment.
        action_unit: of the environment.
        vocabulary: the tokenizer's words, which only policy.encoder=sentence reads.
        relabel: the environment's `hindsight`, which only off-policy algorithms use.
        readers: which network reads which observation.
    """
    device = find_device(training.run.device)
    bounds = MoveBounds(squash=training.algo.squashes, clip=training.algo.clips)
    policy = build_policy(training.policy, observation_spec, action_unit, bounds, vocabulary, readers).to(device)
    critics = CriticBuilder(training.policy, policy, observation_spec, device, readers)
    path = training.algo.for_pictures if policy.sees else training.algo.algorithm
    assert path is not None  # `read_training` refuses it
    cls: type[Algorithm] = import_class(path)
    return policy, cls.build(training.algo, policy, critics, relabel)


def find_device(name: str) -> torch.device:
    """Return the torch device of run.device. Raises ConfigError if it is not available."""
    try:
        device = torch.device(name)
        torch.ones(1, device=device).item()
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        if reason.startswith("Expected one of"):  # and all kinds of devices that torch could be built for
            reason = "torch knows no such device"
        raise ConfigError(f"device={name} cannot be used: {reason}; choose cpu, or cuda where there is a GPU") from None
    return device


class Algorithm(ABC):
    """A learner: `update` is given each batch that the workers collect.

    Attributes:
        metrics: names that `update` may return.
        saved: names of the attributes that a checkpoint keeps, each with a `state_dict`.
    """

    metrics: tuple[str, ...]
    saved: tuple[str, ...] = ("policy", "optimizer")
    optimizer: torch.optim.Optimizer

    def __init__(self, config: AlgorithmConfig, policy: Policy) -> None:
        self.policy = policy
        self.rates, self.anneals = (config.lr, config.grounding_lr), config.anneal_lr
        self.device = next(policy.parameters()).device
        self.grounding = GroundingSupervision(config, policy, self.device)

    @classmethod
    @abstractmethod
    def build(cls, config: Any, policy: Policy, critics: CriticBuilder, relabel: Relabel | None) -> Algorithm:
        """Return the algorithm that trains this policy, with critics of its own.

        Args:
            config: of the class that was registered for this algorithm.
            policy: on the device of the updates.
            critics: builds its critics.
            relabel: the environment's `hindsight`; None: no relabelling.
        """

    @property
    def behaviour(self) -> Policy | ExpertMixture:
        """The module that acts in the worlds during collection."""
        return self.policy

    @property
    def scenes_per_update(self) -> int:
        """How many unsimulated scenes `add_scenes` takes before each update."""
        return self.grounding.scenes_per_update

    def add_scenes(self, scenes: TensorDictBase) -> None:
        """Take unsimulated scenes (count,) of the environment's `draw_scenes` for the grounding loss."""
        self.grounding.add(scenes)

    @abstractmethod
    def update(self, batch: TensorDictBase, progress: float) -> dict[str, float]:
        """Learn from a batch (worlds, steps).

        Args:
            batch: frames, each with its "next"; every call has the same worlds, and continues their steps.
            progress: share of the run that is over, in [0, 1].

        Returns:
            The measured values, by the names in `metrics`.

        Raises:
            DivergedError: a number is not finite.
        """

    def make_optimizer(self, learned: Sequence[Tensor], **options: Any) -> torch.optim.Adam:
        """Return Adam over these parameters.

        Those that only the grounding loss trains are a group with its own learning rate.

        options: of Adam.
        """
        words = set(self.policy.encoder.parameters()) if self.grounding.active else set()
        groups = [p for p in learned if p not in words], [p for p in learned if p in words]
        rated = [{"params": group, "lr": rate} for group, rate in zip(groups, self.rates, strict=True) if group]
        return torch.optim.Adam(rated, fused=True, **options)

    def anneal_learning_rates(self, progress: float) -> float:
        """Set the learning rates for this progress in [0, 1] of a run, and return that of actor and critics."""
        left = 1 - progress if self.anneals else 1.0
        for group, rate in zip(self.optimizer.param_groups, self.rates, strict=False):  # one group without words
            group["lr"] = rate * left
        return self.rates[0] * left

    def state_dict(self) -> dict[str, Any]:
        """Return networks and optimizers, without replayed frames."""
        return {name: getattr(self, name).state_dict() for name in self.saved}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`. Raises KeyError, RuntimeError or ValueError where the networks differ."""
        for name in self.saved:
            getattr(self, name).load_state_dict(state[name])

    @property
    def memories(self) -> dict[str, ReplayBuffer]:
        """The ring buffers that updates learn from, by name. A checkpoint keeps their rows in files beside it."""
        return {"scenes": self.grounding.scenes} if self.grounding.active else {}

    def running_state(self) -> dict[str, Any]:
        """Return the rest of the state on which later updates depend: plain values and tensors."""
        return {}

    def load_running_state(self, state: dict[str, Any]) -> None:  # noqa: B027
        """Continue from `running_state`, with the same worlds."""


class ReplayAlgorithm(Algorithm):
    """Takes `updates_per_frame` gradient steps for each collected frame, on frames that it has kept.

    Attributes:
        compiles: whether losses and gradients are compiled.
        pending_steps: gradient steps that are due for the frames so far, and not taken yet.
    """

    def __init__(self, config: ReplayConfig, policy: Policy) -> None:
        super().__init__(config, policy)
        self.config = config
        self.compiles = config.compile == "on"
        self.pending_steps = 0.0

    @property
    def learned(self) -> list[Tensor]:
        """The parameters of the optimizer."""
        return [parameter for group in self.optimizer.param_groups for parameter in group["params"]]

    def due_steps(self, frames: int) -> int:
        """Return how many gradient steps are due after so many further frames; they are to be taken now."""
        self.pending_steps += frames * self.config.updates_per_frame
        steps, self.pending_steps = int(self.pending_steps), self.pending_steps % 1.0
        return steps

    def learn(self, steps: int) -> list[dict[str, Tensor]]:
        """Take gradient steps. Frames and scenes are drawn once for all of them, which saves overhead."""
        if not steps:
            return []
        with fast_products(self.config.batch * max(each.numel() for each in self.learned)):
            frames = self.sample(steps).split(self.config.batch)
            pairs = self.grounding.paired(frames, steps, 1 / self.config.grounding_every)
            return [self.step(part, scenes) for part, scenes in pairs]

    @abstractmethod
    def sample(self, steps: int) -> TensorDictBase:
        """Return the frames of `steps` batches in a row."""

    @abstractmethod
    def step(self, frames: TensorDictBase, scenes: TensorDictBase | None = None) -> dict[str, Tensor]:
        """Take one gradient step on frames (B,) and, where the words are supervised, on scenes (G,).

        Return the measured scalars.
        """


class DivergedError(RunError):
    """A loss, reward or observation is not finite. batch: the frames in which it was found."""

    def __init__(self, message: str, batch: TensorDictBase) -> None:
        super().__init__(message)
        self.batch = batch


class GroundingSupervision:
    """Keeps scenes and computes the grounding loss on samples of them.

    A batch of PPO holds a hundred or two scenes, each at many steps. Relations learned from the latest batch alone
    reached 92 % of fresh sentences; learned from all scenes of the run they reach more than 99 %.

    Attributes:
        active: False if the weight is 0 or the policy has no attention; then the words are learned from reward alone.
        gain: the share of gradient steps with scenes, divided by the error; None: all steps have scenes.
        error: running mean of the attention's error rate on fresh scenes; 1 before the first batch.
    """

    def __init__(self, config: AlgorithmConfig, policy: Policy, device: torch.device) -> None:
        self.config, self.policy = config, policy
        self.active = config.grounding_weight > 0 and policy.attends
        self.keys = [*policy.encoder_keys, *policy.label_keys]
        self.scenes = TensorDictReplayBuffer(storage=LazyTensorStorage(config.grounding_memory, device=device))
        self.gain: float | None = None
        self.error = 1.0

    @property
    def share(self) -> float:
        """The share of gradient steps with scenes: in proportion to the error, between LEAST_SHARE and 1."""
        return 1.0 if self.gain is None else min(1.0, max(LEAST_SHARE, self.gain * self.error))

    @property
    def scenes_per_update(self) -> int:
        """How many unsimulated scenes are added before each update."""
        return math.ceil(self.share * self.config.grounding_scenes) if self.active else 0

    def add(self, scenes: TensorDictBase) -> None:
        """Keep scenes (count,). Those that are simulated may have fewer slots than those that were drawn first."""
        slots = self.scenes[:1]["objects"].shape[1] if len(self.scenes) else 0
        self.scenes.extend(with_slots(scenes, slots))

    def sample(self, count: int = 1) -> Sequence[TensorDictBase]:
        """Return `count` batches of scenes (grounding_batch,), drawn evenly with replacement in one draw."""
        return self.scenes.sample(count * self.config.grounding_batch).split(self.config.grounding_batch)

    def paired(
        self, parts: Iterable[TensorDictBase], count: int, share: float
    ) -> Iterator[tuple[TensorDictBase, TensorDictBase | None]]:
        """Generate each of the parts with the scenes of its gradient step, or None for a step without scenes.

        A pass over scenes costs more than one over frames, and fewer passes suffice. All scenes are drawn at once.

        Args:
            parts: of the frames, `count` in all.
            count: number of parts.
            share: of the parts that have scenes; these are evenly spaced. No part has any where the words are not
                supervised.
        """
        chosen = math.ceil(count * share) if self.active else 0
        drawn = self.sample(chosen) if chosen else ()
        scenes = {i * count // chosen: each for i, each in enumerate(drawn)}
        for i, part in enumerate(parts):
            yield part, scenes.get(i)

    def measure_fresh(self, scenes: TensorDictBase) -> float:
        """Return the accuracy on scenes (count,) that no step has learned from yet. Updates `error`."""
        accuracy = float(self.measure(scenes)["grounding/accuracy"])
        self.error += SMOOTHING * (1 - accuracy - self.error)
        return accuracy

    def measure(self, scenes: TensorDictBase) -> dict[str, Tensor]:
        """Return the loss, unweighted, and the accuracy on scenes (count,), under the names of GROUNDING_METRICS."""
        return dict(zip(GROUNDING_METRICS, grounding_loss(self.policy.encode(scenes)), strict=True))


def with_slots(scenes: TensorDictBase, slots: int) -> TensorDictBase:
    """Return the scenes (count,) with at least this number of slots: added ones show no object."""
    missing = slots - scenes["objects"].shape[1]
    if missing <= 0:
        return scenes
    padded = {key: F.pad(value, (0, 0, 0, missing)) for key, value in scenes.items() if value.dim() == 3}
    padded["objects_mask"] = F.pad(scenes["objects_mask"], (0, missing))
    return scenes.copy().update(padded)


def first_steps(batch: TensorDictBase, starts: Tensor) -> Tensor:
    """Return whether each frame is the first one of its episode, (worlds, steps) bool.

    starts: (worlds, 1) of the first step.
    """
    return torch.cat([starts, batch["next", "done"][:, :-1, 0]], 1)


class ExplorationSchedule:
    """Lowers the upper bound of a policy's exploration noise linearly to `final_std`.

    A behaviour that only noise produces, such as opening the gripper, has to become part of the mean.
    """

    def __init__(self, policy: Policy, final_std: float) -> None:
        self.policy, self.final_std = policy, final_std
        self.first_std = math.exp(max(log_std.max().item() for log_std in policy.log_stds))

    @torch.no_grad()
    def step(self, progress: float) -> None:
        """Apply the bound for this progress in [0, 1] of a run."""
        bound = self.first_std * (1 - progress) + self.final_std * progress
        for log_std in self.policy.log_stds:
            log_std.clamp_(max=math.log(bound))


def check_batch(batch: TensorDictBase) -> None:
    """Raise DivergedError if an observation, reward or action is not finite. The message names it."""
    after = batch["next"]
    floats = [key for key in after.keys() if key not in OTHERS and after[key].is_floating_point()]
    before = [key for key in (*floats, "action") if key in batch.keys()]
    for key in (*before, *(("next", key) for key in floats), ("next", "reward")):
        if not torch.isfinite(batch[key].sum()) and not batch[key].isfinite().all():
            name = key if isinstance(key, str) else "/".join(key)
            raise DivergedError(f"{name} is not finite in a collected batch", batch)


def descend(
    optimizer: torch.optim.Optimizer,
    loss: Tensor,
    batch: TensorDictBase,
    max_norm: float,
    *clipped: Iterable[Tensor],
) -> None:
    """Take one gradient step.

    Args:
        optimizer: of the parameters.
        loss: a scalar.
        batch: the frames on which the loss was computed.
        max_norm: greatest norm of the gradient of each group in `clipped`.
        clipped: groups of parameters.

    Raises:
        DivergedError: the loss is not finite; no parameter has changed.
    """
    check_loss(loss, batch)
    optimizer.zero_grad()
    loss.backward()
    apply_gradients(optimizer, max_norm, *clipped)


def check_loss(loss: Tensor, batch: TensorDictBase) -> None:
    """Raise DivergedError if a loss, a scalar that was computed on the batch, is not finite."""
    if not torch.isfinite(loss):
        raise DivergedError(f"the loss became {loss.item()}", batch)


def backward(measured: dict[str, Tensor], parameters: Sequence[Tensor], weight: float = 1.0) -> dict[str, Tensor]:
    """Add the gradients of the sum of the losses, times a weight, to these parameters alone.

    Returns:
        The measured values, detached.
    """
    (weight * total_loss(measured)).backward(inputs=list(parameters))
    return {name: value.detach() for name, value in measured.items()}


def apply_gradients(optimizer: torch.optim.Optimizer, max_norm: float, *clipped: Iterable[Tensor]) -> None:
    """Clip the norm of each group of gradients to `max_norm`, and take a step."""
    for group in clipped:
        nn.utils.clip_grad_norm_(group, max_norm)
    optimizer.step()


@torch.no_grad()
def adam_step(optimizer: torch.optim.Optimizer, parameters: Iterable[Tensor]) -> None:
    """Do the step of Adam for some of its parameters, on the CPU: the same numbers, with less Python around them."""
    chosen = {parameter for parameter in parameters if parameter.grad is not None}
    for group in optimizer.param_groups:
        learned = [parameter for parameter in group["params"] if parameter in chosen]
        states = [optimizer.state[parameter] for parameter in learned]
        for parameter, state in zip(learned, states, strict=True):
            if not state:
                state["step"] = torch.zeros(())
                state["exp_avg"], state["exp_avg_sq"] = torch.zeros_like(parameter), torch.zeros_like(parameter)
        steps, means, squares = ([state[name] for state in states] for name in ("step", "exp_avg", "exp_avg_sq"))
        if learned:
            gradients = [parameter.grad for parameter in learned]
            options = {name: group[name] for name in ("lr", "weight_decay", "eps", "amsgrad", "maximize")}
            beta1, beta2 = group["betas"]
            torch._foreach_add_(steps, 1)
            torch._fused_adam_(learned, gradients, means, squares, [], steps, beta1=beta1, beta2=beta2, **options)


def total_loss(measured: dict[str, Tensor]) -> Tensor:
    """Return the sum of the scalars that are named loss/..."""
    return torch.stack([value for name, value in measured.items() if name.startswith("loss/")]).sum()


def averages(rows: list[dict[str, Tensor]]) -> dict[str, float]:
    """Return the mean of each measured name over those gradient steps of an update that measured it."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: torch.stack([row[name] for row in rows if name in row]).mean().item() for name in names}


def run_parts(parts: Sequence[Part]) -> dict[str, Tensor]:
    """Run the parts, and return their measured values together.

    They run at the same time if torch may use several threads, each on one thread; otherwise one after another. So
    they must not depend on each other, and at most one of them may draw random numbers. A single part has all threads.

    Args:
        parts: the longest first.
    """
    threads = torch.get_num_threads()
    if threads == 1 or len(parts) == 1:
        results = [part() for part in parts]
    else:
        with one_thread():
            running = [_pool(threads).submit(part) for part in parts[1:]]
            try:
                results = [parts[0]()]
            finally:
                wait(running)  # all of them, even if one raises: none is left running
        results += [each.result() for each in running]
    return {name: value for result in results for name, value in result.items()}


@contextmanager
def one_thread() -> Iterator[None]:
    """Within this block torch uses one thread: more would wait for each other longer than small operations take."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Return a pool of threads that use one core each: the number is a setting of each thread."""
    return ThreadPoolExecutor(threads, "gradients", initializer=torch.set_num_threads, initargs=(1,))

"""The policy: an encoder of words and scene, an actor, and the module that acts with both.

instruction, scene ─► encoder ─► context ─┐
robot, further observations ──────────────┴─► actor ─► move ─► action
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import NamedTuple

import torch
from tensordict import NestedKey, TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase
from torch import Tensor, nn
from torchrl.data import Composite
from torchrl.envs.utils import ExplorationType, exploration_type
from torchrl.modules import IndependentNormal, ProbabilisticActor, TanhNormal

from core.errors import ConfigError
from trainers.config import GroundedConfig, PixelsConfig, PolicyConfig
from trainers.environment import DEFAULT_READERS, Readers, keys_read
from trainers.models.grounding import GESTURE, LABELS, NEAR, OBSTACLE, SCENE_KEYS, TARGET, VERB, GroundingEncoder
from trainers.models.networks import (
    GaussianActor,
    Normalise,
    SeveralActors,
    StagedActor,
    VerbActor,
    normal_log_prob,
)
from trainers.models.pixels import PIXELS, PictureEncoder
from trainers.models.sentence_encoder import SentenceWords

STAGE = "stage"
LABEL = ("privileged", "expert_action")
MEANS = (ExplorationType.DETERMINISTIC, ExplorationType.MODE, ExplorationType.MEAN)


class MoveBounds(NamedTuple):
    """How the actor's normal distribution is kept within [-1, 1].

    squash: a move is the tanh of a normal sample (SAC). clip: a move is a normal sample clipped to [-1, 1] (TD3).
    Neither: a move is a normal sample, and only the action is clipped (PPO).
    """

    squash: bool = False
    clip: bool = False


UNBOUNDED = MoveBounds()


class Policy(nn.Module):
    """An encoder of the words and an actor.

    A move of 1 is as far as the arm gets in one control step: the action is hold + action_unit * move, so one network
    and one exploration noise fit every control mode.

    Args:
        encoder: reads the words and the scene; the last of its outputs is the context.
        actor: reads robot, context, the nearest obstacle where the task has obstacles, further observations, and the
            stage where it is made of several networks; returns loc and scale of a move.
        action_unit: (A,), of the environment.
        bounds: how moves are bounded.
        further_keys: the further observations that the actor reads.
    """

    action_unit: Tensor

    def __init__(
        self,
        encoder: GroundingEncoder | FlatEncoder | PictureEncoder,
        actor: GaussianActor | SeveralActors,
        action_unit: Sequence[float],
        *,
        bounds: MoveBounds = UNBOUNDED,
        further_keys: Sequence[NestedKey] = (),
    ) -> None:
        super().__init__()
        self.register_buffer("action_unit", torch.as_tensor(action_unit, dtype=torch.float32))
        self.encoder, self.actor, self.bounds = encoder, actor, bounds
        self.context_key: str = encoder.out_keys[-1]
        obstacle, stage = (OBSTACLE,) * encoder.observes_obstacles, (STAGE,) * isinstance(actor, StagedActor)
        self.further_keys = tuple(further_keys)
        self.actor_keys: tuple[NestedKey, ...] = ("robot", *obstacle, *self.further_keys, *stage)

    @property
    def attends(self) -> bool:
        """Whether the encoder chooses among object slots, so that the choice can be supervised."""
        return bool(self.encoder.logit_keys)

    @property
    def sees(self) -> bool:
        """Whether the encoder reads pictures."""
        return PIXELS in self.encoder.scene_keys

    @property
    def label_keys(self) -> tuple[tuple[str, str], ...]:
        """The keys of the slots that it should choose."""
        return tuple(LABELS[key] for key in self.encoder.logit_keys)

    @property
    def encoder_keys(self) -> tuple[NestedKey, ...]:
        """The keys of an observation that the encoder reads: the instruction first."""
        return ("instruction", *self.encoder.scene_keys)

    @property
    def act(self) -> PolicyAct:
        """The module from an observation to "action". It shares the parameters and reads nothing privileged."""
        return PolicyAct(self)

    @property
    def log_stds(self) -> list[nn.Parameter]:
        """The logarithms of the exploration noise, (A,) for each network of the actor."""
        return self.actor.log_stds if isinstance(self.actor, SeveralActors) else [self.actor.log_std]

    def move_parameters(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Return the loc and scale (N, A) of a move, given encoded frames (N,)."""
        robot, *more = (frames[key] for key in self.actor_keys)
        return self.actor(robot, frames[self.context_key], *more)

    def sample_move(self, loc: Tensor, scale: Tensor, noise: Tensor) -> Tensor:
        """Return the move (N, A) of standard normal noise (N, A)."""
        move = loc + scale * noise
        if self.bounds.squash:
            return move.tanh()
        return move.clamp(-1.0, 1.0) if self.bounds.clip else move

    def encode(self, frames: TensorDictBase, traced: bool = False) -> TensorDictBase:
        """Write the encoder's outputs (N, ...) to frames (N,), and return them.

        traced: take the same operations whatever the words are.
        """
        words = self._words(frames, traced)
        return self._write(frames, self.encoder.attend(words, *(frames[key] for key in self.encoder.scene_keys)))

    def encode_transition(self, before: TensorDictBase, after: TensorDictBase, traced: bool = False) -> None:
        """`encode` both ends of a step, the later one without gradients.

        The words are the same at both, so they are encoded once: half the cost of two calls.

        traced: take the same operations whatever the words are.
        """
        words = self._words(before, traced)
        self._write(before, self.encoder.attend(words, *(before[key] for key in self.encoder.scene_keys)))
        with torch.no_grad():
            self._write(after, self.encoder.attend(words, *(after[key] for key in self.encoder.scene_keys)))

    def _words(self, frames: TensorDictBase, traced: bool) -> Tensor:
        encode = self.encoder.encode_all_words if traced else self.encoder.encode_words
        return encode(frames["instruction"])

    def _write(self, frames: TensorDictBase, values: tuple[Tensor, ...]) -> TensorDictBase:
        for key, value in zip(self.encoder.out_keys, values, strict=True):
            frames.set(key, value)
        return frames


class PolicyAct(TensorDictModuleBase):
    """Observations (N,) to "action" (N, A) in [-1, 1], for a collector; the mean action when exploration is off.

    A sequence of TensorDictModules with a ProbabilisticActor computes the same in twice the time, at every step of
    the worlds.
    """

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.policy = policy
        self.in_keys = [*policy.encoder_keys, *(NEAR if key == OBSTACLE else key for key in policy.actor_keys), "hold"]
        self.writes_log_prob = not any(policy.bounds)
        obstacle = [OBSTACLE] if policy.encoder.observes_obstacles else []
        log_prob = ["move_log_prob"] if self.writes_log_prob else []
        self.out_keys = [*policy.encoder.out_keys, *obstacle, "move", *log_prob, "action"]

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        explores = exploration_type() not in MEANS
        self.policy.encode(frames)
        if explores:
            self.policy.encoder.keep_mean(frames)
        else:
            self.policy.encoder.select_likeliest(frames)
        loc, scale = self.policy.move_parameters(frames)
        noise = torch.randn_like(loc) if explores else torch.zeros_like(loc)
        move = self.policy.sample_move(loc, scale, noise)
        if self.writes_log_prob:
            frames.set("move_log_prob", normal_log_prob(noise, scale).sum(-1))
        frames.set("move", move)
        return frames.set("action", (frames["hold"] + self.policy.action_unit * move).clamp(-1.0, 1.0))


class FlatEncoder(nn.Module):
    """Instruction and scene to one row (N, F): normalised objects, mask, mean embedding of the words, and the ray.

    It has the interface of `GroundingEncoder`, without attention: `select_likeliest` and the like do nothing.

    Args:
        objects: normalises object rows.
        slots: K.
        vocabulary: number of words.
        embedding: width of a word.
        gesture: width of the ray; 0 where nobody points.
        further: by key, normalises a further observation.
    """

    out_keys = ("scene",)
    logit_keys = ()
    observes_obstacles = False
    obstacle_width = verbs = 0

    def __init__(
        self,
        objects: Normalise,
        *,
        slots: int,
        vocabulary: int,
        embedding: int,
        gesture: int = 0,
        further: Mapping[NestedKey, Normalise] | None = None,
    ) -> None:
        super().__init__()
        self.further = nn.ModuleList((further or {}).values())
        self.scene_keys = (*SCENE_KEYS, *(GESTURE,) * (gesture > 0), *(further or ()))
        self.normalise = objects
        self.word_embedding = nn.EmbeddingBag(vocabulary, embedding, mode="mean", padding_idx=0)
        more = sum(each.shape.numel() for each in (further or {}).values())
        self.outputs = slots * (objects.shape[-1] + 1) + embedding + gesture + more

    def forward(self, instruction: Tensor, *scene: Tensor) -> tuple[Tensor, ...]:
        return self.attend(self.encode_words(instruction), *scene)

    def encode_words(self, instruction: Tensor) -> Tensor:
        """Return the mean embedding (N, E) of tokens (N, L); zeros, which need no gradient, for tasks without words."""
        if not instruction.any():
            return self.word_embedding.weight.new_zeros(len(instruction), self.word_embedding.embedding_dim)
        return self.encode_all_words(instruction)

    def encode_all_words(self, instruction: Tensor) -> Tensor:
        """`encode_words` without a look at the values, which no exported file can express."""
        return self.word_embedding(instruction)

    def attend(self, words: Tensor, objects: Tensor, mask: Tensor, *more: Tensor) -> tuple[Tensor, ...]:
        """`forward`, given the result of `encode_words`."""
        taken = len(more) - len(self.further)
        further = (normalise(value) for normalise, value in zip(self.further, more[taken:], strict=True))
        present = mask.to(objects.dtype)
        rows = self.normalise(objects) * present.unsqueeze(-1)
        return (torch.cat([rows.flatten(1), present, words, *more[:taken], *further], -1),)

    def keep_mean(self, frames: TensorDictBase) -> None:
        """Do nothing: there is no attention."""

    select_likeliest = select_labelled = keep_mean

    def write_obstacle(self, frames: TensorDictBase, referent: Tensor) -> None:
        """Do nothing: the actor is given all rows."""


def build_policy(
    config: PolicyConfig,
    observation_spec: Composite,
    action_unit: Sequence[float],
    bounds: MoveBounds = UNBOUNDED,
    vocabulary: Sequence[str] = (),
    readers: Readers = DEFAULT_READERS,
) -> Policy:
    """Return a policy for these observations and actions.

    Args:
        config: the key `policy` of a run.
        observation_spec: of the environment.
        action_unit: (A,), of the environment.
        bounds: how moves are bounded; it depends on the algorithm.
        vocabulary: the tokenizer's words, which only `encoder=sentence` reads.
        readers: which network reads which observation.

    Raises:
        ConfigError: several networks for a task without stages, or without verbs; or an observation that cannot be
            normalised has a reader.
    """
    if config.builds is not None:
        module, _, function = config.builds.rpartition(".")
        return getattr(import_module(module), function)(
            config, observation_spec, action_unit, bounds=bounds, vocabulary=vocabulary, readers=readers
        )
    return build_networks(config, observation_spec, action_unit, bounds, vocabulary, readers)


def build_networks(
    config: PolicyConfig,
    observation_spec: Composite,
    action_unit: Sequence[float],
    bounds: MoveBounds = UNBOUNDED,
    vocabulary: Sequence[str] = (),
    readers: Readers = DEFAULT_READERS,
) -> Policy:
    """`build_policy` for our own networks, which a policy of an own package may begin with."""
    encoder = _build_encoder(config, observation_spec, vocabulary, readers)
    further = keys_read(readers, "actor", observation_spec, further=True)
    actor = _build_actor(config, observation_spec, encoder, len(action_unit), further)
    return Policy(encoder, actor, action_unit, bounds=bounds, further_keys=further)


def further_input(spec: Composite, key: NestedKey, reader: str, flat: bool = True) -> Normalise:
    """Return the normalisation of an observation that a network reads. Raises ConfigError."""
    try:
        return Normalise(spec[key], flat)
    except ValueError as error:
        raise ConfigError(f"the observation {key} cannot have reader={reader}: {error}") from None


def _build_actor(
    config: PolicyConfig,
    spec: Composite,
    encoder: GroundingEncoder | FlatEncoder | PictureEncoder,
    actions: int,
    further: Sequence[NestedKey],
) -> GaussianActor | SeveralActors:
    by_verb = isinstance(config, GroundedConfig) and config.by_verb
    if config.networks > 1 and STAGE not in spec.keys():
        raise ConfigError(f"policy.networks={config.networks} needs a task that has stages, like nl_pick_and_place")
    if by_verb and not encoder.verbs:
        raise ConfigError("policy.by_verb=true needs a task that has several verbs: take task=anything, or false")
    actors = [
        GaussianActor(
            robot=Normalise(spec["robot"]),
            context=encoder.outputs + encoder.obstacle_width,
            hidden=config.hidden,
            actions=actions,
            activation=config.activation,
            std=config.initial_std,
            state_dependent_std=config.state_dependent_std,
            further=[further_input(spec, key, "actor") for key in further],
        )
        for _ in range(encoder.verbs if by_verb else config.networks)
    ]
    if by_verb:
        return VerbActor(actors)
    return StagedActor(actors) if len(actors) > 1 else actors[0]


def _build_encoder(
    config: PolicyConfig, spec: Composite, vocabulary: Sequence[str], readers: Readers
) -> GroundingEncoder | FlatEncoder | PictureEncoder:
    objects, instruction = Normalise(spec["objects"]), spec["instruction"]
    choices = 1 + (TARGET in spec.keys(include_nested=True))
    if isinstance(config, PixelsConfig):
        words, length = instruction.space.n, instruction.shape[-1]
        return PictureEncoder(config, spec, words=words, length=length, choices=choices)
    read = keys_read(readers, "scene", spec)
    flat = not isinstance(config, GroundedConfig)
    further = {key: further_input(spec, key, "scene", flat) for key in read if key not in DEFAULT_READERS}
    gesture = spec[GESTURE].shape[-1] if GESTURE in read else 0
    if not isinstance(config, GroundedConfig):
        return FlatEncoder(
            objects,
            slots=spec["objects"].shape[-2],
            vocabulary=instruction.space.n,
            embedding=config.embedding,
            gesture=gesture,
            further=further,
        )
    _check_columns(spec, list(further))
    return GroundingEncoder(
        objects,
        _build_word_embedding(config, instruction.space.n, vocabulary),
        length=instruction.shape[-1],
        embedding=config.embedding,
        width=config.width,
        reads_gesture=gesture > 0,
        choices=choices,
        observes_obstacles=NEAR in keys_read(readers, "actor", spec),
        verbs=spec[VERB].space.n if VERB in spec.keys(include_nested=True) else 0,
        further=further,
    )


def _check_columns(spec: Composite, keys: Sequence[NestedKey]) -> None:
    """Raise ConfigError for an observation that is neither (K, F), a row for each slot, nor (F,)."""
    slots = spec["objects"].shape[1]
    for key in keys:
        shape = tuple(spec[key].shape[1:])
        if len(shape) != 1 and (len(shape) != 2 or shape[0] != slots):
            raise ConfigError(
                f"the observation {key} of shape {shape} cannot have reader=scene: it must be ({slots}, F), with a row "
                "for each slot, or (F,)"
            )


def _build_word_embedding(config: GroundedConfig, count: int, vocabulary: Sequence[str]) -> nn.Module:
    if config.encoder == "tokens":
        return nn.Embedding(count, config.embedding, padding_idx=0)
    if len(vocabulary) != count:
        raise ValueError(f"encoder=sentence must be given the {count} words of the instructions, not {len(vocabulary)}")
    return SentenceWords(vocabulary, config.embedding)


def parameters(*modules: nn.Module) -> list[Tensor]:
    """Return the distinct trainable parameters of the modules."""
    return list(dict.fromkeys(p for module in modules for p in module.parameters() if p.requires_grad))


def stochastic_actor(policy: Policy, passed: Sequence[NestedKey] = ()) -> ProbabilisticActor:
    """Return the module from (robot, context, ...) to the distribution of "move": normal, or its tanh (`squash`).

    passed: keys that the critic reads and the actor does not. TorchRL's TD3Loss and REDQLoss give the critic only those
    entries of a frame that are inputs of the actor, so these are declared as inputs and ignored.
    """
    return ProbabilisticActor(
        TensorDictModule(_Parameters(policy), in_keys=_in_keys(policy, passed), out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        out_keys=["move"],
        distribution_class=TanhNormal if policy.bounds.squash else IndependentNormal,
        return_log_prob=True,
    )


def deterministic_actor(policy: Policy, passed: Sequence[NestedKey] = ()) -> TensorDictModule:
    """Return the module from (robot, context, ...) to the mean "move" (N, A). passed: as in `stochastic_actor`."""
    return TensorDictModule(_Mean(policy), in_keys=_in_keys(policy, passed), out_keys=["move"])


class _Parameters(nn.Module):
    """The actor's loc and scale; inputs beyond the actor's are ignored."""

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.actor, self.inputs = policy.actor, 1 + len(policy.actor_keys)

    def forward(self, *values: Tensor) -> tuple[Tensor, Tensor]:
        return self.actor(*values[: self.inputs])


class _Mean(_Parameters):
    def forward(self, *values: Tensor) -> Tensor:  # type: ignore[override]
        return super().forward(*values)[0]


def _in_keys(policy: Policy, passed: Sequence[NestedKey]) -> list[NestedKey]:
    robot, *more = policy.actor_keys
    return list(dict.fromkeys([robot, policy.context_key, *more, *passed]))


def expert_move(frames: TensorDictBase, policy: Policy) -> Tensor:
    """Return the expert's action as a move (N, A) of the policy, relative to `hold`, in [-1, 1]."""
    return ((frames[LABEL] - frames["hold"]) / policy.action_unit).clamp(-1.0, 1.0)


class ExpertMixture(nn.Module):
    """At each step of each world the expert acts with a probability, else the policy does.

    This is the behaviour policy of DAgger, Ross et al. 2011 (arXiv:1011.0686).

    Attributes:
        expert_share: () the probability, in [0, 1].
    """

    expert_share: Tensor

    def __init__(self, policy: Policy, expert_share: float = 1.0) -> None:
        super().__init__()
        self.policy = policy
        self.register_buffer("expert_share", torch.tensor(expert_share))

    @property
    def act(self) -> MixedAct:
        """The module from an observation with the expert's action to "action"."""
        return MixedAct(self)


class MixedAct(TensorDictModuleBase):
    """Observations (N,) with privileged/expert_action (N, A) to "action" (N, A) and the equal "move" (N, A)."""

    def __init__(self, mixture: ExpertMixture) -> None:
        super().__init__()
        self.mixture, self.policy_act = mixture, PolicyAct(mixture.policy)
        self.in_keys, self.out_keys = [*self.policy_act.in_keys, LABEL], self.policy_act.out_keys

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        action, expert = self.policy_act(frames)["action"], frames[LABEL]
        follows = torch.rand(len(action), 1, device=action.device) < self.mixture.expert_share
        frames.set("move", torch.where(follows, expert_move(frames, self.mixture.policy), frames["move"]))
        return frames.set("action", torch.where(follows, expert, action))

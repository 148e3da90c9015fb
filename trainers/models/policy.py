"""Policies and critics, built from specs.

    objects, mask, instruction, gesture ─► words ─► attention_logits, context, obstacle ┐
                                                                               robot ───┴─► gaussian ─► action
                                           robot, privileged/goal ─────► critic (losses only)

The critic may be shown what the policy must find out (asymmetric actor-critic, Pinto et al. 2018, arXiv:1710.06542):
it is thrown away after training.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase
from torch import Tensor, nn
from torchrl.data import Composite
from torchrl.envs.utils import ExplorationType, exploration_type

from conf.schema import ConfigError
from trainers.config import GroundedConfig, PolicyConfig
from trainers.models.grounding import CHOICES, GESTURE, NEAR, OBSTACLE, TARGET, Flattener, Grounder
from trainers.models.networks import Critic, Gaussian, Normalise, Staged, Value, normal_log_prob
from trainers.models.sentence_encoder import SentenceWords

GOAL = ("privileged", "goal")
STAGE = "stage"


class Policy(nn.Module):
    """Words choose what the arm is told; the arm's network never sees a word.

    words: reads the words and what is seen; its last output is the context. gaussian: robot, context, where there is
    something to be knocked against the nearest of that, and, if it is of several networks, the stage, to a move's loc
    and scale.
    unit: (A,), from the environment. A "move" of 1 is as far as the arm gets in one control step: the action is
    hold + unit * move, so that one network and one exploration noise fit every control mode.
    squash: a move is the tanh of a normal (SAC) instead of a normal (PPO).
    """

    unit: Tensor

    def __init__(
        self, words: Grounder | Flattener, gaussian: Gaussian | Staged, unit: Sequence[float], squash: bool
    ) -> None:
        super().__init__()
        self.register_buffer("unit", torch.as_tensor(unit, dtype=torch.float32))
        self.words, self.gaussian, self.squash = words, gaussian, squash
        self.context: str = words.writes[-1]
        beware, staged = (OBSTACLE,) * words.watches, (STAGE,) * isinstance(gaussian, Staged)
        self.feels: tuple[str, ...] = ("robot", *beware, *staged)

    @property
    def attends(self) -> bool:
        """Whether the words choose among object slots, so that the choice can be taught."""
        return bool(self.words.chooses)

    @property
    def meant(self) -> tuple[tuple[str, str], ...]:
        """The keys of the slots that it should choose."""
        return tuple(CHOICES[key] for key in self.words.chooses)

    @property
    def reads(self) -> tuple[str, ...]:
        """The keys of an observation that tell what is meant: the words first."""
        return ("instruction", *self.words.sees)

    @property
    def act(self) -> Act:
        """The whole way from an observation to "action"; shares the parameters. Reads nothing privileged."""
        return Act(self)

    @property
    def noise(self) -> list[nn.Parameter]:
        """The logarithms of the exploration noise, (A,) for each network."""
        stages = self.gaussian.stages if isinstance(self.gaussian, Staged) else [self.gaussian]
        return [stage.log_std for stage in stages]  # type: ignore[union-attr,misc]

    def steer(self, frames: TensorDictBase) -> tuple[Tensor, Tensor]:
        """The loc and scale (N, A) of a move, once the words are encoded."""
        robot, *more = (frames[key] for key in self.feels)
        return self.gaussian(robot, frames[self.context], *more)

    def encode(self, frames: TensorDictBase) -> TensorDictBase:
        """Write what the words mean (N, ...) to frames (N,), and return them."""
        return self._write(frames, self.words(*(frames[key] for key in self.reads)))

    def encode_step(self, before: TensorDictBase, after: TensorDictBase) -> None:
        """`encode` a step's two ends, the later one without gradients.

        The words are the same at both, so they are read once: half the cost of two calls.
        """
        asked = self.words.ask(before["instruction"])
        self._write(before, self.words.point(asked, *(before[key] for key in self.words.sees)))
        with torch.no_grad():
            self._write(after, self.words.point(asked, *(after[key] for key in self.words.sees)))

    def _write(self, frames: TensorDictBase, values: tuple[Tensor, ...]) -> TensorDictBase:
        for key, value in zip(self.words.writes, values, strict=True):
            frames.set(key, value)
        return frames


class Act(TensorDictModuleBase):
    """Observations (N,) to "action" (N, A) in [-1, 1], as a collector wants it; the mean one when exploration is off.

    A sequence of TensorDictModules with a ProbabilisticActor computes the same in twice the time, at every step of
    the worlds.
    """

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.policy = policy
        self.in_keys = [*policy.reads, *(NEAR if key == OBSTACLE else key for key in policy.feels), "hold"]
        made = [*policy.words.writes, *([OBSTACLE] if policy.words.watches else [])]
        self.out_keys = [*made, "move", *([] if policy.squash else ["move_log_prob"]), "action"]

    def forward(self, frames: TensorDictBase) -> TensorDictBase:
        explores = exploration_type() not in (ExplorationType.DETERMINISTIC, ExplorationType.MODE, ExplorationType.MEAN)
        self.policy.encode(frames)
        self.policy.words.decide(frames, mixed=explores)
        loc, scale = self.policy.steer(frames)
        noise = torch.randn_like(loc) if explores else torch.zeros_like(loc)
        move = loc + scale * noise
        if self.policy.squash:
            move = move.tanh()
        else:
            frames.set("move_log_prob", normal_log_prob(noise, scale).sum(-1))
        frames.set("move", move)
        return frames.set("action", (frames["hold"] + self.policy.unit * move).clamp(-1.0, 1.0))


def build(
    config: PolicyConfig,
    observation_spec: Composite,
    unit: Sequence[float],
    squash: bool = False,
    vocabulary: Sequence[str] = (),
) -> Policy:
    """A policy for these observations and actions of these units, squashed for SAC. Raises ConfigError.

    vocabulary: the tokenizer's words, which only `encoder=sentence` reads.
    """
    words = _words(config, observation_spec, vocabulary)
    if config.networks > 1 and STAGE not in observation_spec.keys():
        raise ConfigError(f"policy.networks={config.networks} needs a task that has stages, like nl_pick_and_place")
    stages = [
        Gaussian(
            robot=Normalise(observation_spec["robot"]),
            context=words.outputs + words.watches * (1 + observation_spec["objects"].shape[-1]),
            hidden=config.hidden,
            actions=len(unit),
            activation=config.activation,
            std=config.initial_std,
            by_state=config.state_dependent_std,
        )
        for _ in range(config.networks)
    ]
    return Policy(words, Staged(stages) if len(stages) > 1 else stages[0], unit, squash)


def build_value(config: PolicyConfig, policy: Policy, observation_spec: Composite) -> TensorDictModule:
    """A state value: writes state_value (N, 1)."""
    robot, aim = _judged(config, policy, observation_spec)
    value = Value(robot, aim, 0, config.critic_hidden, config.activation, heads=1)
    return TensorDictModule(value, in_keys=["robot", aim_key(config, policy)], out_keys=["state_value"])


def build_q(config: PolicyConfig, policy: Policy, observation_spec: Composite) -> Critic:
    """Two action values on (robot, aim, move): (2, N, 1)."""
    robot, aim = _judged(config, policy, observation_spec)
    return Critic(robot, aim, len(policy.unit), config.critic_hidden, config.activation, heads=2)


def aim_key(config: PolicyConfig, policy: Policy) -> str | tuple[str, str]:
    """What a critic judges the robot by: the goal itself, or what the policy makes of the words."""
    return GOAL if config.privileged_critic else policy.context


def _judged(config: PolicyConfig, policy: Policy, spec: Composite) -> tuple[Normalise, Normalise | int]:
    aim = Normalise(spec[GOAL]) if config.privileged_critic else policy.words.outputs
    return Normalise(spec["robot"]), aim


def _words(config: PolicyConfig, spec: Composite, vocabulary: Sequence[str]) -> Grounder | Flattener:
    objects, said = Normalise(spec["objects"]), spec["instruction"]
    ray = spec[GESTURE].shape[-1] if GESTURE in spec.keys() else 0
    if isinstance(config, GroundedConfig):
        embed = _embed(config, said.space.n, vocabulary)
        things = 1 + (TARGET in spec.keys(include_nested=True))
        watches = NEAR in spec.keys()
        return Grounder(objects, embed, said.shape[-1], config.embedding, config.width, ray > 0, things, watches)
    return Flattener(objects, spec["objects"].shape[-2], said.space.n, config.embedding, ray)


def _embed(config: GroundedConfig, count: int, vocabulary: Sequence[str]) -> nn.Module:
    if config.encoder == "tokens":
        return nn.Embedding(count, config.embedding, padding_idx=0)
    if len(vocabulary) != count:
        raise ValueError(f"encoder=sentence must be given the {count} words of the instructions, not {len(vocabulary)}")
    return SentenceWords(vocabulary, config.embedding)


def parameters(*modules: nn.Module) -> list[Tensor]:
    """The distinct trainable parameters of the modules."""
    return list(dict.fromkeys(p for module in modules for p in module.parameters() if p.requires_grad))

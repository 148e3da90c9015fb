"""Policies and critics, built from specs.

    objects, mask, instruction ─► encoder ─► attention_logits, context ┐
                                                             robot ────┴─► actor ─► action
                                             robot, privileged/goal ─────► critic (losses only)

The critic may be shown what the policy must find out (asymmetric actor-critic, Pinto et al. 2018, arXiv:1710.06542):
it is thrown away after training.
"""

from __future__ import annotations

from tensordict.nn import InteractionType, TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torchrl.data import Composite, TensorSpec
from torchrl.modules import IndependentNormal, ProbabilisticActor, TanhNormal

from trainers.config import GroundedConfig, PolicyConfig
from trainers.grounding import Flattener, Grounder
from trainers.networks import Critic, Gaussian, Normalise, Value

SEEN = ["objects", "objects_mask", "instruction"]
GOAL = ("privileged", "goal")


class Clamp(nn.Module):
    """A sample of an unbounded distribution to an action in [-1, 1]."""

    def forward(self, sample: Tensor) -> Tensor:
        return sample.clamp(-1.0, 1.0)


class Policy(nn.Module):
    """encoder: reads `SEEN`, writes `context` and, where it points at something, attention_logits.

    actor: reads robot and `context`, writes loc, scale, the sample, its log-probability. Unsquashed, it writes
    "sample", and `act` clamps that to "action": the losses need the likelihood of what was drawn.
    """

    def __init__(self, encoder: TensorDictModule, actor: ProbabilisticActor, squash: bool) -> None:
        super().__init__()
        self.encoder, self.actor, self.squash = encoder, actor, squash
        self.context: str = encoder.out_keys[-1]

    @property
    def act(self) -> TensorDictSequential:
        """The whole way from an observation to "action"; shares the parameters. Reads nothing privileged."""
        clamp = [] if self.squash else [TensorDictModule(Clamp(), in_keys=["sample"], out_keys=["action"])]
        return TensorDictSequential(self.encoder, self.actor, *clamp)

    @property
    def gaussian(self) -> Gaussian:
        """The network under the actor's distribution."""
        return self.actor[0].module


def build(
    config: PolicyConfig, observation_spec: Composite, action_spec: TensorSpec, squash: bool = False
) -> Policy:
    """A policy for these specs.

    squash: actions are the tanh of a normal (SAC) instead of a clamped normal (PPO).
    """
    encoder = _encoder(config, observation_spec)
    gaussian = Gaussian(
        robot=Normalise(observation_spec["robot"]),
        context=encoder.module.outputs,
        hidden=config.hidden,
        actions=action_spec.shape[-1],
        activation=config.activation,
        std=config.initial_std,
        by_state=config.state_dependent_std,
    )
    head = TensorDictModule(gaussian, in_keys=["robot", encoder.out_keys[-1]], out_keys=["loc", "scale"])
    actor = ProbabilisticActor(
        head,
        in_keys=["loc", "scale"],
        out_keys=["action" if squash else "sample"],
        distribution_class=TanhNormal if squash else IndependentNormal,
        return_log_prob=not squash,
        default_interaction_type=InteractionType.RANDOM,
    )
    return Policy(encoder, actor, squash)


def build_value(config: PolicyConfig, policy: Policy, observation_spec: Composite) -> TensorDictModule:
    """A state value: writes state_value (N, 1)."""
    robot, aim = _judged(config, policy, observation_spec)
    value = Value(robot, aim, 0, config.critic_hidden, config.activation, heads=1)
    return TensorDictModule(value, in_keys=["robot", aim_key(config, policy)], out_keys=["state_value"])


def build_q(
    config: PolicyConfig, policy: Policy, observation_spec: Composite, action_spec: TensorSpec
) -> Critic:
    """Two action values on (robot, aim, action): (2, N, 1)."""
    robot, aim = _judged(config, policy, observation_spec)
    return Critic(robot, aim, action_spec.shape[-1], config.critic_hidden, config.activation, heads=2)


def aim_key(config: PolicyConfig, policy: Policy) -> str | tuple[str, str]:
    """What a critic judges the robot by: the goal itself, or what the policy makes of the words."""
    return GOAL if config.privileged_critic else policy.context


def _judged(config: PolicyConfig, policy: Policy, spec: Composite) -> tuple[Normalise, Normalise | int]:
    aim = Normalise(spec[GOAL]) if config.privileged_critic else policy.encoder.module.outputs
    return Normalise(spec["robot"]), aim


def _encoder(config: PolicyConfig, spec: Composite) -> TensorDictModule:
    objects, words = Normalise(spec["objects"]), spec["instruction"]
    if isinstance(config, GroundedConfig):
        grounder = Grounder(objects, words.space.n, words.shape[-1], config.embedding, config.width)
        return TensorDictModule(grounder, in_keys=SEEN, out_keys=["attention_logits", "referent"])
    flat = Flattener(objects, words.space.n, config.embedding)
    return TensorDictModule(flat, in_keys=SEEN, out_keys=["scene"])


def parameters(*modules: nn.Module) -> list[Tensor]:
    """The distinct trainable parameters of the modules."""
    return list(dict.fromkeys(p for module in modules for p in module.parameters() if p.requires_grad))

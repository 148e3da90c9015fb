"""A package of a user's own: a robot, a verb, a task with its expert, an algorithm, a loss and a policy."""

from __future__ import annotations

import shutil
from pathlib import Path

import pybullet_data

CONF = Path(__file__).parents[2] / "conf"
OWN_OPTIONS = ("robot=my_arm", "task=my_wave", "algo=my_algo", "policy=my_net")
ROBOT = """
name: my_arm
package: my_robots
urdf: arm/model.urdf
base: [-0.1, 0.0, 0.0]
joints: [{joints}]
max_speed: [1.71, 1.71, 1.75, 2.27, 2.44, 3.14, 3.14]
rest: [0.0, 0.6109, 0.0, -1.7006, 0.0, 0.8301, 0.0]
tip: lbr_iiwa_link_7
tip_offset: [0.0, 0.0, 0.065]
approach: [0.0, 0.0, 1.0]
grippers: [magnet]
magnet: [0.02, 0.02]
fingers: []
finger_opening: 0.0
gain: 0.3
reach: []
position_first: false
"""
TASKS = """
from dataclasses import replace
from envs.experts.base import Expert, register_expert
from envs.tasks import register_task
from envs.tasks.reach import NLReach
from language import VERBS, Verb

VERBS["wave"] = Verb(("wave at {object}", "greet {object}"))

@register_task("my_wave", verb="wave")
class MyWave(NLReach):
    def _distances(self, state):
        return super()._distances(replace(state, objects=state.objects + [0.0, 0.0, 0.12]))

@register_expert("my_wave")
class MyWaveExpert(Expert):
    def act(self, referent, target):
        return self._env.towards(self._place(referent) + [0.0, 0.0, 0.12])
"""
SETTINGS = """
from dataclasses import dataclass
from core.schema import one_of, within
from trainers.algorithms.settings import PPOConfig, register
from trainers.config import MLPConfig, register_policy

@register("my_algo", builds="my_robots.learning.MyAlgorithm")
@dataclass(frozen=True, kw_only=True)
class MyAlgorithmConfig(PPOConfig):
    name: str = one_of("my_algo")
    decay: float = within(0.0, 1.0)

@register_policy("my_net", builds="my_robots.learning.build")
@dataclass(frozen=True)
class MyNetConfig(MLPConfig):
    name: str = one_of("my_net")
    dropout: float = within(0.0, 0.9)
"""
LEARNING = """
from tensordict import TensorDict
from torch import nn
from torchrl.objectives import LossModule
from trainers.algorithms.ppo import PPO
from trainers.models.policy import build_networks

class MyAlgorithm(PPO):
    def compute_losses(self, frames):
        measured = super().compute_losses(frames)
        return measured | {"loss/actor": measured["loss/actor"] * self.config.decay}

class MyLoss(LossModule):
    out_keys = ("loss_objective", "loss_smooth")
    def __init__(self, actor_network, critic_network):
        super().__init__()
        self.actor, self.critic = actor_network, critic_network
    def forward(self, frames):
        log_prob = self.actor.get_dist(frames).log_prob(frames["move"])
        smooth = (self.critic(frames)["state_value"] - frames["value_target"]).square().mean()
        return TensorDict({"loss_objective": -log_prob.mean(), "loss_smooth": smooth})

def build(config, observation_spec, action_unit, **others):
    policy = build_networks(config, observation_spec, action_unit, **others)
    policy.actor.net.insert(0, nn.Dropout(config.dropout))
    return policy
"""
USES = """
from envs import make_env
from envs.experts import expert

env = make_env(["task=my_wave", "robot=my_arm"], num_worlds=4)
actor, now = expert(env), env.reset()
assert env.sentence().startswith("wave at ")
for _ in range(60):
    now = env.step(actor(now))["next"]
    if now["success"].all():
        break
assert now["success"].all()
"""


def write_own_package(site: Path) -> Path:
    """Write the package to a folder as pip installs it, and return the folder."""
    package = site / "my_robots"
    for group in ("robot", "task", "algo", "policy"):
        (package / group).mkdir(parents=True)
    shutil.copytree(Path(pybullet_data.getDataPath()) / "kuka_iiwa", package / "arm")
    joints = ", ".join(f"lbr_iiwa_joint_{i}" for i in range(1, 8))
    (package / "robot" / "my_arm.yaml").write_text(ROBOT.format(joints=joints))
    (package / "task" / "my_wave.yaml").write_text(_copy("task/nl_reach", "nl_reach", "my_wave"))
    (package / "algo" / "my_algo.yaml").write_text(_copy("algo/ppo", "name: ppo", "name: my_algo") + "decay: 0.9\n")
    loss = _copy("algo/a2c", "name: a2c", "name: my_loss").replace("A2CLoss", "my_robots.learning.MyLoss")
    (package / "algo" / "my_loss.yaml").write_text(_without_options(loss))
    (package / "policy" / "my_net.yaml").write_text(_copy("policy/mlp", "name: mlp", "name: my_net") + "dropout: 0.1\n")
    (package / "__init__.py").write_text("")
    for name, text in (("tasks", TASKS), ("settings", SETTINGS), ("learning", LEARNING)):
        (package / f"{name}.py").write_text(text)
    about = site / "my_robots-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-robots\nVersion: 1.0\n")
    plugins = "[deixis.plugins]\ntasks = my_robots.tasks\nsettings = my_robots.settings\n"
    (about / "entry_points.txt").write_text(f"[deixis.config]\nmy = my_robots\n\n{plugins}")
    return site


def _copy(option: str, old: str, new: str) -> str:
    """Return the YAML of an option of ours with another name."""
    text = (CONF / f"{option}.yaml").read_text("utf-8")
    assert old in text
    return text.replace(old, new)


def _without_options(text: str) -> str:
    """Return the YAML of a loss without the options of TorchRL's."""
    return "".join("options: {}\n" if line.startswith("options:") else line for line in text.splitlines(True))

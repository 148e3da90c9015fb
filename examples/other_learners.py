"""PPO, SAC and TQC of stable-baselines3 and SBX, in panda-gym and on ids of Deixis.

    pip install -e ".[bench]"
    python examples/other_learners.py PandaReach-v3 sb3-sac
    python examples/other_learners.py Deixis/Push-v0 sbx-tqc --frames 400000
    python examples/other_learners.py Deixis/NLReach-v0 sb3-ppo --frames 300000

panda-gym's environments have goals, and so have ids of Deixis without words (`goal=True`): SAC and TQC relabel episodes
by hindsight (HER). Ids with words give the sentence's embedding. stable-baselines3 reads it by `Slots` of
stable_baselines3_ppo.py; SBX, whose networks are JAX's, as one vector with all else.

It prints JSON lines: the settings; {"frames", "success", "evaluating"} after each interval, over episodes of the
deterministic policy; and {"frames", "evaluating"} about every ten seconds. evaluating: seconds that training has stood
still for evaluations so far.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from functools import partial
from importlib import import_module
from typing import Any

import gymnasium
import numpy as np

LIBRARIES = {"sb3": "stable-baselines3", "sbx": "SBX"}
LEARNERS = [f"{library}-{algorithm}" for library in LIBRARIES for algorithm in ("ppo", "sac", "tqc")]
EVALUATED = 10**6  # seed of evaluations
EVALUATION_WORLDS = 20
TOLD = 10.0  # seconds between two lines without an evaluation
PLAIN = ["task.curriculum.near=0", "task.randomize.start=0"]  # as our own evaluations have it

# The settings. `updates`: gradient steps a frame; `normalize`: observations and rewards, by VecNormalize. What is not
# here is the library's default. ZOO and ZOO_REACH are rl-baselines3-zoo's (22e3ff2, hyperparams/tqc.yml: PandaPush-v1
# and PandaPickAndPlace-v1; PandaReach-v1). It has no SAC for panda-gym: it gets TQC's. The others are ours, in good
# faith. LIGHT is ZOO with batches, layers and updates that two cores can pay, which learn sooner there. The zoo has no
# PPO with goals either: PPO has the values of stable_baselines3_ppo.py, which are tuned on NLReach. WORDS has the
# values of our own SAC, conf/algo/sac.yaml.
HINDSIGHT = {"goal_selection_strategy": "future", "n_sampled_goal": 4}
SHARED = {"learning_rate": 1e-3, "buffer_size": 1_000_000, "gamma": 0.95}
ZOO = SHARED | {"batch_size": 2048, "net_arch": [512] * 3, "tau": 0.05, "learning_starts": 100, "updates": 1.0}
LIGHT = ZOO | {"batch_size": 256, "net_arch": [256] * 3, "learning_starts": 1_000, "updates": 0.25}
ZOO_REACH = SHARED | {"batch_size": 256, "net_arch": [64, 64], "learning_starts": 1_000, "updates": 1.0}
ZOO_REACH |= {"normalize": True}
WORDS = SHARED | {"batch_size": 256, "net_arch": [256, 256], "tau": 0.01, "learning_starts": 2_000, "updates": 0.25}
WORDS |= {"buffer_size": 200_000, "ent_coef": "auto_0.1"}
PPO = {"batch_size": 256, "n_epochs": 6, "gamma": 0.9, "gae_lambda": 0.9, "learning_rate": 1e-3}
PPO |= {"log_std_init": -0.7, "ortho_init": False}
OF_NETWORKS = ("net_arch", "n_critics", "log_std_init", "ortho_init")  # settings that are of `policy_kwargs`
ROLLOUT = 1024  # frames of a batch of PPO, over all worlds


def has_words(env: str) -> bool:
    """Return whether the id is of Deixis, with words."""
    return env.startswith("Deixis/NL")


def settings_of(env: str, algorithm: str, zoo: bool = False) -> dict[str, Any]:
    """Return the settings of an algorithm in an environment. zoo: rl-baselines3-zoo's own, where ours replace them."""
    if algorithm == "ppo":
        return dict(PPO)
    if has_words(env):
        return dict(WORDS)
    if "Reach" not in env:
        return dict(ZOO if zoo else LIGHT)
    return ZOO_REACH | ({"n_critics": 1} if algorithm == "tqc" else {})


def make_worlds(env: str, count: int, flat: bool, processes: bool = False, evaluated: bool = False) -> Any:
    """Return worlds as stable-baselines3 has them.

    Args:
        env: id of the environment.
        count: of the worlds.
        flat: whether observations are one vector each.
        processes: whether each world of panda-gym has a process of its own. Those of Deixis step together.
        evaluated: whether they are for evaluations.
    """
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    if env.startswith("Deixis/"):
        from stable_baselines3_ppo import WorldsVecEnv

        words = {"instruction": "embedding", "overrides": PLAIN if evaluated else []}
        options: dict[str, Any] = words if has_words(env) else {"goal": True}
        worlds = gymnasium.make_vec(env, num_envs=count, autoreset_mode="SameStep", **options)
        return WorldsVecEnv(worlds, flat)
    return (SubprocVecEnv if processes else DummyVecEnv)([partial(make_world, env, flat)] * count)


def make_world(env: str, flat: bool) -> Any:
    """Return one world of panda-gym."""
    import panda_gym  # noqa: F401  registers its environments

    world = gymnasium.make(env)
    return gymnasium.wrappers.FlattenObservation(world) if flat else world


def make_model(env: str, learner: str, worlds: Any, settings: dict[str, Any], seed: int, flat: bool) -> Any:
    """Return the model. settings: as of `settings_of`, without `normalize`."""
    import stable_baselines3

    library, algorithm = learner.split("-")
    module = {"sb3": "sb3_contrib" if algorithm == "tqc" else "stable_baselines3", "sbx": "sbx"}[library]
    values: dict[str, Any] = settings | {"seed": seed, "device": "cpu"}
    networks = {key: values.pop(key) for key in OF_NETWORKS if key in values}
    if library == "sb3" and has_words(env):
        from stable_baselines3_ppo import Slots

        places = 0 if "Reach" in env else 1  # where something is pushed to
        networks |= {"features_extractor_class": Slots, "features_extractor_kwargs": {"places": places}}
    if algorithm == "ppo":
        values["n_steps"] = ROLLOUT // worlds.num_envs
    else:
        updates = values.pop("updates") * worlds.num_envs  # for a step of all worlds
        values["train_freq"] = max(1, round(1 / updates))
        values["gradient_steps"] = max(1, round(updates))
        if not has_words(env):
            values |= {"replay_buffer_class": stable_baselines3.HerReplayBuffer, "replay_buffer_kwargs": HINDSIGHT}
    policy = "MlpPolicy" if flat else "MultiInputPolicy"
    return getattr(import_module(module), algorithm.upper())(policy, worlds, policy_kwargs=networks, **values)


def success_rate(model: Any, worlds: Any, episodes: int) -> float:
    """Return the share of episodes that end in success: the first ones of each world, as many of each."""
    count = worlds.num_envs
    left = episodes // count + (np.arange(count) < episodes % count)
    observation, right = worlds.reset(), 0
    while left.any():
        action, _ = model.predict(observation, deterministic=True)
        observation, _, ended, infos = worlds.step(action)
        for world in np.flatnonzero(ended & (left > 0)):
            left[world] -= 1
            right += bool(infos[world]["is_success"])
    return right / episodes


class EvaluationLines:
    """Called after each step of all worlds. Prints the lines that the top of this file describes.

    Args:
        make_worlds: returns the worlds of evaluations.
        interval: frames between two evaluations.
        episodes: of each.
    """

    def __init__(self, make_worlds: Any, interval: int, episodes: int) -> None:
        self.make_worlds, self.interval, self.due, self.episodes = make_worlds, interval, interval, episodes
        self.worlds: Any = None
        self.seconds, self.told, self.evaluated = 0.0, time.monotonic(), -1

    def __call__(self, names: dict[str, Any], _: dict[str, Any]) -> bool:
        """Return True: training goes on. names: local ones of the library's loop, with the model as "self"."""
        model = names["self"]
        if model.num_timesteps >= self.due:
            self.due = model.num_timesteps // self.interval * self.interval + self.interval
            self.evaluate(model)
        elif time.monotonic() - self.told > TOLD:
            self.tell({"frames": model.num_timesteps})
        return True

    def evaluate(self, model: Any) -> None:
        """Evaluate the model, unless it was with so many frames."""
        if model.num_timesteps == self.evaluated:
            return
        start, self.evaluated = time.monotonic(), model.num_timesteps
        self.worlds = self.worlds or self.make_worlds()
        normalized = model.get_vec_normalize_env()
        worlds = self.worlds
        if normalized is not None:
            worlds = type(normalized)(worlds, training=False, norm_reward=False)
            worlds.obs_rms = normalized.obs_rms
        worlds.seed(EVALUATED + model.num_timesteps)
        success = success_rate(model, worlds, self.episodes)
        self.seconds += time.monotonic() - start
        self.tell({"frames": model.num_timesteps, "success": success})

    def tell(self, values: dict[str, Any]) -> None:
        self.told = time.monotonic()
        print(json.dumps(values | {"evaluating": round(self.seconds, 2)}), flush=True)


def train(given: argparse.Namespace) -> None:
    """Train as the options say, and print the settings and evaluations."""
    import torch
    from stable_baselines3.common.vec_env import VecNormalize

    env, (library, algorithm) = given.env, given.learner.split("-")
    settings = settings_of(env, algorithm, given.zoo)
    print(json.dumps({"settings": settings}), flush=True)
    torch.set_num_threads(1 if algorithm == "ppo" else 2)
    flat = library == "sbx" and (algorithm == "ppo" or has_words(env))  # its dictionaries are of vectors, for replay
    count = 16 if env.startswith("Deixis/") else 2 if algorithm == "ppo" else 1
    worlds = make_worlds(env, count, flat, processes=count == 2)
    if settings.pop("normalize", False):
        worlds = VecNormalize(worlds, gamma=settings["gamma"])
    model = make_model(env, given.learner, worlds, settings, given.seed, flat)
    make_others = partial(make_worlds, env, min(EVALUATION_WORLDS, given.episodes), flat, evaluated=True)
    evaluations = EvaluationLines(make_others, given.interval, given.episodes)
    model.learn(given.frames, callback=evaluations)
    evaluations.evaluate(model)
    worlds.close()


def main(words: list[str] | None = None) -> None:
    """Train a learner, and print JSON lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("env", help="PandaReach-v3, PandaPush-v3, ..., or an id of Deixis")
    parser.add_argument("learner", choices=LEARNERS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--interval", type=int, default=10_000, help="frames between two evaluations")
    parser.add_argument("--episodes", type=int, default=200, help="of an evaluation")
    parser.add_argument("--zoo", action="store_true", help="rl-baselines3-zoo's own settings, where ours replace them")
    args = parser.parse_args(words)
    if min(args.frames, args.interval, args.episodes) < 1 or args.seed < 0:
        parser.error("--frames, --interval and --episodes must be at least 1, --seed at least 0")
    try:
        train(args)
    except ModuleNotFoundError as error:
        sys.exit(f'{args.learner} needs {error.name}, which is not installed: pip install -e ".[bench]"')


if __name__ == "__main__":
    main()

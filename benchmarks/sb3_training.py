"""Training of stable-baselines3's PPO or SAC on a Gymnasium environment of this project, with its own defaults.

    python -m benchmarks.sb3_training ppo Deixis/NLReach-v0 SEED FRAMES INTERVAL

Prints a JSON line {"frames", "success"} after each `INTERVAL` frames, of 200 episodes of the deterministic policy, and
{"final": [success, low, high]} of 500 at the end: after `FRAMES` frames, or once an evaluation has reached 0.97.
`benchmarks.time_to_success` runs it.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from trainers.evaluation.evaluation import wilson

ENOUGH = 0.97
EPISODES, FINAL_EPISODES = 200, 500


def evaluate(model: Any, env: Any, episodes: int, seed: int) -> float:
    """Return the share of episodes that end in success."""
    right = 0
    for i in range(episodes):
        observation, _ = env.reset(seed=seed + i)
        done = False
        while not done:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, info = env.step(action)
            done = terminated or truncated
        right += bool(info["is_success"])
    return right / episodes


def main() -> None:
    """Train and print the evaluations."""
    name, env_id = sys.argv[1:3]
    seed, frames, interval = map(int, sys.argv[3:])
    import gymnasium
    import stable_baselines3
    import torch
    from stable_baselines3.common.vec_env import SubprocVecEnv

    import envs  # noqa: F401  registers the environment

    torch.set_num_threads(2 if name == "sac" else 1)
    one = gymnasium.make(env_id)
    given: Any = SubprocVecEnv([lambda: gymnasium.make(env_id) for _ in range(2)]) if name == "ppo" else one
    model = getattr(stable_baselines3, name.upper())("MultiInputPolicy", given, seed=seed, device="cpu")
    success, done = 0.0, 0
    while done < frames and success < ENOUGH:
        model.learn(interval, reset_num_timesteps=not done)
        done, success = model.num_timesteps, evaluate(model, one, EPISODES, 10**6 * (1 + done))
        print(json.dumps({"frames": done, "success": success}), flush=True)
    final = evaluate(model, one, FINAL_EPISODES, 10**9)
    low, high = wilson(round(final * FINAL_EPISODES), FINAL_EPISODES)
    print(json.dumps({"final": [final, low, high]}), flush=True)


if __name__ == "__main__":
    main()

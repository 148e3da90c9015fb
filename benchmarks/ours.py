"""One workload of Deixis per call: `python -m benchmarks.ours env_kuka --steps 20000` prints one JSON line."""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

from core.overrides import compose
from core.platform_tuning import fast_products
from envs import make_env, read_env
from train import build_env
from trainers.algorithms.algorithm import build_algorithm
from trainers.algorithms.off_policy import OffPolicyAlgorithm
from trainers.algorithms.sac import SAC
from trainers.collect.rollouts import Rollouts
from trainers.config import read_training
from trainers.run.train_loop import fit

WORLDS = 64  # of a process that collects, as in training
STEPS_OF_UPDATE = 50  # gradient steps of an off-policy algorithm for one batch of frames
WARM_UP = 20  # control steps of each world before the clock starts
PEER_PHYSICS = ("physics.substeps=20", "physics.time_step=0.002")  # panda-gym's and lanro-gym's
SB3_PPO = ("policy=mlp", "policy.hidden=[64,64]", "policy.critic_hidden=[64,64]", "policy.activation=tanh")
SB3_SAC = ("policy=mlp", "policy.hidden=[256,256]", "policy.critic_hidden=[256,256]", "policy.activation=relu")
WIDE = ("policy.hidden=[400,300]", "policy.critic_hidden=[400,300]")
FEW = ("eval.episodes=4", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0", "logger=[]")


def rate(count: int, unit: str, work: Callable[[], Any]) -> dict[str, Any]:
    """Time the work; return `count` per second, with its unit and the seconds."""
    start = time.perf_counter()
    work()
    seconds = time.perf_counter() - start
    return {"rate": count / seconds, "unit": unit, "seconds": seconds}


def actions(env: Any, rows: int) -> torch.Tensor:
    """Return random actions (rows, N, A), in [-1, 1], the same in every run."""
    return 2 * torch.rand(rows, *env.action_spec.shape, generator=torch.Generator().manual_seed(0)) - 1


def run_actions(env: Any, rows: torch.Tensor, state: Any) -> Any:
    """Take a control step for each row, with partial resets; return the last state."""
    for row in rows:
        state["action"] = row
        _, state = env.step_and_maybe_reset(state)
    return state


def env_bare(steps: int, overrides: Sequence[str]) -> dict[str, Any]:
    """Measure env steps a second over all worlds, with random actions, resets included."""
    env = make_env(overrides, WORLDS)
    rows = actions(env, steps // WORLDS)
    state = run_actions(env, rows[:WARM_UP], env.reset())
    return rate(len(rows) * WORLDS, "env steps/s", lambda: run_actions(env, rows, state))


def raw_loop(steps: int, overrides: Sequence[str]) -> dict[str, Any]:
    """Measure control steps a second of PyBullet alone: the same worlds, with the motor targets of `env_bare`."""
    import pybullet as bullet

    env = make_env(overrides, WORLDS)
    worlds: list[Any] = env._worlds
    targets: list[Any] = []
    for world in worlds:
        world.robot.drive = _recording(world.robot.drive, targets)
    state = run_actions(env, actions(env, WARM_UP), env.reset())
    run_actions(env, actions(env, steps // WORLDS), state)
    motors = [
        partial(
            bullet.setJointMotorControlArray,
            world.robot.body,
            world.robot.arm,
            bullet.POSITION_CONTROL,
            positionGains=[0.3] * len(world.robot.arm),
            physicsClientId=world.client,
        )
        for world in worlds
    ]
    sent = [row[: len(worlds[0].robot.arm)] for row in targets[WARM_UP * WORLDS :]]
    env.reset()

    def loop() -> None:
        for i, row in enumerate(sent):
            motors[i % WORLDS](targetPositions=row)
            client = worlds[i % WORLDS].client
            for _ in range(12):
                bullet.stepSimulation(client)

    return rate(len(sent), "control steps/s", loop)


def _recording(drive: Callable[[Any], None], targets: list[Any]) -> Callable[[Any], None]:
    def record_and_drive(row: Any) -> None:
        targets.append(row)
        drive(row)

    return record_and_drive


def collector(steps: int, overrides: Sequence[str], workers: int) -> dict[str, Any]:
    """Measure frames a second of TorchRL's collector with the default policy and a weight update for each batch."""
    config = compose(overrides)
    training = read_training(config)
    make = partial(build_env, read_env(config))
    env = make(1, 0)
    policy, _ = build_algorithm(training, env.observation_spec, env.action_unit)
    horizon = 64
    rollouts = Rollouts(
        make, policy, replace(training.collector, workers=workers, worlds=WORLDS * workers), horizon=horizon, seed=0
    )
    batches = max(steps // (WORLDS * horizon * workers), 1)

    def work() -> None:
        for _ in range(batches):
            rollouts.sync(policy)
            rollouts.next()

    try:
        rollouts.next()
        return rate(batches * WORLDS * horizon * workers, "frames/s", work)
    finally:
        rollouts.close()


def training(steps: int, overrides: Sequence[str]) -> dict[str, Any]:
    """Measure frames a second of collection and updates, without start-up and evaluation, as for the peers.

    The networks are those of stable-baselines3's defaults; the other hyperparameters are ours.
    """
    config = compose([*overrides, *FEW, f"total_frames={steps}", "eval.interval=100_000_000"])
    training = read_training(config)
    with tempfile.TemporaryDirectory() as folder:
        fit(training, partial(build_env, read_env(config)), Path(folder), {}, [])
        rows = [line.split(",") for line in (Path(folder) / "metrics.csv").read_text().splitlines()]
    columns = [rows[0].index(name) for name in ("time/collect", "time/update")]
    seconds = sum(float(row[column]) for row in rows[2:] for column in columns)
    frames = float(rows[-1][0]) - float(rows[1][0])  # the first batch includes the start of the workers
    return {"rate": frames / seconds, "unit": "frames/s", "seconds": seconds}


def gradient_steps(steps: int, overrides: Sequence[str]) -> dict[str, Any]:
    """Measure compiled updates a second of an off-policy algorithm on a filled buffer, with batch 256."""
    config = compose(["task=reach", "robot=panda", *overrides, "algo.batch=256", "algo.compile=on"])
    training = read_training(config)
    env = build_env(read_env(config), WORLDS, 0)
    policy, algorithm = build_algorithm(training, env.observation_spec, env.action_unit)
    assert isinstance(algorithm, OffPolicyAlgorithm)
    alone = replace(training.collector, workers=1, worlds=WORLDS)
    rollouts = Rollouts(partial(build_env, read_env(config)), policy, alone, horizon=128, seed=0)
    algorithm.replay.extend(rollouts.next())
    rollouts.close()
    torch.set_num_threads(len(os.sched_getaffinity(0)))

    def work() -> None:
        for _ in range(steps // STEPS_OF_UPDATE):
            algorithm.learn(STEPS_OF_UPDATE)

    algorithm.learn(STEPS_OF_UPDATE)
    return rate(steps // STEPS_OF_UPDATE * STEPS_OF_UPDATE, "gradient steps/s", work)


def sac_products(steps: int) -> dict[str, Any]:
    """Measure the matrix products of `sac_gradient_steps`, and nothing else: a lower bound of its time."""
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    config = compose(["task=reach", "robot=panda", "algo=sac", *SB3_SAC])
    env = build_env(read_env(config), 1, 0)
    policy, sac = build_algorithm(read_training(config), env.observation_spec, env.action_unit)
    assert isinstance(sac, SAC)
    actor, critic = (
        [layer.weight for layer in module.modules() if isinstance(layer, torch.nn.Linear)]
        for module in (policy.actor, sac.critic)
    )
    first = {id(weights[0]) for weights in (actor, critic[: len(critic) // 2], critic[len(critic) // 2 :])}
    inputs = {id(weight): torch.randn(256, weight.shape[1]) for weight in (*actor, *critic)}
    outputs = {id(weight): torch.randn(256, weight.shape[0]) for weight in (*actor, *critic)}

    @torch.no_grad()
    def step() -> None:
        for weight in (*actor, *actor, *critic, *critic, *critic):  # forward: critics of targets, of frames, of moves
            inputs[id(weight)] @ weight.t()
        for weight in (*actor, *critic):  # gradients of weights
            outputs[id(weight)].t() @ inputs[id(weight)]
        for weight in (*actor, *critic):  # gradients of inputs, except those of observations
            if id(weight) not in first:
                outputs[id(weight)] @ weight
        for weight in critic:  # ... down to the moves
            outputs[id(weight)] @ weight

    def work(count: int = steps) -> None:
        with fast_products(256**3):
            for _ in range(count):
                step()

    work(50)
    return rate(steps, "gradient steps/s", work)


def memory_per_world(worlds: int) -> dict[str, Any]:
    """Measure the MiB that each world adds to a training run, over all processes, without the workers' interpreters."""
    small, large = _peak_memory(1), _peak_memory(1 + worlds)
    return {"rate": (large - small) / (2 * worlds), "unit": "MiB", "seconds": 0.0}


def _peak_memory(worlds: int) -> float:
    """Measure the MiB of a training run with `worlds` in each of two workers, after its third batch."""
    config = compose([f"collector.worlds={2 * worlds}", "collector.workers=2", "algo.minibatch=16"])
    training = read_training(config)
    make = partial(build_env, read_env(config))
    env = make(1, 0)
    policy, algorithm = build_algorithm(training, env.observation_spec, env.action_unit)
    rollouts = Rollouts(make, policy, training.collector, horizon=training.algo.horizon, seed=0)
    try:
        for _ in range(3):
            algorithm.update(rollouts.next(), 0.0)
            rollouts.sync(policy)
        return sum(_resident(pid) for pid in (os.getpid(), *(p.pid for p in rollouts.processes)))
    finally:
        rollouts.close()


def _resident(pid: int) -> float:
    """Return MiB of private memory: shared pages are not counted twice."""
    rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(row.split()[1]) for row in rows if row.startswith("Private_")) / 1024


def reset_memory(resets: int) -> dict[str, Any]:
    """Measure memory after this number of resets, over memory after the first tenth of them."""
    env = make_env((), WORLDS)
    after = []
    for part in (0.1, 0.9):
        for _ in range(int(resets * part) // WORLDS):
            env.reset()
        gc.collect()
        after.append(_resident(os.getpid()))
    return {"rate": after[1] / after[0], "unit": "ratio", "seconds": 0.0}


def pictures(count: int) -> dict[str, Any]:
    """Measure pictures a second of the workspace's camera, in the size of videos."""
    env = make_env((), 1, render=True)
    env.reset()
    return rate(count, "pictures/s", lambda: [env.render() for _ in range(count)])


PANDA_REACH = ("robot=panda", "task=reach", *PEER_PHYSICS)
PLACE = ("task=nl_pick_and_place", "task.num_objects=2", "task.num_targets=2")
PANDA_NL_REACH = ("robot=panda", "task.num_objects=2", *PEER_PHYSICS)
WORKLOADS: dict[str, Callable[[int], dict[str, Any]]] = {
    "raw_kuka": partial(raw_loop, overrides=()),
    "env_kuka": partial(env_bare, overrides=()),
    "raw_place": partial(raw_loop, overrides=PLACE),
    "env_place": partial(env_bare, overrides=PLACE),
    "collector_1": partial(collector, overrides=(), workers=1),
    "collector_2": partial(collector, overrides=(), workers=2),
    "env_panda_matched": partial(env_bare, overrides=PANDA_REACH),
    "env_panda_nl_matched": partial(env_bare, overrides=PANDA_NL_REACH),
    "ppo_frames": partial(training, overrides=(*PANDA_REACH, *SB3_PPO)),
    "sac_frames": partial(training, overrides=(*PANDA_REACH, *SB3_SAC, "algo=sac")),
    "sac_gradient_steps": partial(gradient_steps, overrides=("algo=sac", *SB3_SAC)),
    "sac_wide_gradient_steps": partial(gradient_steps, overrides=("algo=sac", *SB3_SAC, *WIDE)),
    "tqc_gradient_steps": partial(gradient_steps, overrides=("algo=tqc", *SB3_SAC)),
    "crossq_gradient_steps": partial(gradient_steps, overrides=("algo=crossq", *SB3_SAC)),
    "sac_products": sac_products,
    "memory_per_world": memory_per_world,
    "reset_memory": reset_memory,
    "pictures": pictures,
}


def main() -> None:
    """Run a workload and print its rate as one JSON line."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("workload", choices=WORKLOADS)
    parser.add_argument("--steps", type=int, default=20_000)
    args = parser.parse_args()
    if args.steps < 1:
        sys.exit("--steps must be at least 1")
    torch.set_num_threads(1)
    print(json.dumps({"name": args.workload, **WORKLOADS[args.workload](args.steps)}), flush=True)


if __name__ == "__main__":
    main()

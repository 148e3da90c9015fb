"""One workload of a peer per call, as published: `python -m benchmarks.peers panda_gym_reach`.

Each workload prints one JSON line with its rate and its physics settings. `pip install -e ".[bench]"` installs the
peers except lanro-gym. lanro-gym 0.2.1 requires gymnasium below 1.0, but only for one logging call; its only other
release, 0.1.0, fails on a class that gym has removed. So 0.2.1 is installed without its dependencies into `build/`, and
the missing function is replaced by one that does nothing. Its rate was the same in an environment of its own with
gymnasium 0.29.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

LANRO = "lanro-gym==0.2.1"
LANRO_HOME = Path(__file__).resolve().parents[1] / "build" / LANRO.replace("==", "-")
WARM_UP = 100  # env steps or gradient steps before the timing
BATCH_SIZE = 256
HIDDEN, WIDE = (256, 256), (400, 300)
LEAN_SOLVER_ITERATIONS = 10  # as in our worlds
SAC_BUFFER_FILL = 2_000  # transitions in the buffer before gradient steps are timed


@dataclass(frozen=True)
class Physics:
    """Physics settings; the defaults are those of panda-gym 3.0.7 and lanro-gym 0.2.1, and Bullet's 50 iterations."""

    substeps: int = 20
    time_step: float = 1 / 500  # seconds
    solver_iterations: int = 50

    def apply(self, env: Any) -> None:
        """Set the physics of a peer's environment, whose client is at `sim`."""
        sim = env.unwrapped.sim
        client = sim.bclient if hasattr(sim, "bclient") else sim.physics_client
        sim.n_substeps = self.substeps
        setattr(sim, "time_step" if hasattr(sim, "time_step") else "timestep", self.time_step)
        client.setTimeStep(self.time_step)
        client.setPhysicsEngineParameter(numSolverIterations=self.solver_iterations)


@dataclass(frozen=True)
class Rate:
    """A measured rate, its unit, and the seconds of the measurement."""

    rate: float
    unit: str
    seconds: float


def _timed(count: int, unit: str, work: Callable[[], Any]) -> Rate:
    start = time.perf_counter()
    work()
    seconds = time.perf_counter() - start
    return Rate(count / seconds, unit, seconds)


def _random_steps(env: Any, steps: int) -> None:
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()


def _random_rate(env: Any, steps: int, physics: Physics) -> Rate:
    physics.apply(env)
    env.action_space.seed(0)
    env.reset(seed=0)
    _random_steps(env, WARM_UP)
    rate = _timed(steps, "env steps/s", lambda: _random_steps(env, steps))
    env.close()
    return rate


def _make_panda_gym(name: str, physics: Physics) -> Any:
    import gymnasium
    import panda_gym  # noqa: F401  registers its envs

    env = gymnasium.make(name)
    physics.apply(env)
    return env


def _make_lanro() -> Any:
    if not LANRO_HOME.exists():
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target"]
        subprocess.run([*command, str(LANRO_HOME), LANRO], check=True, stdout=sys.stderr)
    sys.path.insert(0, str(LANRO_HOME))
    import gymnasium

    if not hasattr(gymnasium.logger, "set_level"):  # removed in gymnasium 1.0, but called by lanro-gym on import
        setattr(gymnasium.logger, "set_level", lambda level: None)  # noqa: B010  no stub knows the name
    import lanro_gym  # noqa: F401  registers its envs

    return gymnasium.make("PandaNLReach2-v0")


def panda_gym_reach(steps: int, physics: Physics) -> Rate:
    """Measure env steps/s of `PandaReach-v3` (end-effector control) under random actions, resets included."""
    return _random_rate(_make_panda_gym("PandaReach-v3", physics), steps, physics)


def panda_gym_reach_lean(steps: int, physics: Physics) -> Rate:
    """Measure `panda_gym_reach` with our number of solver iterations: the cost of the code around the physics."""
    return panda_gym_reach(steps, replace(physics, solver_iterations=LEAN_SOLVER_ITERATIONS))


def lanro_nl_reach(steps: int, physics: Physics) -> Rate:
    """Measure env steps/s of `PandaNLReach2-v0` (two cubes, a sentence) under random actions, resets included."""
    return _random_rate(_make_lanro(), steps, physics)


def sb3_ppo(steps: int, physics: Physics) -> Rate:
    """Measure frames/s of stable-baselines3's PPO, default hyperparameters, 2 subprocess envs, the whole `learn()`.

    PPO collects whole rollouts of 2 x 2048 frames, so `steps` is rounded up to those.
    """
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import SubprocVecEnv

    vec = SubprocVecEnv([lambda: _make_monitored(physics) for _ in range(2)])
    model = PPO("MultiInputPolicy", vec, seed=0, device="cpu")
    rollout = model.n_steps * vec.num_envs
    frames = -(-steps // rollout) * rollout
    rate = _timed(frames, "frames/s", lambda: model.learn(frames))
    vec.close()
    return rate


def _make_monitored(physics: Physics) -> Any:
    from stable_baselines3.common.monitor import Monitor

    return Monitor(_make_panda_gym("PandaReachDense-v3", physics))


def _make_off_policy(cls: Any, physics: Physics, learning_starts: int, **options: Any) -> Any:
    """Return an off-policy algorithm of a peer. options: of the class, with `policy_kwargs` beside the widths."""
    networks = {"net_arch": list(HIDDEN)} | options.pop("policy_kwargs", {})
    return cls(
        "MultiInputPolicy",
        _make_monitored(physics),
        batch_size=BATCH_SIZE,
        learning_starts=learning_starts,
        buffer_size=100_000,
        policy_kwargs=networks,
        seed=0,
        device="cpu",
        **options,
    )


def sb3_sac(steps: int, physics: Physics) -> Rate:
    """Measure gradient steps/s of stable-baselines3's SAC (batch 256, 256 x 256, two critics): `train()` alone."""
    from stable_baselines3 import SAC

    model = _make_off_policy(SAC, physics, learning_starts=SAC_BUFFER_FILL)
    model.learn(SAC_BUFFER_FILL)
    model.train(gradient_steps=WARM_UP, batch_size=BATCH_SIZE)
    return _timed(steps, "gradient steps/s", lambda: model.train(gradient_steps=steps, batch_size=BATCH_SIZE))


def _sbx_steps(name: str, steps: int, physics: Physics, **options: Any) -> Rate:
    """Measure gradient steps/s of an algorithm of SBX, which compiles with JAX: `sb3_sac`, the compilation left out."""
    import sbx

    model = _make_off_policy(getattr(sbx, name), physics, learning_starts=SAC_BUFFER_FILL, **options)
    model.learn(SAC_BUFFER_FILL)
    model.train(gradient_steps=steps, batch_size=BATCH_SIZE)  # compiled for this number of steps
    return _timed(steps, "gradient steps/s", lambda: model.train(gradient_steps=steps, batch_size=BATCH_SIZE))


def sbx_sac(steps: int, physics: Physics) -> Rate:
    """Measure SBX's SAC, with the networks of `sb3_sac`."""
    return _sbx_steps("SAC", steps, physics)


def sbx_sac_wide(steps: int, physics: Physics) -> Rate:
    """Measure SBX's SAC with networks of 400 x 300."""
    return _sbx_steps("SAC", steps, physics, policy_kwargs={"net_arch": list(WIDE)})


def sbx_tqc(steps: int, physics: Physics) -> Rate:
    """Measure SBX's TQC with the quantiles and the layer normalisation of ours."""
    return _sbx_steps("TQC", steps, physics, policy_kwargs={"n_quantiles": 15, "layer_norm": True})


def sbx_crossq(steps: int, physics: Physics) -> Rate:
    """Measure SBX's CrossQ, the actor trained in each step as in ours; by default it is in each third one."""
    return _sbx_steps("CrossQ", steps, physics, policy_delay=1)


def sb3_sac_frames(steps: int, physics: Physics) -> Rate:
    """Measure frames/s of stable-baselines3's SAC in `learn()`, one gradient step a frame, one env."""
    from stable_baselines3 import SAC

    model = _make_off_policy(SAC, physics, learning_starts=WARM_UP)
    model.learn(2 * WARM_UP)
    return _timed(steps, "frames/s", lambda: model.learn(steps, reset_num_timesteps=False))


WORKLOADS = {
    workload.__name__: workload
    for workload in (
        panda_gym_reach,
        panda_gym_reach_lean,
        lanro_nl_reach,
        sb3_ppo,
        sb3_sac,
        sbx_sac,
        sbx_sac_wide,
        sbx_tqc,
        sbx_crossq,
        sb3_sac_frames,
    )
}


def main() -> None:
    """Run a workload and print its JSON line."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("workload", choices=WORKLOADS)
    parser.add_argument("--steps", type=int, default=2_000)
    parser.add_argument("--substeps", type=int, default=Physics.substeps)
    parser.add_argument("--time-step", type=float, default=Physics.time_step, help="seconds")
    parser.add_argument("--solver-iterations", type=int, default=Physics.solver_iterations)
    args = parser.parse_args()
    if min(args.steps, args.substeps, args.time_step, args.solver_iterations) <= 0:
        parser.error("--steps, --substeps, --time-step and --solver-iterations must be greater than 0")
    physics = Physics(args.substeps, args.time_step, args.solver_iterations)
    try:
        rate = WORKLOADS[args.workload](args.steps, physics)
    except ModuleNotFoundError as error:
        sys.exit(f'{args.workload} needs {error.name}, which is not installed: pip install -e ".[bench]"')
    print(json.dumps({"name": args.workload, **asdict(rate), "physics": asdict(physics)}), flush=True)


if __name__ == "__main__":
    main()

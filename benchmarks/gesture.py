"""Pointing gestures: accuracy of the finger, information in the ray, and cost per step.

    taskset -c 0 python -m benchmarks.gesture pointing --out gesture.json
    python -m benchmarks.gesture picking --out gesture.json
    python -m benchmarks.gesture ceiling --out gesture.json
    taskset -c 0 python -m benchmarks.gesture speed --out gesture.json

Each command prints a table and, with `--out`, replaces its own section of the JSON file. The same seed gives the same
scenes and gestures.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDictBase

from benchmarks.ours import WORLDS, actions
from benchmarks.store import lines_of, write_section
from core.overrides import compose
from envs import make_env, read_env
from envs.config import EnvConfig
from envs.experts.reach import ReachExpert
from envs.mdp.gestures import make_person
from envs.tasks import TASKS
from envs.tasks.shared.geometry import scatter
from envs.workspace_env import WorkspaceEnv
from human import STYLES, Body, Person, Unreachable, pointed_object, posterior, ray_offsets
from tools.referent_beliefs import PointedScene, accuracy, accuracy_by_cue, calibration, insider_belief

Array = NDArray[np.float64]
HEIGHT = 0.025  # metres above the table of the targets in the grid: the centre of a small object
SPACING = 0.12  # metres between the objects of `picking`
STEPS_PER_ROUND = 100  # control steps of all worlds in each timing
BARE = ("workspace=collabtable", "workspace.human=null")
ENVIRONMENTS = {  # number of objects, and: no person, a person who does not point, a person who points
    "1 bare": ("task=reach", *BARE),
    "1 standing": ("task=reach", "workspace=collabtable"),
    "1 pointing": ("task=reach_gesture", "workspace=collabtable", "task.num_objects=1"),
    "3 bare": ("task=nl_reach", *BARE),  # with words: without a gesture, only they identify the referent
    "3 pointing": ("task=reach_gesture", "workspace=collabtable"),
}
RATIOS = (  # numerator and denominator, in steps a second
    ("1 pointing", "1 bare"),
    ("3 pointing", "1 bare"),
    ("3 pointing", "3 bare"),
    ("1 standing", "1 bare"),
)


# ---- Pointing


def pointing(args: argparse.Namespace) -> dict[str, Any]:
    """Measure degrees between the finger and a grid over the table, the share refused, and milliseconds of CPU time.

    Each style points at the whole table top. "objects" is the area where objects are placed, and so the cost in a
    reset; "anywhere" is the space around the person, much of which the person cannot point at.
    """
    result: dict[str, Any] = {"points": args.side**2, "height_m": HEIGHT}
    env = make_env(["task=reach_gesture"], 1, render=True)  # with a body in Bullet
    env.reset()
    top = env.config.workspace.furniture["top"]
    targets = grid(top.position, top.size, args.side)
    for style in STYLES:
        result[style] = _pointing_errors(env, style, targets)
    x0, x1, y0, y1 = env.config.workspace.object_area
    area = grid([(x0 + x1) / 2, (y0 + y1) / 2, 0.0], [x1 - x0, y1 - y0, 0.0], args.side)
    result["objects"] = _pointing_errors(env, "finger", area)
    human: Any = env.config.workspace.human
    feet = np.array(human.position)
    around = np.random.default_rng(args.seed).uniform(feet - [1, 1, 0], feet + [1, 1, 2], (args.side**2 // 10, 3))
    result["anywhere"] = _pointing_errors(env, "finger", around)
    env.close()
    return result


def grid(center: list[float], size: list[float], side: int) -> Array:
    """Return (side^2, 3) points, metres, row by row: a grid over a table top, HEIGHT above it."""
    x, y = (center[i] + size[i] * (np.arange(side) / (side - 1) - 0.5) for i in range(2))
    places = np.meshgrid(x, y, indexing="ij")
    return np.stack([*(each.ravel() for each in places), np.full(side**2, center[2] + size[2] / 2 + HEIGHT)], 1)


def _pointing_errors(env: WorkspaceEnv, style: str, targets: Array) -> dict[str, Any]:
    """Measure each target: the arm moves there from the target before; then it is posed there from hanging."""
    world, frames = env._worlds[0], env.config.gesture.frames
    person: Any = world.person
    moved, posed, seconds = [], [], []
    for target in targets:
        start = time.thread_time()
        try:
            joints = person.solve(target, style)
        except Unreachable:
            continue
        solved = time.thread_time() - start
        person.move(joints, frames)
        while person.moving:
            world.step_physics()
        moved.append(angle_to(person, target, style))
        person.relax()
        start = time.thread_time()
        person.pose(joints)
        seconds.append((solved, time.thread_time() - start))
        posed.append(angle_to(person, target, style))
    solve, pose = 1e3 * np.array(seconds).T
    return {
        "refused": round(1 - len(posed) / len(targets), 4),
        "moved_deg": percentiles(moved),
        "posed_deg": percentiles(posed),
        "solve_ms": percentiles(solve),
        "pose_ms": percentiles(pose),
        "both_ms": percentiles(solve + pose),
    }


def angle_to(person: Body, target: Array, style: str) -> float:
    """Return degrees between the style's ray, by Bullet's link states, and target (3,), seen from the fingertip."""
    origin, direction = person.drawn(style)
    return float(np.rad2deg(ray_offsets(origin, direction, target[None]).angle[0]))


def percentiles(values: Any) -> dict[str, float]:
    """Return the median, the 99th percentile and the maximum."""
    median, high = np.percentile(values, (50, 99))
    return {"median": round(float(median), 4), "p99": round(float(high), 4), "most": round(float(np.max(values)), 4)}


# ---- Picking and ceiling


def picking(args: argparse.Namespace) -> dict[str, Any]:
    """Measure how often the object nearest to the ray is the referent, beside the Bayes-optimal observers."""
    result: dict[str, Any] = {"objects": 6, "spacing_m": SPACING, "scenes": args.scenes, "seed": args.seed}
    for noise in args.noise:
        config, person = _make_person(noise)
        area = config.workspace.object_area
        scenes = list(_pointed_scenes(person, area, args.scenes, np.random.default_rng(args.seed)))
        referents = [scene.referent for scene in scenes]
        nearest = [int(pointed_object(scene.origin, scene.direction, scene.positions)) for scene in scenes]
        beliefs = [posterior(scene.origin, scene.direction, scene.positions, noise) for scene in scenes]
        result[f"{noise:g}_deg"] = {
            "nearest_to_the_ray": accuracy([a == b for a, b in zip(nearest, referents, strict=True)]),
            "posterior": calibration(beliefs, referents),
            "insider": calibration([insider_belief(person, scene, noise) for scene in scenes], referents),
        }
    return result


def _make_person(noise_deg: float) -> tuple[EnvConfig, Any]:
    """Return the config of nl_reach_gesture, and its person."""
    config = read_env(compose(["task=nl_reach_gesture", f"gesture.noise_deg={noise_deg}"]))
    return config, make_person(config.workspace.human, config.gesture)


def _pointed_scenes(person: Person, area: list[float], count: int, rng: Generator) -> Iterator[PointedScene]:
    """Yield scenes of six objects scattered over the area, and a gesture towards the centre of one of them."""
    for _ in range(count):
        positions = np.array(scatter(rng, 6, area=area, spacing=SPACING, height=HEIGHT))
        referent = int(rng.integers(6))
        gesture = person.show(positions[referent], rng)
        yield PointedScene(gesture.origin, gesture.direction, positions, referent, np.ones(6))


def ceiling(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the accuracy that words, finger and both allow in the scenes of nl_reach_gesture."""
    result: dict[str, Any] = {"task": "nl_reach_gesture", "scenes": args.scenes, "seed": args.seed}
    for noise in args.noise:
        config, person = _make_person(noise)
        task = TASKS[config.task.name](config.task, config.workspace.object_area, 1, person)
        rng = np.random.default_rng(args.seed)
        episodes = [task.draw(rng) for _ in range(args.scenes)]
        result[f"{noise:g}_deg"] = accuracy_by_cue(episodes, person, noise, config.task.object_size)
    return result


# ---- Speed


def speed(args: argparse.Namespace) -> dict[str, Any]:
    """Measure env steps a second, resets included. Rounds go through all environments forwards and backwards in turn.

    Counts CPU seconds of this process, so that other load on the machine matters little.
    """
    torch.set_num_threads(1)
    runners = {}
    for name, overrides in ENVIRONMENTS.items():
        env = make_env(overrides, WORLDS)
        runners[name] = {"random": Runner(env, None), "expert": Runner(env, ReachExpert(env))}
    commands = {name: " ".join(overrides) for name, overrides in ENVIRONMENTS.items()}
    result: dict[str, Any] = {"worlds": WORLDS, "rounds": args.rounds, "environments": commands}
    for actor in ("random", "expert"):
        rates: dict[str, list[float]] = {name: [] for name in runners}
        for number in range(args.rounds):
            for name in list(runners)[:: -1 if number % 2 else 1]:
                rates[name].append(runners[name][actor].rate())
        result[actor] = {name: summary(np.array(values), 0) for name, values in rates.items()}
        ratios = {f"{a} / {b}": np.array(rates[a]) / np.array(rates[b]) for a, b in RATIOS}
        result[actor] |= {name: summary(values, 3) for name, values in ratios.items()}
    return result


class Runner:
    """Loop of one environment with random actions or an expert, STEPS_PER_ROUND control steps a call."""

    def __init__(self, env: WorkspaceEnv, expert: Callable[[TensorDictBase], TensorDictBase] | None) -> None:
        self._env, self._expert, self._random = env, expert, actions(env, STEPS_PER_ROUND)
        self._state: TensorDictBase | None = None

    def rate(self) -> float:
        """Return world steps per CPU second of this process."""
        state = self._env.reset() if self._state is None else self._state
        start = time.thread_time()
        for action in self._random:
            state = self._expert(state) if self._expert else state.set("action", action)
            _, state = self._env.step_and_maybe_reset(state)
        seconds = time.thread_time() - start
        self._state = state
        return STEPS_PER_ROUND * WORLDS / seconds


def summary(values: Array, digits: int) -> dict[str, float]:
    """Return median, least and greatest over the rounds, without the first, which warms up."""
    statistics = (("median", np.median), ("least", np.min), ("most", np.max))
    return {name: round(float(statistic(values[1:])), digits) for name, statistic in statistics}


def main() -> None:
    """Measure one thing and print its table. There is no pass or fail."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pointing", "picking", "ceiling", "speed"))
    parser.add_argument("--side", type=int, default=100, help="pointing: points along each side of the grid")
    parser.add_argument("--scenes", type=int, default=4000, help="picking, ceiling: new scenes for each noise")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 2.0, 4.0], help="degrees across the ray")
    parser.add_argument("--rounds", type=int, default=10, help="speed: the first one does not count")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="file that receives the result")
    args = parser.parse_args()
    result = {"pointing": pointing, "picking": picking, "ceiling": ceiling, "speed": speed}[args.what](args)
    for name, value in lines_of(result):
        print(f"{name:40} {value}")
    if args.out:
        write_section(args.out, "benchmarks.gesture", args.what, result)


if __name__ == "__main__":
    main()

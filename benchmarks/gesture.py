"""What a pointing finger holds, measured: where it points, what can be read from it, and what it costs.

    taskset -c 0 python -m benchmarks.gesture pointing --out docs/gesture.json
    python -m benchmarks.gesture picking --out docs/gesture.json
    python -m benchmarks.gesture ceiling --out docs/gesture.json
    taskset -c 0 python -m benchmarks.gesture speed --out docs/gesture.json

Each prints a table and, with `--out`, puts its own section into the JSON file and leaves the others. The same seed
gives the same scenes and gestures.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from tensordict import TensorDictBase

from benchmarks.language import rows, write
from benchmarks.ours import WORLDS, actions
from conf.overrides import compose
from envs import make_env, read_env
from envs.config import EnvConfig
from envs.experts import ReachExpert
from envs.mdp.gestures import meet
from envs.tasks import TASKS, Episode
from envs.tasks.object_layout import scatter
from envs.workspace_env import WorkspaceEnv
from human import STYLES, Body, Person, Unreachable, beside, meant, pointed_object, posterior, visibility
from language import parse
from trainers.rollout.evaluation import wilson

Array = NDArray[np.float64]
HEIGHT = 0.025  # metres above the table that the grid is pointed at: where a small object has its centre
SPACING = 0.12  # metres between the objects that are picked
CHUNK = 100  # control steps of all worlds between two looks at the clock
BARE = ("workspace=collabtable", "workspace.human=null")
ENVIRONMENTS = {  # by the number of objects: without a person, with one who stands there, with one who points
    "1 bare": ("task=reach", *BARE),
    "1 standing": ("task=reach", "workspace=collabtable"),
    "1 pointing": ("task=reach_gesture", "workspace=collabtable", "task.num_objects=1"),
    "3 bare": ("task=nl_reach", *BARE),  # with words: without any, nothing would tell which one is meant
    "3 pointing": ("task=reach_gesture", "workspace=collabtable"),
}
RATIOS = (  # whose steps a second over whose
    ("1 pointing", "1 bare"),
    ("3 pointing", "1 bare"),
    ("3 pointing", "3 bare"),
    ("1 standing", "1 bare"),
)


# --------------------------------------------------------------------------------------------------------- pointing


def pointing(args: argparse.Namespace) -> dict[str, Any]:
    """Degrees between the finger and a grid over the whole table, what is refused, and milliseconds of CPU time.

    objects: where objects are put, so this is what a reset costs. anywhere: places all around the person, many of
    which nobody can point at.
    """
    result: dict[str, Any] = {"points": args.side**2, "height_m": HEIGHT}
    env = make_env(["task=reach_gesture"], 1, render=True)  # with a body in Bullet
    env.reset()
    top = env.config.workspace.furniture["top"]
    targets = grid(top.position, top.size, args.side)
    for style in STYLES:
        result[style] = _pointed(env, style, targets)
    x0, x1, y0, y1 = env.config.workspace.object_area
    area = grid([(x0 + x1) / 2, (y0 + y1) / 2, 0.0], [x1 - x0, y1 - y0, 0.0], args.side)
    result["objects"] = _pointed(env, "finger", area)
    human: Any = env.config.workspace.human
    feet = np.array(human.position)
    around = np.random.default_rng(args.seed).uniform(feet - [1, 1, 0], feet + [1, 1, 2], (args.side**2 // 10, 3))
    result["anywhere"] = _pointed(env, "finger", around)
    env.close()
    return result


def grid(center: list[float], size: list[float], side: int) -> Array:
    """(side^2, 3) places, metres: all over a table top, HEIGHT above it, row by row."""
    x, y = (center[i] + size[i] * (np.arange(side) / (side - 1) - 0.5) for i in range(2))
    places = np.meshgrid(x, y, indexing="ij")
    return np.stack([*(each.ravel() for each in places), np.full(side**2, center[2] + size[2] / 2 + HEIGHT)], 1)


def _pointed(env: WorkspaceEnv, style: str, targets: Array) -> dict[str, Any]:
    """Each target in turn: the arm moves on to it from the last one, and then is posed there out of hanging."""
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
            world.pass_time()
        moved.append(off(person, target, style))
        person.relax()
        start = time.thread_time()
        person.pose(joints)
        seconds.append((solved, time.thread_time() - start))
        posed.append(off(person, target, style))
    solve, pose = 1e3 * np.array(seconds).T
    return {
        "refused": round(1 - len(posed) / len(targets), 4),
        "moved_deg": spread(moved),
        "posed_deg": spread(posed),
        "solve_ms": spread(solve),
        "pose_ms": spread(pose),
        "both_ms": spread(solve + pose),
    }


def off(person: Body, target: Array, style: str) -> float:
    """Degrees from the style's line, as Bullet has its links, to target (3,), as the fingertip sees them."""
    origin, direction = person.drawn(style)
    return float(np.rad2deg(beside(origin, direction, target[None]).angle[0]))


def spread(values: Any) -> dict[str, float]:
    median, high = np.percentile(values, (50, 99))
    return {"median": round(float(median), 4), "p99": round(float(high), 4), "most": round(float(np.max(values)), 4)}


# ---------------------------------------------------------------------------------------------- picking and ceiling


class Shown(NamedTuple):
    """A gesture among objects at positions (K, 3), metres; prior: (K,) how likely each is without it."""

    origin: Array
    direction: Array
    positions: Array
    referent: int
    prior: Array


def picking(args: argparse.Namespace) -> dict[str, Any]:
    """How often the object nearest to the ray is the one that was aimed at, beside the best any observer could do."""
    result: dict[str, Any] = {"objects": 6, "spacing_m": SPACING, "scenes": args.scenes, "seed": args.seed}
    for noise in args.noise:
        config, person = _meet(noise)
        area = config.workspace.object_area
        shown = list(_scenes(person, area, args.scenes, np.random.default_rng(args.seed)))
        by_posterior = [posterior(s.origin, s.direction, s.positions, noise) for s in shown]
        referents = [s.referent for s in shown]
        result[f"{noise:g}_deg"] = {
            "nearest_to_the_ray": share(
                [int(pointed_object(s.origin, s.direction, s.positions)) == s.referent for s in shown]
            ),
            "posterior": judged(by_posterior, referents),
            "insider": judged([insider(person, s, noise) for s in shown], referents),
        }
    return result


def _meet(noise: float) -> tuple[EnvConfig, Any]:
    """nl_reach_gesture's config, and its person."""
    config = read_env(compose(["task=nl_reach_gesture", f"gesture.noise_deg={noise}"]))
    return config, meet(config.workspace.human, config.gesture)


def _scenes(person: Person, area: list[float], count: int, rng: Generator) -> Iterator[Shown]:
    """Six objects scattered over the area, and a finger for the centre of one of them."""
    for _ in range(count):
        places = np.array(scatter(rng, 6, area, SPACING, HEIGHT))
        referent = int(rng.integers(6))
        gesture = person.show(places[referent], rng)
        yield Shown(gesture.origin, gesture.direction, places, referent, np.ones(6))


def ceiling(args: argparse.Namespace) -> dict[str, Any]:
    """What words and finger tell of nl_reach_gesture's scenes, each alone and both together."""
    result: dict[str, Any] = {"task": "nl_reach_gesture", "scenes": args.scenes, "seed": args.seed}
    for noise in args.noise:
        config, person = _meet(noise)
        task = TASKS[config.task.name](config.task, config.workspace.object_area, 1, person)
        rng = np.random.default_rng(args.seed)
        episodes = [task.draw(rng) for _ in range(args.scenes)]
        result[f"{noise:g}_deg"] = told(episodes, person, noise, config.task.object_size)
    return result


def told(episodes: list[Episode], person: Person, noise: float, size: float) -> dict[str, Any]:
    """How well the referent is known from the words, from the finger, and from both. size: of objects, metres."""
    known: dict[str, list[Array]] = {name: [] for name in ("words", "finger", "both", "insider")}
    for episode in episodes:
        scene, gesture = episode.scene, episode.gesture
        assert gesture is not None
        prior = visibility(person.eyes, scene.positions, size)
        command: Any = parse(episode.sentence)
        phrase = command.steps[-1].phrase
        finger = posterior(gesture.origin, gesture.direction, scene.positions, noise, prior)
        shown = Shown(gesture.origin, gesture.direction, scene.positions, episode.referent, prior)
        known["words"].append(meant(phrase, scene, prior))
        known["finger"].append(finger)
        known["both"].append(meant(phrase, scene, finger))
        known["insider"].append(meant(phrase, scene, insider(person, shown, noise)))
    referents = [episode.referent for episode in episodes]
    return {name: judged(beliefs, referents) for name, beliefs in known.items()}


def insider(person: Person, shown: Shown, noise: float) -> Array:
    """(K,) what somebody would believe who knows how this very person comes to point: no observer can do better.

    `posterior` takes the finger to stray about the direction from where it is. In truth it strays about where it would
    have been, had it hit, and then the arm is aimed anew; so each object is judged from the fingertip that is its own.
    """
    if noise == 0:
        return posterior(shown.origin, shown.direction, shown.positions, noise, shown.prior)
    level = shown.positions[0, 2] - shown.origin[2]
    spot = shown.origin + shown.direction * (level / shown.direction[2])  # which is all that the ray tells
    tips = np.array([person.aim(place).origin for place in shown.positions])
    sight = spot - tips
    far = np.linalg.norm(sight, axis=1)
    angle = beside(tips, shown.positions - tips, np.broadcast_to(spot, (len(tips), 1, 3))).angle[:, 0]
    log = -0.5 * (angle / np.deg2rad(noise)) ** 2 + np.log(np.abs(sight[:, 2]) / far**3)  # solid angle of a spot
    weight = np.exp(log - log.max()) * shown.prior
    return weight / weight.sum()


def judged(beliefs: list[Array], referents: list[int]) -> dict[str, Any]:
    """right: how often the likeliest object is meant. expected: how often it should be, if the beliefs are sound."""
    right = [int(belief.argmax()) == referent for belief, referent in zip(beliefs, referents, strict=True)]
    return {**share(right), "expected": round(float(np.mean([belief.max() for belief in beliefs])), 4)}


def share(right: list[bool]) -> dict[str, Any]:
    """With the 95 % interval."""
    low, high = wilson(sum(right), len(right))
    return {"right": round(sum(right) / len(right), 4), "low": round(low, 4), "high": round(high, 4)}


# ------------------------------------------------------------------------------------------------------------ speed


def speed(args: argparse.Namespace) -> dict[str, Any]:
    """Env steps a second, resets included, in rounds that go through all environments forwards and backwards in turn.

    CPU seconds of the one process, so that a neighbour's share counts for nobody.
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
        for turn in range(args.rounds):
            for name in list(runners)[:: -1 if turn % 2 else 1]:
                rates[name].append(runners[name][actor].rate())
        result[actor] = {name: middle(np.array(values), 0) for name, values in rates.items()}
        over = {f"{a} / {b}": np.array(rates[a]) / np.array(rates[b]) for a, b in RATIOS}
        result[actor] |= {name: middle(values, 3) for name, values in over.items()}
    return result


class Runner:
    """Goes on through one environment, CHUNK steps a call: with random actions, or an expert's."""

    def __init__(self, env: WorkspaceEnv, expert: Callable[[TensorDictBase], TensorDictBase] | None) -> None:
        self._env, self._expert, self._random = env, expert, actions(env, CHUNK)
        self._state: TensorDictBase | None = None

    def rate(self) -> float:
        """World steps a second of this process."""
        state = self._env.reset() if self._state is None else self._state
        start = time.thread_time()
        for action in self._random:
            state = self._expert(state) if self._expert else state.set("action", action)
            _, state = self._env.step_and_maybe_reset(state)
        seconds = time.thread_time() - start
        self._state = state
        return CHUNK * WORLDS / seconds


def middle(values: Array, digits: int) -> dict[str, float]:
    """The median round, the least and the most; the first one is to warm up."""
    told = (("median", np.median), ("least", np.min), ("most", np.max))
    return {name: round(float(of(values[1:])), digits) for name, of in told}


def main() -> None:
    """Measure one thing and print its table. What is good enough is for the reader to judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pointing", "picking", "ceiling", "speed"))
    parser.add_argument("--side", type=int, default=100, help="pointing: places along each side of the table's grid")
    parser.add_argument("--scenes", type=int, default=4000, help="picking, ceiling: fresh scenes for each noise")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 2.0, 4.0], help="degrees across the ray")
    parser.add_argument("--rounds", type=int, default=10, help="speed: the first one does not count")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="put the result into this file")
    args = parser.parse_args()
    result = {"pointing": pointing, "picking": picking, "ceiling": ceiling, "speed": speed}[args.what](args)
    for name, value in rows(result):
        print(f"{name:40} {value}")
    if args.out:
        write(args.out, "benchmarks.gesture", args.what, result)


if __name__ == "__main__":
    main()

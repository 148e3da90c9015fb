"""How often a policy succeeds whose eyes meet other light, other colours, cameras that moved, noise and the like.

    python -m benchmarks.eyes --episodes 200
    python -m benchmarks.eyes --episodes 200 --checkpoint nl_pick_and_place_kuka --only "noise, sd 15 of 255"
    python -m benchmarks.eyes --told --episodes 400
    python -m benchmarks.eyes --time

Each condition changes one thing, by at least as much as the training varies it, and draws it anew in each episode.
Cameras that moved are calibrated where they are, but for the last rows, where nobody noticed. `--told` compares what a
policy is told of its scene when an episode begins, after all cameras and the tracker, with what is there. `--time`
prints the milliseconds that perception takes of a control step, without the pictures. With `--json` each condition,
task or time is a line of JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

from core.cameras import CameraFrame, Light, project
from core.errors import ConfigError, did_you_mean
from core.overrides import apply, compose
from core.program import program
from envs.config import read_env
from envs.mdp.object_rows import COLOR
from envs.mdp.perceived_worlds import PerceivedWorlds, Reader
from envs.perception.camera_reader import CameraReader, Gripper
from envs.perception.detections import Detections, View, check_picture
from envs.perception.detector import load_detector
from envs.perception_training.conditions import CONDITIONS, Change
from envs.perception_training.scenes import PLAIN, LookVariation, Texture, moved_camera, sample_light, spare_places
from envs.sim.appearance import Appearance
from envs.workspace_env import WorkspaceEnv

WORLDS = 10
RGBA = slice(COLOR.start, COLOR.stop + 1)  # of an object's row: its colour, and how see-through it is
OCCLUDED = "a third of each object hidden"
TOLD = ("nl_reach", "nl_pick_and_place", "nl_reach_gesture", "anything")  # tasks of --told
UNNOTICED = (("camera moved by 5 mm, unnoticed", 0.005, 0.0), ("camera turned by 0.5 degrees, unnoticed", 0.0, 0.5))


class ConditionedReader(CameraReader):
    """Reads what is seen in worlds whose looks and cameras change with each episode.

    Args:
        env: whose worlds they are.
        looks: how much they vary.
        change: what happens to each picture.
        hides: whether a third of each object is covered.
        unnoticed: whether the detector is told the cameras as they were before they moved.
    """

    def __init__(
        self,
        env: WorkspaceEnv,
        *,
        looks: LookVariation,
        change: Change | None = None,
        hides: bool = False,
        unnoticed: bool = False,
    ) -> None:
        config = env.config
        super().__init__(env._worlds, config.workspace, config.perception, load_detector(config.perception.weights))
        self._env, self._looks, self._change = env, looks, change
        self._hides, self._unnoticed = hides, unnoticed
        self._rng = np.random.default_rng(0)
        self._named = {name: config.workspace.cameras[name] for name in config.perception.cameras}
        self._appearances = [Appearance(world) for world in env._worlds]
        self._drawn: dict[int, dict[str, Any]] = {}

    def read(self, world: int, gripper: Gripper) -> Detections:
        if world not in self._drawn or self._env._arrays.steps[world] == 0:
            self._drawn[world] = self._draw(world)
        drawn = self._drawn[world]
        views = {}
        for name, (camera, frame) in drawn["cameras"].items():
            photo = self._env._worlds[world].photograph(camera, gripper, drawn["light"])
            if drawn["texture"] is not None:
                drawn["texture"].paint(photo, camera, frame, self._appearances[world].furniture)
            picture = photo.colors
            if self._hides:
                picture = self._covered(picture, world, camera, frame)
            if self._change is not None:
                picture = self._change(picture, self._rng)
            told = (self._named[name], CameraFrame.of(self._named[name])) if self._unnoticed else (camera, frame)
            views[name] = View(picture, *told)
            check_picture(name, views[name])
        return self._detector(views)

    def _draw(self, world: int) -> dict[str, Any]:
        rng, looks = self._rng, self._looks
        if looks.recolor:
            self._appearances[world].recolor(rng)
        if looks.unknown:
            state = self._env._state
            known = state.objects[world, state.shown[world]]
            places = spare_places(self._env.config.workspace.object_area, known, 4, rng)
            self._appearances[world].scatter(places, rng)
        return {
            "cameras": {name: moved_camera(camera, looks, rng) for name, camera in self._named.items()},
            "light": sample_light(rng, looks.shadow) if looks.light else Light(),
            "texture": Texture(rng) if looks.texture else None,
        }

    def _covered(self, picture: np.ndarray, world: int, camera: Any, frame: CameraFrame) -> np.ndarray:
        """Cover the lower third of each object with a grey box."""
        state, picture = self._env._state, picture.copy()
        size = self._env.config.task.object_size
        for place in state.objects[world, state.shown[world]]:
            (u, v), depth = project(camera, frame, place)
            half = camera.focal * size / float(depth) * 0.6
            edges = np.rint([v + half / 3, v + half, u - half, u + half]).clip(0).astype(int)
            picture[edges[0] : edges[1], edges[2] : edges[3]] = 120
        return picture


def evaluated(checkpoint: str, episodes: int, seed: int, **condition: Any) -> dict[str, Any]:
    """Return the result of a policy's episodes in a condition, the arguments of `ConditionedReader`."""
    from trainers.evaluation.evaluation import evaluate
    from trainers.run.checkpoint import find, fitted_policy, load

    class ConditionedEnv(WorkspaceEnv):
        def _make_reader(self, config: Any) -> Reader:
            return ConditionedReader(self, **condition)

    saved = load(find(Path(checkpoint)))
    cfg = apply(saved["config"], ["perception=camera"])
    with closing(ConditionedEnv(read_env(cfg).without_curriculum(), WORLDS, seed, render=True)) as env:
        return evaluate(env, fitted_policy(saved, cfg, env).act, episodes, seed).as_dict()


def conditions() -> list[tuple[str, dict[str, Any]]]:
    """Return each condition's name and the arguments of `ConditionedReader`."""
    rows: list[tuple[str, dict[str, Any]]] = [("none", {"looks": PLAIN})]
    rows += [(name, {"looks": looks, "change": change}) for name, looks, change in CONDITIONS]
    rows.append((OCCLUDED, {"looks": PLAIN, "hides": True}))
    for name, shift, turn in UNNOTICED:
        rows.append((name, {"looks": replace(PLAIN, shift=shift, turn=turn), "unnoticed": True}))
    return rows


def told(words: list[str], episodes: int, seed: int) -> dict[str, Any]:
    """Compare the object rows of a policy at the start of episodes with the simulator's.

    Things within a drawer or under a lid are left out: most cannot be seen.

    Returns:
        things: how many there are. median_mm, p95_mm: how far off the places are. noun, color: shares of those that are
        told right among those that are told. missed, invented: shares of the things.
    """
    config = read_env(compose([*words, "perception=camera"])).without_curriculum()
    counts: Counter[str] = Counter()
    gaps: list[np.ndarray] = []
    with closing(WorkspaceEnv(config, WORLDS, seed, render=True)) as env:
        true, perceived = env._arrays, cast(PerceivedWorlds, env._perceived)
        fittings = perceived.task.fittings
        for _ in range(-(-episodes // WORLDS)):
            env.reset()
            state = true.state
            within = fittings.inside(state.nouns, state.objects).any(-1) if fittings else np.zeros_like(state.shown)
            there, seen = state.shown & ~within, perceived.state.shown & ~within
            both = there & seen
            off = np.abs(perceived.rows - true.rows)[both]
            counts += Counter(
                things=there.sum(),
                told=both.sum(),
                missed=(there & ~seen).sum(),
                invented=(seen & ~there).sum(),
                noun=(state.nouns == perceived.state.nouns)[both].sum(),
                color=(off[:, RGBA] < 0.1).all(1).sum(),
            )
            gaps.append(1000 * np.linalg.norm(off[:, :3], axis=1))
    shares = {name: counts[name] / counts["told"] for name in ("noun", "color")}
    shares |= {name: counts[name] / counts["things"] for name in ("missed", "invented")}
    median, high = np.quantile(np.concatenate(gaps), (0.5, 0.95))
    figures = {"median_mm": median, "p95_mm": high, **shares}
    return {"things": int(counts["things"]), **{name: float(value) for name, value in figures.items()}}


def perception_times() -> dict[str, float]:
    """Return the median milliseconds on one core of a control step's network and fusion, and of its tracker."""
    torch.set_num_threads(1)
    config = read_env(compose(["task=nl_reach", "perception=camera"])).without_curriculum()
    with closing(WorkspaceEnv(config, 1, 0, render=True)) as env:
        env.reset()
        perceived: Any = env._perceived
        arrays, reader = env._arrays, perceived._reader
        gripper = arrays.pose.position[0], arrays.pose.rotation[0]
        views = reader._cameras.views(reader._cameras.pictures(env._worlds[0], gripper), gripper)
        frames = env.kinematics.frames(arrays.angles)[..., :3, :][:, 0]
        seen, moment = reader._detector(views), perceived._moment(0, frames)[0]
        network = _milliseconds(lambda: reader._detector(views))
        tracker = _milliseconds(lambda: perceived._trackers[0].update(seen, moment))
    return {"network_and_fusion_ms": network, "tracker_ms": tracker, "perception_ms": network + tracker}


def picture_times(words: list[str]) -> dict[str, Any]:
    """Return the median milliseconds of the front camera's picture: with furniture drawn once, and all anew."""
    config = read_env(compose(words)).without_curriculum()
    with closing(WorkspaceEnv(config, 1, 0, render=True)) as env:
        env.reset()
        world, camera = env._worlds[0], config.workspace.cameras["front"]
        gripper = env._arrays.pose.position[0], env._arrays.pose.rotation[0]
        once = _milliseconds(lambda: world.picture(camera, gripper))
        anew = _milliseconds(lambda: world.photograph(camera, gripper))
    size = f"{camera.width} x {camera.height}"
    return {"picture": " ".join(words), "size": size, "furniture_once_ms": once, "all_anew_ms": anew}


def _milliseconds(function: Callable[[], Any]) -> float:
    """Return the median milliseconds of 200 calls."""
    times = []
    for _ in range(200):
        began = time.perf_counter()
        function()
        times.append(1000 * (time.perf_counter() - began))
    return float(np.median(times))


def results(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield what the options ask for: conditions, tasks or times, each with its figures."""
    if given.told:
        for task in TOLD:
            if given.only in (None, task):
                yield {"task": task, **told([f"task={task}"], given.episodes, given.seed)}
    elif given.time:
        for words in (["task=nl_reach"], ["task=anything"], ["task=nl_reach", "robot=panda"]):
            yield picture_times(words)
        yield perception_times()
    else:
        torch.set_num_threads(1)
        for name, condition in conditions():
            if given.only in (None, name):
                yield {"condition": name, **evaluated(given.checkpoint, given.episodes, given.seed, **condition)}


def line(result: dict[str, Any]) -> str:
    """Return a result as a line for people."""
    if "condition" in result:
        low, high = result["ci95"]
        share = f"{result['success_at_end']:.3f} ({low:.3f} to {high:.3f})"
        return f"{result['condition']:46}{share}, {result['episodes']} episodes"
    figures = {name: f"{value:.4g}" if isinstance(value, float) else value for name, value in result.items()}
    return ", ".join(f"{name} {value}" for name, value in figures.items())


def main(words: list[str]) -> None:
    """Print what the options ask for. Raises ConfigError for a name that no condition and no task has."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", default="nl_reach_kuka")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="one condition, or with --told one task")
    parser.add_argument("--told", action="store_true", help="how right the scenes are that policies are told")
    parser.add_argument("--time", action="store_true", help="how long perception takes")
    parser.add_argument("--json", action="store_true", help="lines of JSON")
    given = parser.parse_args(words)
    known = TOLD if given.told else [name for name, _ in conditions()]
    if given.only not in (None, *known):
        raise ConfigError(f"--only {given.only} is not known" + did_you_mean(given.only, known))
    for result in results(given):
        print(json.dumps(result) if given.json else line(result), flush=True)


if __name__ == "__main__":
    with program():
        main(sys.argv[1:])

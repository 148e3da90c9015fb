"""Pick and place to 90 % success, side by side with panda-gym learned by TQC + HER.

    pip install -e ".[bench]"
    python -m benchmarks.pick_and_place --seeds 0,1 --minutes 75 --out docs/pick_and_place.json

Each pair is our `train.py` and stable-baselines3-contrib's TQC with hindsight on `PandaPickAndPlace-v3`, at once and
with a core each, so that a busy neighbour hits both alike; the cores are swapped from pair to pair. The peer is met in
two settings, since the one that is quicker here is the one to be measured by: `published` is rl-baselines3-zoo 2.9.2's
for the task, `light` has smaller batches and layers and learns at every fourth frame. Other words go to `train.py`.

The clock runs from after the imports and leaves evaluations out, on both sides; the time with them is told beside it.
Both sides judge the deterministic policy on episodes that training never sees: ours over 200, the peer over 50 and,
where those reach the target, over 100 more, which must reach it too. panda-gym counts an episode as solved, and ends
it, once the cube comes within 5 cm of its target, held or not; ours must let go of it and have it at rest.

A side that does not get there in time is told with how far it came, and the ratio is then no more than a bound.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from trainers.run.metrics import Metrics, read_metrics, write_json
from trainers.utils.system_info import machine

ROOT = Path(__file__).resolve().parents[1]
MODULE = "benchmarks.pick_and_place"
PROMISED = 1 / 3  # of the peer's seconds, at most
PEERS = ("panda-gym", "stable-baselines3", "sb3-contrib")
OURS = "task=pick_and_place robot=panda algo=sac total_frames=250_000 logger=[]"
OURS += " eval.interval=20_000 eval.interval_episodes=200"
COLUMNS = ("frames", "eval/success_at_end", "eval/confirmed", "time/evaluate", "time/total")  # as ours names them
SLICE = 100  # frames that the peer learns between two looks at the clock
BETWEEN = 60  # seconds of learning between two evaluations of the peer
EPISODES, CONFIRMING = 50, 100
FIRST_SEED = 1_000_000  # of the peer's evaluation episodes
FRAMES = 1_000_000  # that the peer learns from, at most
POLL, LAST, GRACE = 1, 120, 30  # seconds between two looks, for the peer's last evaluation, and to end after SIGTERM

SHARED = {"learning_rate": 1e-3, "buffer_size": 1_000_000, "tau": 0.05, "gamma": 0.95, "gradient_steps": 1}
HINDSIGHT = {"goal_selection_strategy": "future", "n_sampled_goal": 4}
SETTINGS: dict[str, dict[str, Any]] = {  # learning_starts and train_freq: the zoo leaves TQC's own
    "published": {"batch_size": 2048, "net_arch": [512] * 3, "learning_starts": 100, "train_freq": 1},
    "light": {"batch_size": 256, "net_arch": [256] * 3, "learning_starts": 1_000, "train_freq": 4},
}


class Point(NamedTuple):
    """One evaluation. Seconds leave evaluations out, wall seconds do not. confirmed: None where it was not tried."""

    seconds: float
    wall_seconds: float
    frames: int
    success: float
    confirmed: float | None


class SideError(Exception):
    """A side ended by itself before it was due; with its last words."""


def read_curve(path: Path) -> list[Point]:
    """The evaluations in a metrics.csv, ours or the peer's."""
    points, evaluating = [], 0.0
    for row in read_metrics(path):
        evaluating += row["time/evaluate"]
        total, success = row["time/total"], row["eval/success_at_end"]
        confirmed = row.get("eval/confirmed", success)  # ours needs no second look
        if math.isfinite(success):
            sure = confirmed if math.isfinite(confirmed) else None
            points.append(Point(total - evaluating, total, int(row["frames"]), success, sure))
    return points


def arrival(curve: Iterable[Point], target: float) -> Point | None:
    """The first evaluation that confirms the target."""
    return next((point for point in curve if point.confirmed is not None and point.confirmed >= target), None)


def make_env() -> Any:
    """The peer's task."""
    import gymnasium
    import panda_gym  # noqa: F401  registers its envs

    return gymnasium.make("PandaPickAndPlace-v3")


def make_model(setting: str, seed: int) -> Any:
    """TQC with hindsight and worlds of its own."""
    from sb3_contrib import TQC
    from stable_baselines3 import HerReplayBuffer
    from stable_baselines3.common.monitor import Monitor

    values: dict[str, Any] = SHARED | SETTINGS[setting] | {"seed": seed, "device": "cpu"}
    values["policy_kwargs"] = {"net_arch": values.pop("net_arch"), "n_critics": 2}
    values |= {"replay_buffer_class": HerReplayBuffer, "replay_buffer_kwargs": HINDSIGHT}
    return TQC("MultiInputPolicy", Monitor(make_env()), **values)


def success_of(model: Any, env: Any, seeds: Iterable[int]) -> float:
    """The share of the seeds' episodes that the deterministic policy solves."""
    solved = [_solves(model, env, seed) for seed in seeds]
    return sum(solved) / len(solved)


def _solves(model: Any, env: Any, seed: int) -> bool:
    observation, info = env.reset(seed=seed)
    ended = False
    while not ended:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    return bool(info["is_success"])


def run_peer(setting: str, seed: int, minutes: float, target: float, folder: Path) -> None:
    """Learn until the target is confirmed or the minutes are over, with every evaluation in folder/metrics.csv."""
    import panda_gym  # noqa: F401  imports before the clock starts
    import sb3_contrib  # noqa: F401
    import torch

    torch.set_num_threads(1)
    folder.mkdir(parents=True, exist_ok=True)
    metrics, seeds, ended = Metrics(folder, COLUMNS), itertools.count(FIRST_SEED), False
    began = time.perf_counter()
    deadline = began + 60 * minutes
    model, judge = make_model(setting, seed), make_env()
    while not ended:
        _learn(model, min(time.perf_counter() + BETWEEN, deadline))
        row = _judge(model, judge, seeds, target)
        metrics.write(row | {"frames": model.num_timesteps, "time/total": time.perf_counter() - began})
        spent = time.perf_counter() >= deadline or model.num_timesteps >= FRAMES
        ended = spent or row["eval/confirmed"] >= target  # NaN where it was not tried
    metrics.close()


def _learn(model: Any, end: float) -> None:
    while time.perf_counter() < end and model.num_timesteps < FRAMES:
        model.learn(SLICE, reset_num_timesteps=False)


def _judge(model: Any, env: Any, seeds: Iterator[int], target: float) -> dict[str, float]:
    began = time.perf_counter()
    success, confirmed = success_of(model, env, itertools.islice(seeds, EPISODES)), math.nan
    if success >= target:
        confirmed = success_of(model, env, itertools.islice(seeds, CONFIRMING))
    seconds = time.perf_counter() - began
    return {"eval/success_at_end": success, "eval/confirmed": confirmed, "time/evaluate": seconds}


class Side:
    """One of the two commands of a pair: a process on its core, and what it has written so far.

    command: what follows `python`. where: what more it takes to have its metrics.csv in `folder`.
    """

    def __init__(self, command: Sequence[str], where: Sequence[str], folder: Path, core: int) -> None:
        self.command, self.core = shlex.join(["python", *command]), core
        self.metrics, self.log = folder / "metrics.csv", folder.with_suffix(".log")
        folder.mkdir(parents=True, exist_ok=True)
        with open(self.log, "w") as log:
            self.process = subprocess.Popen(
                [sys.executable, *command, *where],
                cwd=ROOT,
                env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                preexec_fn=lambda: os.sched_setaffinity(0, {core}),
            )

    def over(self, target: float) -> bool:
        """Whether it is there or at its end. Raises SideError where it failed."""
        code = self.process.poll()
        if arrival(read_curve(self.metrics), target):
            return True
        if code:
            words = self.log.read_text(errors="replace").strip().splitlines() or [f"exit code {code}"]
            said = next((line for line in reversed(words) if "rror" in line), words[-1])
            raise SideError(f"{said.removeprefix('error: ')} ({self.log})")
        return code is not None

    def close(self) -> None:
        """End it and whatever it started."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(GRACE)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()

    def result(self, target: float) -> dict[str, Any]:
        """What came of it."""
        curve = read_curve(self.metrics)
        there = arrival(curve, target)
        return {
            "command": self.command,
            "core": self.core,
            "reached": there._asdict() if there else None,
            "last": curve[-1]._asdict() if curve else None,
            "best": max((point.success for point in curve), default=None),
            "curve": [list(point) for point in curve],
        }


def wait_for(sides: Sequence[Side], target: float, deadline: float) -> None:
    """Until every side is there or at its end, or the time is over; who is there is stopped. Raises SideError."""
    running = list(sides)
    while running and time.monotonic() < deadline:
        for side in [side for side in running if side.over(target)]:
            side.close()
            running.remove(side)
        time.sleep(POLL)


def our_overrides(typed: Sequence[str], seed: int) -> list[str]:
    """Ours, those typed in their place, and the seed."""
    keys = {word.split("=")[0] for word in typed}
    return [*(word for word in OURS.split() if word.split("=")[0] not in keys), *typed, f"seed={seed}"]


def run_pair(args: argparse.Namespace, setting: str, seed: int, cores: Sequence[int]) -> dict[str, Any]:
    """Both sides at once. Raises SideError."""
    folder = args.runs.resolve() / time.strftime("%Y-%m-%d_%H-%M-%S") / f"{setting}-s{seed}"
    limits = ["--minutes", f"{args.minutes:g}", "--target", f"{args.target:g}"]
    ours = ["train.py", *our_overrides(args.overrides, seed)]
    peer = ["-m", MODULE, "--settings", setting, "--seeds", str(seed), *limits]
    our_place, peer_place = folder / "ours", folder / "peer"
    with (
        closing(Side(ours, [f"hydra.run.dir={our_place}"], our_place, cores[0])) as we,
        closing(Side(peer, ["--peer-log", str(peer_place)], peer_place, cores[1])) as they,
    ):
        wait_for((we, they), args.target, time.monotonic() + 60 * args.minutes + LAST)
    return {"setting": setting, "seed": seed, **compared(we.result(args.target), they.result(args.target))}


def compared(ours: dict[str, Any], peer: dict[str, Any]) -> dict[str, Any]:
    """Both sides, and our seconds and frames over the peer's: at most that where the peer did not get there."""
    mark = peer["reached"] or peer["last"]
    ratio: dict[str, Any] = {"seconds": None, "frames": None}
    if ours["reached"] and mark:
        ratio = {name: ours["reached"][name] / mark[name] for name in ratio}
    return {"ours": ours, "peer": peer, "ours_over_peer": {**ratio, "at_most": peer["reached"] is None}}


def side_row(pair: dict[str, Any], name: str) -> list[str]:
    """One side of a pair: when it was there, or how far it came."""
    side = pair[name]
    mark, head = side["reached"] or side["last"], [pair["setting"], str(pair["seed"]), name]
    if mark is None:
        return [*head, "never judged", "-", "-", "-", "-"]
    numbers = [f"{mark['seconds']:,.0f}", f"{mark['wall_seconds']:,.0f}", f"{mark['frames']:,}"]
    shown = [number if side["reached"] else f"not after {number}" for number in numbers]
    return [*head, *shown, f"{side['best']:.2f}", f"{mark['frames'] / mark['seconds']:,.0f}"]


def ratio_line(pair: dict[str, Any]) -> str:
    """Our seconds and frames over the peer's, and whether the promise holds."""
    ratio, name = pair["ours_over_peer"], f"{pair['setting']}, seed {pair['seed']}"
    if ratio["seconds"] is None:
        return f"{name}: nothing to compare"
    sign = "<" if ratio["at_most"] else "="
    holds = "holds" if ratio["seconds"] <= PROMISED else "not shown" if ratio["at_most"] else "does not hold"
    return f"{name}: ours/peer {sign} {ratio['seconds']:.3f} (seconds), {sign} {ratio['frames']:.3f} (frames): {holds}"


def table(pairs: Sequence[dict[str, Any]], target: float) -> str:
    """A row for each side, then a line for each pair."""
    head = ["peer", "seed", "side", f"seconds to {target:.0%}", "with evaluation", "frames", "best", "frames/s"]
    rows = [side_row(pair, name) for pair in pairs for name in ("ours", "peer")]
    lines = ["| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows)]
    return "\n".join([*lines, "", *map(ratio_line, pairs)])


def peer_versions() -> dict[str, str]:
    """Exits with one line where something is missing."""
    try:
        return {package: metadata.version(package) for package in PEERS}
    except metadata.PackageNotFoundError as error:
        sys.exit(f'error: {error.name} is not here: pip install -e ".[bench]"')


def compare(args: argparse.Namespace) -> None:
    """Every pair, the JSON file written anew after each. Raises SideError."""
    about: dict[str, Any] = {"command": shlex.join(["python", "-m", MODULE, *sys.argv[1:]]), "target": args.target}
    about |= {"machine": machine() | peer_versions() | {"load_before": os.getloadavg()[0]}}
    about |= {"peer": {"shared": SHARED, "hindsight": HINDSIGHT, **SETTINGS}, "curve": Point._fields}
    cores, pairs = sorted(os.sched_getaffinity(0))[:2], []
    if len(cores) < 2:
        sys.exit("error: two cores are needed, one a side")
    for seed, setting in itertools.product(args.seeds, args.settings):
        pairs.append(run_pair(args, setting, seed, cores))
        cores = cores[::-1]
        print(ratio_line(pairs[-1]), file=sys.stderr, flush=True)
        args.out.parent.mkdir(parents=True, exist_ok=True)
        write_json(args.out, about | {"pairs": pairs})
    print(table(pairs, args.target))


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("overrides", nargs="*", help=f"for train.py, in place of {OURS}")
    options.add_argument("--settings", default=",".join(SETTINGS), help="of the peer, a pair for each")
    options.add_argument("--seeds", default="0", help="a pair for each with each setting: 0,1,2")
    options.add_argument("--minutes", type=float, default=75.0, help="that a pair may take")
    options.add_argument("--target", type=float, default=0.9, help="success to be reached")
    options.add_argument("--out", type=Path, default=ROOT / "docs" / "pick_and_place.json")
    options.add_argument("--runs", type=Path, default=ROOT / "outputs" / "pick_and_place", help="where runs are left")
    options.add_argument("--peer-log", type=Path, metavar="FOLDER", help="run the peer alone, its metrics.csv here")
    return options


def main() -> None:
    """Compare, or run the peer alone."""
    options = parser()
    args = options.parse_intermixed_args()
    args.settings, seeds = args.settings.split(","), args.seeds.split(",")
    if unknown := set(args.settings) - set(SETTINGS):
        options.error(f"no setting {', '.join(sorted(unknown))}; there are {', '.join(SETTINGS)}")
    if args.minutes <= 0 or not 0 < args.target <= 1 or not all(seed.isdecimal() for seed in seeds):
        options.error("--minutes is greater than 0, --target greater than 0 and at most 1, --seeds are numbers")
    args.seeds = [int(seed) for seed in seeds]
    peer_versions()
    try:
        if args.peer_log:
            run_peer(args.settings[0], args.seeds[0], args.minutes, args.target, args.peer_log)
        else:
            compare(args)
    except SideError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()

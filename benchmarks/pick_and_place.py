"""Time to 90 % success in pick and place, beside panda-gym learned by TQC + HER.

    pip install -e ".[bench]"
    python -m benchmarks.pick_and_place --seeds 0,1 --minutes 75 --out docs/pick_and_place.json

A pair is our `train.py` and stable-baselines3-contrib's TQC with hindsight on `PandaPickAndPlace-v3`. Both run at the
same time on a core each, so that other load affects both alike; the cores are swapped from pair to pair. The peer has
two settings, since the one that is faster on this machine is the fair comparison: `published` and `light` are ZOO and
LIGHT of `examples/other_learners.py`. Positional arguments go to `train.py`.

Conditions, the same for both sides:

* The clock starts after the imports and leaves evaluations out; the time with evaluations is reported beside it.
* The deterministic policy is evaluated in episodes that training never sees: ours in 200; the peer's in 50 and, if
  those reach the target, in 100 more, which must reach it too.
* panda-gym counts an episode as solved, and ends it, once the cube is within 5 cm of its target, held or not. Ours must
  release the cube, at rest.

If a side does not reach the target in time, its last evaluation is reported, and the ratio is an upper bound.
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
from collections.abc import Sequence
from contextlib import closing
from importlib import metadata
from pathlib import Path
from typing import Any

from core.system import system_info
from examples.other_learners import EVALUATED, HINDSIGHT, LIGHT, ZOO, make_model, make_worlds, success_rate
from tools.peer_comparison import (
    COLUMNS,
    OUR_OVERRIDES,
    Evaluation,
    compare_sides,
    first_at_target,
    our_overrides,
    ratio_line,
    read_curve,
    summarize,
    table,
)
from trainers.run.metrics import MetricsWriter
from trainers.utils.files import write_json

ROOT = Path(__file__).resolve().parents[1]
MODULE = "benchmarks.pick_and_place"
ENV, LEARNER = "PandaPickAndPlace-v3", "sb3-tqc"
PEERS = ("panda-gym", "stable-baselines3", "sb3-contrib")
FRAMES_PER_CHECK = 100  # frames that the peer learns between two checks of the clock
EVALUATION_INTERVAL = 60  # seconds of learning between two evaluations of the peer
EPISODES, CONFIRMATION_EPISODES = 50, 100  # of the peer's evaluations
MAX_PEER_FRAMES = 1_000_000
POLL_INTERVAL = 1  # seconds
LAST_EVALUATION = 120  # seconds that the peer's last evaluation may take after the deadline
TERMINATION_TIMEOUT = 30  # seconds after SIGTERM

SETTINGS = {"published": ZOO, "light": LIGHT}


class SideError(Exception):
    """A side ended by itself with an error. The text is the last line of its log that names one."""


# ---- The peer


def run_peer(setting: str, seed: int, minutes: float, target: float, folder: Path) -> None:
    """Learn until the target is confirmed or the minutes are over. Writes every evaluation to folder/metrics.csv."""
    import panda_gym  # noqa: F401  imports before the clock starts
    import sb3_contrib  # noqa: F401
    import torch

    torch.set_num_threads(1)
    folder.mkdir(parents=True, exist_ok=True)
    metrics, ended = MetricsWriter(folder, COLUMNS), False
    start = time.perf_counter()
    deadline = start + 60 * minutes
    model = make_model(ENV, LEARNER, make_worlds(ENV, 1, flat=False), SETTINGS[setting], seed, flat=False)
    worlds = make_worlds(ENV, 1, flat=False, evaluated=True)
    worlds.seed(EVALUATED)
    while not ended:
        _learn(model, min(time.perf_counter() + EVALUATION_INTERVAL, deadline))
        row = _evaluate(model, worlds, target)
        metrics.write(row | {"frames": model.num_timesteps, "time/total": time.perf_counter() - start})
        spent = time.perf_counter() >= deadline or model.num_timesteps >= MAX_PEER_FRAMES
        ended = spent or row["eval/confirmed"] >= target  # NaN if there were no further episodes
    metrics.close()


def _learn(model: Any, end: float) -> None:
    while time.perf_counter() < end and model.num_timesteps < MAX_PEER_FRAMES:
        model.learn(FRAMES_PER_CHECK, reset_num_timesteps=False)


def _evaluate(model: Any, worlds: Any, target: float) -> dict[str, float]:
    start = time.perf_counter()
    success, confirmed = success_rate(model, worlds, EPISODES), math.nan
    if success >= target:
        confirmed = success_rate(model, worlds, CONFIRMATION_EPISODES)
    seconds = time.perf_counter() - start
    return {"eval/success_at_end": success, "eval/confirmed": confirmed, "time/evaluation_wait": seconds}


# ---- Both sides


class Side:
    """One process of a pair, on its core."""

    def __init__(self, command: Sequence[str], output: Sequence[str], folder: Path, core: int) -> None:
        """Start the process.

        Args:
            command: arguments after `python`.
            output: further arguments that put its metrics.csv into `folder`.
            folder: of its files; its log lies beside it.
            core: that it may use.
        """
        self.command, self.core = shlex.join(["python", *command]), core
        self.metrics, self.log = folder / "metrics.csv", folder.with_suffix(".log")
        folder.mkdir(parents=True, exist_ok=True)
        with open(self.log, "w") as log:
            self.process = subprocess.Popen(
                [sys.executable, *command, *output],
                cwd=ROOT,
                env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                preexec_fn=lambda: os.sched_setaffinity(0, {core}),
            )

    def finished(self, target: float) -> bool:
        """Return whether it reached the target or ended. Raises SideError if it failed."""
        code = self.process.poll()
        if first_at_target(read_curve(self.metrics), target):
            return True
        if code:
            lines = self.log.read_text(errors="replace").strip().splitlines() or [f"exit code {code}"]
            message = next((line for line in reversed(lines) if "rror" in line), lines[-1])
            raise SideError(f"{message.removeprefix('error: ')} ({self.log})")
        return code is not None

    def close(self) -> None:
        """End the process and those that it started."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(TERMINATION_TIMEOUT)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()

    def result(self, target: float) -> dict[str, Any]:
        """Return command, core, summary and learning curve."""
        curve = read_curve(self.metrics)
        result = {"command": self.command, "core": self.core, **summarize(curve, target)}
        return result | {"curve": [list(each) for each in curve]}


def wait_for(sides: Sequence[Side], target: float, deadline: float) -> None:
    """Wait until both sides have finished or the time is over; end a side that has. Raises SideError."""
    running = list(sides)
    while running and time.monotonic() < deadline:
        for side in [side for side in running if side.finished(target)]:
            side.close()
            running.remove(side)
        time.sleep(POLL_INTERVAL)


def run_pair(args: argparse.Namespace, setting: str, seed: int, cores: Sequence[int]) -> dict[str, Any]:
    """Run both sides at the same time. Raises SideError."""
    folder = args.runs.resolve() / time.strftime("%Y-%m-%d_%H-%M-%S") / f"{setting}-s{seed}"
    limits = ["--minutes", f"{args.minutes:g}", "--target", f"{args.target:g}"]
    our_command = ["train.py", *our_overrides(args.overrides, seed)]
    peer_command = ["-m", MODULE, "--settings", setting, "--seeds", str(seed), *limits]
    our_folder, peer_folder = folder / "ours", folder / "peer"
    with (
        closing(Side(our_command, [f"hydra.run.dir={our_folder}"], our_folder, cores[0])) as ours,
        closing(Side(peer_command, ["--peer-log", str(peer_folder)], peer_folder, cores[1])) as peer,
    ):
        wait_for((ours, peer), args.target, time.monotonic() + 60 * args.minutes + LAST_EVALUATION)
    return {"setting": setting, "seed": seed, **compare_sides(ours.result(args.target), peer.result(args.target))}


def peer_versions() -> dict[str, str]:
    """Return versions of the peer's packages. Exits with one line if one is missing."""
    try:
        return {package: metadata.version(package) for package in PEERS}
    except metadata.PackageNotFoundError as error:
        sys.exit(f'error: {error.name} is not installed: pip install -e ".[bench]"')


def compare(args: argparse.Namespace) -> None:
    """Run every pair and rewrite the JSON file after each. Raises SideError."""
    about: dict[str, Any] = {"command": shlex.join(["python", "-m", MODULE, *sys.argv[1:]]), "target": args.target}
    about |= {"machine": system_info() | peer_versions() | {"load_before": os.getloadavg()[0]}}
    about |= {"peer": {"hindsight": HINDSIGHT, **SETTINGS}, "curve": Evaluation._fields}
    cores, pairs = sorted(os.sched_getaffinity(0))[:2], []
    if len(cores) < 2:
        sys.exit("error: two cores are required, one for each side")
    for seed, setting in itertools.product(args.seeds, args.settings):
        pairs.append(run_pair(args, setting, seed, cores))
        cores = cores[::-1]
        print(ratio_line(pairs[-1]), file=sys.stderr, flush=True)
        args.out.parent.mkdir(parents=True, exist_ok=True)
        write_json(args.out, about | {"pairs": pairs})
    print(table(pairs, args.target))


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("overrides", nargs="*", help=f"for train.py, in place of {OUR_OVERRIDES}")
    options.add_argument("--settings", default=",".join(SETTINGS), help="settings of the peer, a pair for each")
    options.add_argument("--seeds", default="0", help="0,1,2: a pair for each, with each setting")
    options.add_argument("--minutes", type=float, default=75.0, help="limit for a pair")
    options.add_argument("--target", type=float, default=0.9, help="success to reach")
    options.add_argument("--out", type=Path, default=ROOT / "docs" / "pick_and_place.json")
    options.add_argument("--runs", type=Path, default=ROOT / "outputs" / "pick_and_place", help="folder for the runs")
    options.add_argument("--peer-log", type=Path, metavar="FOLDER", help="only run the peer, with its metrics.csv here")
    return options


def main() -> None:
    """Compare, or runs the peer only."""
    options = parser()
    args = options.parse_intermixed_args()
    args.settings, seeds = args.settings.split(","), args.seeds.split(",")
    if unknown := set(args.settings) - set(SETTINGS):
        options.error(f"no setting {', '.join(sorted(unknown))}; choose from {', '.join(SETTINGS)}")
    if args.minutes <= 0 or not 0 < args.target <= 1 or not all(seed.isdecimal() for seed in seeds):
        options.error("--minutes must be greater than 0, --target greater than 0 and at most 1, --seeds numbers")
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

"""Seconds from the start of a training command until its evaluations reach a success rate.

    python -m benchmarks.time_to_success --seeds 0,1,2,3,4
    python -m benchmarks.time_to_success --seeds 0 scenario=2

Runs `python train.py` with the given overrides, one seed after the other, and prints a table: when the first evaluation
of at least 0.90, 0.95 and 0.97 was printed, how long the whole command took, how busy the machine was, and the final
evaluation. All seconds are wall-clock time from the start of the process; they include imports, worlds, evaluations and
the report. A second table divides the seconds of our runs into parts.

`--peer ppo` or `--peer sac` trains stable-baselines3's algorithm with its default hyperparameters on the Gymnasium
environment of the same task instead, with evaluations after as many frames, until its success or `--frames` is reached.
It needs `pip install -e ".[bench]"`. With `--peer-process` the peer is trained in this process. It prints a JSON line
{"frames", "success"} after each interval, of 200 episodes of the deterministic policy, and {"final": [success, low,
high]} of 500 at the end: after `--frames`, or once an evaluation has reached 0.97.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trainers.evaluation.evaluation import wilson
from trainers.run.metrics import read_metrics

ROOT = Path(__file__).resolve().parents[1]
RATES = (0.90, 0.95, 0.97)
ENOUGH = 0.97  # success of a peer, at which its training ends
EPISODES, FINAL_EPISODES = 200, 500  # of the evaluations of a peer
PARTS = ("start", "collecting", "updating", "waiting for evaluations", "last evaluation and report")


@dataclass(frozen=True)
class Run:
    """One training. evaluations: (seconds, frames, success). final: success and its 95 % interval."""

    seed: int
    evaluations: Sequence[tuple[float, int, float]]
    seconds: float
    busy: float  # share of the machine's CPU time that anything used meanwhile
    final: tuple[float, float, float]
    parts: Sequence[float] = ()  # seconds of each of PARTS; of our runs alone

    def reached(self, rate: float) -> str:
        """Return when an evaluation was first at this success rate, and after how many frames."""
        first = next(((at, frames) for at, frames, success in self.evaluations if success >= rate), None)
        return "not reached" if first is None else f"{first[0]:.0f} s ({first[1]:,})"


def train(seed: int, overrides: Sequence[str]) -> Run:
    """Run `python train.py`. Raises CalledProcessError where it fails."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        command = [sys.executable, "train.py", f"seed={seed}", f"hydra.run.dir={folder}", *overrides]
        lines, seconds, busy = watched(command)
        seconds_at = {int(line.split()[0]): at for at, line in lines if " frames, " in line}
        measured = read_metrics(folder / "metrics.csv")
        rows = [row for row in measured if row["eval/success_at_end"] >= 0]
        evaluations = [(seconds_at[int(r["frames"])], int(r["frames"]), r["eval/success_at_end"]) for r in rows]
        result = json.loads((folder / "eval.json").read_text())
    final = (result["success_at_end"], *result["ci95"])
    imports = evaluations[0][0] - rows[0]["time/evaluated"]  # seconds before the clock of the run itself starts
    return Run(seed, evaluations, seconds, busy, final, parts_of(measured, seconds, imports))


def parts_of(rows: Sequence[Mapping[str, float]], seconds: float, imports: float) -> list[float]:
    """Return seconds of each of PARTS. Collecting: the time that training waited for batches.

    Args:
        rows: of metrics.csv.
        seconds: of the whole command.
        imports: those of them before the clock of the run itself starts.
    """
    collecting, updating, waiting = (
        sum(row[f"time/{name}"] for row in rows) for name in ("collect", "update", "evaluate")
    )
    end = seconds - imports - rows[-1]["time/total"]
    return [seconds - end - collecting - updating - waiting, collecting, updating, waiting, end]


def train_peer(name: str, seed: int, frames: int, interval: int, env_id: str) -> Run:
    """Run stable-baselines3's PPO or SAC, in a process of its own."""
    program = [sys.executable, "-m", "benchmarks.time_to_success", "--peer", name, "--peer-process"]
    options = {"--env": env_id, "--seeds": seed, "--frames": frames, "--interval": interval}
    lines, seconds, busy = watched([*program, *(f"{option}={value}" for option, value in options.items())])
    results = [(at, json.loads(line)) for at, line in lines if line.startswith("{")]
    *rows, (_, last) = [(at, result) for at, result in results]
    evaluations = [(at, int(row["frames"]), float(row["success"])) for at, row in rows]
    return Run(seed, evaluations, seconds, busy, tuple(last["final"]))


def train_peer_here(name: str, seed: int, frames: int, interval: int, env_id: str) -> None:
    """Train stable-baselines3's PPO or SAC with its default hyperparameters, and print the evaluations."""
    import gymnasium
    import stable_baselines3
    import torch
    from stable_baselines3.common.vec_env import SubprocVecEnv

    torch.set_num_threads(2 if name == "sac" else 1)
    known = f"envs:{env_id}"  # the module that registers it, which subprocesses import too
    one = gymnasium.make(known)
    given: Any = SubprocVecEnv([lambda: gymnasium.make(known) for _ in range(2)]) if name == "ppo" else one
    model = getattr(stable_baselines3, name.upper())("MultiInputPolicy", given, seed=seed, device="cpu")
    success, done = 0.0, 0
    while done < frames and success < ENOUGH:
        model.learn(interval, reset_num_timesteps=not done)
        done, success = model.num_timesteps, success_of(model, one, EPISODES, 10**6 * (1 + done))
        print(json.dumps({"frames": done, "success": success}), flush=True)
    final = success_of(model, one, FINAL_EPISODES, 10**9)
    low, high = wilson(round(final * FINAL_EPISODES), FINAL_EPISODES)
    print(json.dumps({"final": [final, low, high]}), flush=True)


def success_of(model: Any, env: Any, episodes: int, seed: int) -> float:
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


def watched(command: Sequence[str]) -> tuple[list[tuple[float, str]], float, float]:
    """Run a command; return its lines with their seconds since the start, its seconds, and how busy the machine was."""
    before, start = _cpu_ticks(), time.monotonic()
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        lines = [(time.monotonic() - start, line) for line in process.stdout]
    seconds = time.monotonic() - start
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    used, total = (after - earlier for after, earlier in zip(_cpu_ticks(), before, strict=True))
    return lines, seconds, used / total


def _cpu_ticks() -> tuple[int, int]:
    """Return the machine's CPU ticks, used and in total. Workers have a parent of their own to account to."""
    ticks = [int(each) for each in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return sum(ticks) - ticks[3] - ticks[4], sum(ticks)  # without idle and iowait


def table(runs: Sequence[Run]) -> Iterator[str]:
    """Yield the lines of a Markdown table, a row for each run."""
    yield "| seed | " + " | ".join(f"first {rate:.2f}" for rate in RATES) + " | whole command | busy | final |"
    yield "|---" * (len(RATES) + 4) + "|"
    for run in runs:
        success, low, high = run.final
        cells = [str(run.seed), *map(run.reached, RATES), f"{run.seconds:.0f} s", f"{run.busy:.0%}"]
        yield f"| {' | '.join(cells)} | {success:.3f} ({low:.3f}-{high:.3f}) |"


def parts_table(runs: Sequence[Run]) -> Iterator[str]:
    """Yield the lines of a Markdown table: the parts of the seconds of each run."""
    yield "| seed | " + " | ".join(PARTS) + " |"
    yield "|---" * (len(PARTS) + 1) + "|"
    for run in runs:
        yield f"| {run.seed} | " + " | ".join(f"{part:.1f} s" for part in run.parts) + " |"


def main() -> None:
    """Train, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0", help="0,1,2")
    parser.add_argument("--peer", choices=("ppo", "sac"), help="stable-baselines3's algorithm, in place of train.py")
    parser.add_argument("--peer-process", action="store_true", help="train the peer in this process, with one seed")
    parser.add_argument("--env", default="Deixis/NLReach-v0", help="of a peer")
    parser.add_argument("--frames", type=int, default=1_000_000, help="at most, of a peer")
    parser.add_argument("--interval", type=int, default=20_000, help="frames between two evaluations of a peer")
    parser.add_argument("overrides", nargs="*", help="of train.py")
    args = parser.parse_args()
    if args.peer_process and not (args.peer and args.seeds.isdecimal()):
        parser.error("--peer-process needs --peer and one seed")
    if args.peer_process:
        train_peer_here(args.peer, int(args.seeds), args.frames, args.interval, args.env)
        return
    runs = []
    for seed in map(int, args.seeds.split(",")):
        if args.peer:
            runs.append(train_peer(args.peer, seed, args.frames, args.interval, args.env))
        else:
            runs.append(train(seed, args.overrides))
        print(list(table(runs))[-1], file=sys.stderr, flush=True)
    print("\n".join([*table(runs), "", *([] if args.peer else parts_table(runs))]))


if __name__ == "__main__":
    main()

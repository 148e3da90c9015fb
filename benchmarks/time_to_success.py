"""Seconds from the start of a training command until its evaluations reach a success rate.

    python -m benchmarks.time_to_success --seeds 0,1,2,3,4
    python -m benchmarks.time_to_success --seeds 0 scenario=2
    python -m benchmarks.time_to_success --env PandaReach-v3 --seeds 0,1,2 --budget 300 --json
    python -m benchmarks.time_to_success --recorded result.txt

Without `--env` it runs `python train.py` with the given overrides, one seed after the other, and prints a table: when
the first evaluation of at least 0.90, 0.95 and 0.97 was printed, how long the whole command took, how busy the machine
was, and the final evaluation. All seconds are wall-clock time from the start of the process; they include imports,
worlds, evaluations and the report. A second table divides the seconds of our runs into parts.

With `--env` it runs our learners and those of stable-baselines3 and SBX (`pip install -e ".[bench]"`) in the same
Gymnasium environment, one run at a time, in turn: all learners with the first seed, then all in reverse order with the
next. Each run is a command of its own, whose start is second 0, so that imports, worlds and compilation count:

* ours: `train.py` where the id has words, else `examples/goal_env.py`; overrides are added to it.
* a peer: `examples/other_learners.py`, which has the peers' settings in one table, with their source.

An evaluation is of the deterministic policy over 200 episodes. It counts alike for all: each learner of an algorithm
evaluates after as many frames, and stands still meanwhile (`eval.overlap=false`), and these seconds are left out, with
those of building the worlds of evaluations. Only worker processes of ours go on, to the end of the batch that they are
at. A run ends at its first success of at least 0.97, once its budget of seconds is used up ("not reached"), or with its
frames.

`--json` makes the last line one of JSON; `--recorded` prints the tables of a file that ends with such a line.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shlex
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from core.errors import ConfigError, RunError, did_you_mean
from core.program import program
from core.safe_files import FileError, read_text
from core.system import signal_at_parent_death
from tools.peer_comparison import read_curve
from trainers.run.metrics import read_metrics

ROOT = Path(__file__).resolve().parents[1]
RATES = (0.90, 0.95, 0.97)
PARTS = ("start", "collecting", "updating", "waiting for evaluations", "last evaluation and report")
LIBRARIES = {"ours": (), "sb3": ("stable_baselines3",), "sbx": ("stable_baselines3", "sbx")}  # and what they import
ALGORITHMS = ("ppo", "sac", "tqc")
LEARNERS = "ours-ppo,sb3-ppo,sbx-ppo,ours-sac,sb3-sac,sbx-sac"
STOPPED = 30.0  # seconds that a process may take to end after SIGTERM
MAX_BYTES = 8 * 2**20  # of a recorded file

Line = tuple[float, str]  # seconds since the start of a command, and what it printed
Evaluated = tuple[float, int, float]  # seconds, frames, success


class ComparedEnv(NamedTuple):
    """An environment. interval: frames between two evaluations of SAC and TQC. ppo, replay: overrides of ours."""

    interval: int
    ppo: str
    replay: str  # of SAC and TQC


PPO_INTERVALS = 5  # PPO evaluates after so many times the frames, of which it makes about as many more a second
PANDA = "collector.worlds=16"  # a world of panda-gym takes about as much memory as four of ours
PANDA_REACH = (  # one process, since the start of another takes longer than all of its frames
    "total_frames=10_000 collector.worlds=8 collector.workers=1 algo.updates_per_frame=1 algo.learning_starts=500"
)
COMPARED = {  # total_frames is a setting: learning rates fall to 0 over it
    "Deixis/NLReach-v0": ComparedEnv(4_000, "total_frames=80_000", "total_frames=100_000"),
    "Deixis/NLPush-v0": ComparedEnv(15_000, "total_frames=300_000", "algo.updates_per_frame=0.5 total_frames=300_000"),
    "Deixis/Reach-v0": ComparedEnv(2_000, "total_frames=80_000", "total_frames=40_000"),
    "Deixis/Push-v0": ComparedEnv(15_000, "total_frames=1_000_000", "total_frames=300_000"),
    "PandaReach-v3": ComparedEnv(1_000, f"total_frames=100_000 {PANDA}", PANDA_REACH),
    "PandaPush-v3": ComparedEnv(20_000, f"total_frames=1_000_000 {PANDA}", f"total_frames=400_000 {PANDA}"),
    "PandaPickAndPlace-v3": ComparedEnv(20_000, f"total_frames=1_000_000 {PANDA}", f"total_frames=600_000 {PANDA}"),
}


@dataclass(frozen=True)
class Run:
    """One training. final: success of the last evaluation of train.py, and its 95 % interval."""

    seed: int
    evaluations: Sequence[Evaluated]
    seconds: float
    busy: float  # share of the machine's CPU time that anything used meanwhile
    learner: str = ""
    final: Sequence[float] = ()
    parts: Sequence[float] = ()  # seconds of each of PARTS; of train.py alone

    def first(self, rate: float) -> Evaluated | None:
        """Return the first evaluation of this success rate."""
        return next((each for each in self.evaluations if each[2] >= rate), None)

    def reached(self, rate: float) -> str:
        """Return when an evaluation was first at this success rate, and after how many frames."""
        first = self.first(rate)
        return "not reached" if first is None else f"{first[0]:.0f} s ({first[1]:,})"


# ---- train.py alone


def train(seed: int, overrides: Sequence[str]) -> Run:
    """Run `python train.py`. Raises RunError where it fails."""
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
    return Run(seed, evaluations, seconds, busy, final=final, parts=parts_of(measured, seconds, imports))


def parts_of(rows: Sequence[Mapping[str, float]], seconds: float, imports: float) -> list[float]:
    """Return seconds of each of PARTS. Collecting: the time that training waited for batches.

    Args:
        rows: of metrics.csv.
        seconds: of the whole command.
        imports: those of them before the clock of the run itself starts.
    """
    collecting, updating, waiting = (
        sum(row[f"time/{name}"] for row in rows) for name in ("collect", "update", "evaluation_wait")
    )
    end = seconds - imports - rows[-1]["time/total"]
    return [seconds - end - collecting - updating - waiting, collecting, updating, waiting, end]


def table(runs: Sequence[Run]) -> Iterator[str]:
    """Yield the lines of a Markdown table, a row for each run of train.py."""
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


# ---- Learners in one environment


def command_of(learner: str, seed: int, given: argparse.Namespace, folder: Path) -> list[str]:
    """Return the command of a run, without Python. folder: of our run."""
    compared, algorithm = COMPARED[given.env], learner.split("-")[1]
    interval = compared.interval * (PPO_INTERVALS if algorithm == "ppo" else 1)
    if not learner.startswith("ours"):
        options = ["--seed", str(seed), "--interval", str(interval), "--episodes", str(given.episodes)]
        options += ["--frames", str(given.frames or 10**9), *["--zoo"] * given.zoo]
        return ["examples/other_learners.py", given.env, learner, *options]
    words = dict(word.split("=", 1) for word in (compared.ppo if algorithm == "ppo" else compared.replay).split())
    words |= {"algo": algorithm, "seed": str(seed), "eval.overlap": "false", "eval.interval": str(interval)}
    words |= {"eval.interval_episodes": str(given.episodes), "eval.episodes": str(given.episodes), "logger": "[]"}
    words |= {"eval.video_episodes": "0"} | ({"total_frames": str(given.frames)} if given.frames else {})
    words |= dict(word.split("=", 1) for word in given.overrides)
    if not given.env.startswith("Deixis/NL"):
        return ["examples/goal_env.py", given.env, *map("=".join, words.items()), "--folder", str(folder)]
    words |= {"task": task_of(given.env), "hydra.run.dir": str(folder)}
    return ["train.py", *map("=".join, words.items())]


def task_of(env: str) -> str:
    """Return the option of `task=` of an id."""
    from core.overrides import groups
    from envs.registration import gym_id

    return next(task for task in groups()["task"] if gym_id(task) == env)


def run_learner(learner: str, seed: int, given: argparse.Namespace) -> tuple[Run, str]:
    """Return a run, and its settings as text. Raises RunError where its command fails."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        words = command_of(learner, seed, given, folder)
        metrics = folder / "metrics.csv" if learner.startswith("ours") else None
        lines, seconds, busy = watched([sys.executable, *words], partial(is_over, metrics, given.budget))
        evaluations, _ = progress_of(lines, metrics)
        settings = shlex.join(word for word in words if str(folder) not in word and word != "--folder")
        if metrics is None:
            settings = next(json.dumps(each["settings"]) for _, each in objects(lines) if "settings" in each)
    within = [each for each in evaluations if each[0] <= given.budget]
    return Run(seed, within, seconds, busy, learner), settings.replace(f"seed={seed} ", "")


def progress_of(lines: Sequence[Line], metrics: Path | None) -> tuple[list[Evaluated], float]:
    """Return the evaluations of a run so far, with seconds that leave out evaluations, and the seconds of these.

    metrics: metrics.csv of our run; None for a peer's, which prints all of that.
    """
    if metrics is None:
        told = [(at, each) for at, each in objects(lines) if "evaluating" in each]
        curve = [(at - each["evaluating"], each["frames"], each["success"]) for at, each in told if "success" in each]
        return curve, told[-1][1]["evaluating"] if told else 0.0
    first = next((at for at, line in lines if ": success " in line), None)
    rows = [row for row in read_metrics(metrics) if row["time/evaluated"] >= 0]
    if first is None or not rows:
        return [], 0.0
    imports = first - rows[0]["time/evaluated"]  # seconds before the clock of the run itself starts
    found = read_curve(metrics)
    curve = [(imports + each.seconds, each.frames, each.success) for each in found]
    return curve, found[-1].wall_seconds - found[-1].seconds


def is_over(metrics: Path | None, budget: float, lines: Sequence[Line]) -> bool:
    """Return whether a run has reached the last of RATES, or used its budget of seconds."""
    evaluations, evaluating = progress_of(lines, metrics)
    return lines[-1][0] - evaluating > budget or any(success >= RATES[-1] for *_, success in evaluations)


def objects(lines: Sequence[Line]) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield the lines that are JSON objects."""
    for at, line in lines:
        if line.startswith("{"):
            yield at, json.loads(line)


def summary(runs: Sequence[Run], budget: float) -> dict[str, Any]:
    """Return the medians of seconds by learner and rate, and our best over the peers' best; None: not reached.

    The names of rates are percentages. Where no peer reached a rate, its seconds are at least the budget, and the ratio
    is an upper bound: it is in `at_most`.
    """
    names = {rate: f"{rate:.0%}".rstrip("%") for rate in RATES}
    medians: dict[str, dict[str, float]] = {}
    for learner in dict.fromkeys(run.learner for run in runs):
        firsts = {rate: [run.first(rate) for run in runs if run.learner == learner] for rate in RATES}
        reached = {rate: [each[0] if each else math.inf for each in found] for rate, found in firsts.items()}
        medians[learner] = {names[rate]: statistics.median(found) for rate, found in reached.items()}
    ratios, at_most = {}, []
    for name in names.values():
        ours, peer = (
            [found[name] for learner, found in medians.items() if learner.startswith("ours") == own]
            for own in (True, False)
        )
        known = peer and min(ours, default=math.inf) < math.inf
        ratios[name] = min(ours) / min(*peer, budget) if known else None
        at_most += [name] if known and min(peer) == math.inf else []
    shown = {
        learner: {name: None if s == math.inf else s for name, s in found.items()} for learner, found in medians.items()
    }
    return {"seconds": shown, "ours_over_best_peer": ratios, "at_most": at_most}


def comparison(recorded: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of Markdown tables: a row for each run, the medians, and the settings."""
    runs = [Run(**run) for run in recorded["runs"]]
    heads = [f"first {rate:.2f}" for rate in RATES]
    yield f"`{recorded['env']}`, {recorded['episodes']} episodes, at most {recorded['budget']:g} s a run:"
    yield ""
    yield f"| learner | seed | {' | '.join(heads)} | best | busy |"
    yield "|---" * (len(RATES) + 4) + "|"
    for run in sorted(runs, key=lambda run: run.learner):
        best = max((success for *_, success in run.evaluations), default=None)
        cells = [run.learner, str(run.seed), *map(run.reached, RATES), "-" if best is None else f"{best:.3f}"]
        yield f"| {' | '.join(cells)} | {run.busy:.0%} |"
    found = summary(runs, recorded["budget"])
    yield ""
    yield f"| median | {' | '.join(heads)} |"
    yield "|---" * (len(RATES) + 1) + "|"
    for learner, seconds in sorted(found["seconds"].items()):
        cells = ["not reached" if each is None else f"{each:.0f} s" for each in seconds.values()]
        yield f"| {learner} | {' | '.join(cells)} |"
    signs = {rate: "<= " * (rate in found["at_most"]) for rate in found["ours_over_best_peer"]}
    ratios = ["-" if r is None else f"{signs[rate]}{r:.2f}" for rate, r in found["ours_over_best_peer"].items()]
    yield f"| our best / the peers' best | {' | '.join(ratios)} |"
    yield ""
    yield from (f"* {learner}: `{settings}`" for learner, settings in sorted(recorded["settings"].items()))


def compare(given: argparse.Namespace) -> dict[str, Any]:
    """Run all learners, and return what `--json` prints. Raises ConfigError, RunError."""
    check_installed(given.learners, given.env)
    runs: list[Run] = []
    settings: dict[str, str] = {}
    for number, seed in enumerate(given.seeds):
        for learner in given.learners[:: -1 if number % 2 else 1]:
            run, settings[learner] = run_learner(learner, seed, given)
            runs.append(run)
            cells = ", ".join(f"{rate:.2f} {run.reached(rate)}" for rate in RATES)
            print(f"{learner} {seed}: {cells}", file=sys.stderr, flush=True)
    about: dict[str, Any] = {"env": given.env, "budget": given.budget, "episodes": given.episodes}
    return about | summary(runs, given.budget) | {"runs": [asdict(run) for run in runs], "settings": settings}


def check_installed(learners: Sequence[str], env: str) -> None:
    """Raise ConfigError for a package that the learners need and that is not installed."""
    for learner in learners:
        needed = [*LIBRARIES[learner.split("-")[0]], *["sb3_contrib"] * (learner == "sb3-tqc")]
        for package in [*needed, *["panda_gym"] * env.startswith("Panda")]:
            if find_spec(package) is None:
                raise ConfigError(
                    f'{learner} in {env} needs {package}, which is not installed: pip install -e ".[bench]"'
                )


def recorded(path: Path) -> dict[str, Any]:
    """Return what `--json` printed, of a file whose last line it is. Raises ConfigError."""
    try:
        lines = read_text(path, MAX_BYTES).strip().splitlines()
        found = json.loads(lines[-1] if lines else "")
        "\n".join(comparison(found))
    except FileError as error:
        raise ConfigError(f"{path} {error}") from None
    except (ValueError, KeyError, TypeError, LookupError):
        raise ConfigError(f"the last line of {path} is not what --json prints") from None
    return dict(found)


# ---- Commands


def watched(
    command: Sequence[str], is_over: Callable[[Sequence[Line]], bool] = lambda lines: False
) -> tuple[list[Line], float, float]:
    """Run a command; return its lines with their seconds since the start, its seconds, and how busy the machine was.

    is_over: asked after each line; True ends the command.

    Raises:
        RunError: the command failed.
    """
    before, start, lines, ended = _cpu_ticks(), time.monotonic(), [], False
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        command,
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": path, "PYTHONWARNINGS": "ignore"},
        stdout=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        preexec_fn=signal_at_parent_death,
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                lines.append((time.monotonic() - start, line))
                ended = is_over(lines)
                if ended:
                    break
        finally:
            _end(process, ended)
    seconds = time.monotonic() - start
    if process.returncode and not ended:
        raise RunError(f"{shlex.join(command[1:])} ended with exit code {process.returncode}")
    used, total = (after - earlier for after, earlier in zip(_cpu_ticks(), before, strict=True))
    return lines, seconds, used / total


def _end(process: subprocess.Popen[str], ended: bool) -> None:
    """Wait for a process, which is told to end if `ended`, and end those that it left."""
    if ended:
        process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(STOPPED)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _cpu_ticks() -> tuple[int, int]:
    """Return the machine's CPU ticks, used and in total. Workers have a parent of their own to account to."""
    ticks = [int(each) for each in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return sum(ticks) - ticks[3] - ticks[4], sum(ticks)  # without idle and iowait


# ---- Options


def seeds_of(text: str) -> list[int]:
    """Return the numbers of "0,1,2". Raises ConfigError."""
    parts = text.split(",")
    if not all(part.isdecimal() for part in parts):
        raise ConfigError(f"--seeds {text} must be numbers with commas between them, such as 0,1,2")
    return [int(part) for part in parts]


def learners_of(text: str) -> list[str]:
    """Return the learners of "ours-sac,sb3-sac". Raises ConfigError."""
    known = [f"{library}-{algorithm}" for library in LIBRARIES for algorithm in ALGORITHMS]
    for name in text.split(","):
        if name not in known:
            raise ConfigError(f"--learners {name} is none of {', '.join(known)}" + did_you_mean(name, known))
    return text.split(",")


def options() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0", help="0,1,2")
    parser.add_argument("--env", help="compare learners in this environment")
    parser.add_argument("--learners", default=LEARNERS, help="with --env: of ours, sb3, sbx and ppo, sac, tqc")
    parser.add_argument("--budget", type=float, default=600.0, help="with --env: seconds of a run, without evaluations")
    parser.add_argument("--episodes", type=int, default=200, help="with --env: of an evaluation")
    parser.add_argument("--frames", type=int, default=0, help="with --env, to try it: of a run at most")
    parser.add_argument("--zoo", action="store_true", help="with --env: rl-baselines3-zoo's settings, not lighter ones")
    parser.add_argument("--json", action="store_true", help="with --env: the last line is JSON")
    parser.add_argument("--recorded", type=Path, metavar="FILE", help="print the tables of what --json printed")
    parser.add_argument("overrides", nargs="*", help="of train.py, or of our learners")
    return parser


def main(words: list[str]) -> None:
    """Train, and print the tables. Raises ConfigError for bad input, RunError where a training failed."""
    given = options().parse_intermixed_args(words)
    if given.recorded:
        print("\n".join(comparison(recorded(given.recorded))))
        return
    given.seeds, given.learners = seeds_of(given.seeds), learners_of(given.learners)
    if wrong := [word for word in given.overrides if "=" not in word]:
        raise ConfigError(f"{wrong[0]!r} is no override, such as algo.lr=1e-3")
    if given.env is None:
        runs = []
        for seed in given.seeds:
            runs.append(train(seed, given.overrides))
            print(list(table(runs))[-1], file=sys.stderr, flush=True)
        print("\n".join([*table(runs), "", *parts_table(runs)]))
        return
    if given.env not in COMPARED:
        raise ConfigError(f"--env {given.env} is none of {', '.join(COMPARED)}" + did_you_mean(given.env, COMPARED))
    if given.budget <= 0 or given.episodes < 1 or given.frames < 0:
        raise ConfigError("--budget and --episodes must be greater than 0, --frames at least 0")
    found = compare(given)
    print("\n".join(comparison(found)))
    if given.json:
        print(json.dumps(found))


if __name__ == "__main__":
    with program():
        main(sys.argv[1:])

"""Speed of this project beside the raw PyBullet loop and other libraries, in one run.

    pip install -e ".[bench]"
    python benchmarks/throughput.py --write docs/throughput.md

Every workload runs in a fresh process that prints one JSON line. Rounds are interleaved: each runs every workload once,
and every second round runs them in reverse order, so that other load on the machine affects all of them alike. A ratio
is taken within each round; the table shows its median over the rounds, with the least and the greatest.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
QUICK_DIVISOR = 10  # `--quick` divides the steps of each workload by this
TIME_LIMIT = 900  # seconds for a workload
OURS, PEERS = "benchmarks.ours", "benchmarks.peers"
PACKAGES = ("torch", "torchrl", "pybullet", "gymnasium", "numpy", "panda-gym", "stable-baselines3", "sbx-rl")

INTRODUCTION = (
    "Medians (least-greatest) of interleaved rounds, each workload in a process of its own; ratios within a round.",
    "`benchmarks/ours.py` and `benchmarks/peers.py` describe the workloads; *matched* ones have the other's physics.",
    "[Speed](experiments/speed.md) gives the reasons where a bar is not met; the JSON beside this page has all rates.",
)

Round = dict[str, dict[str, Any]]  # workload name -> the JSON object it printed, or {"error": ...}


@dataclass(frozen=True)
class Workload:
    """One measured command: `python -m module name --steps steps`, pinned to `cores` cores."""

    name: str
    module: str
    steps: int
    cores: int = 1

    def command(self, quick: bool) -> list[str]:
        steps = max(self.steps // QUICK_DIVISOR, 1) if quick else self.steps
        return [sys.executable, "-m", self.module, self.name, "--steps", str(steps)]


@dataclass(frozen=True)
class Comparison:
    """`numerator` / (`times` x `denominator`) in each round, or `numerator` alone for "", and the median's bound."""

    label: str
    numerator: str
    denominator: str
    bound: float
    at_most: bool = False
    times: float = 1.0

    def values(self, rounds: Sequence[Round]) -> list[float]:
        """Return one value for each round that measured both workloads."""
        names = [name for name in (self.numerator, self.denominator) if name]
        complete = [entry for entry in rounds if all("rate" in entry.get(name, {}) for name in names)]
        divisors = [self.times * entry[self.denominator]["rate"] if self.denominator else 1.0 for entry in complete]
        return [entry[self.numerator]["rate"] / divisor for entry, divisor in zip(complete, divisors, strict=True)]

    def row(self, rounds: Sequence[Round]) -> list[str]:
        """Return label, median, spread, bound, and whether the median meets it."""
        values = self.values(rounds)
        bound = f"{'<=' if self.at_most else '>='} {self.bound:g}"
        if not values:
            return [self.label, median_and_range(values), bound, "not measured"]
        median = statistics.median(values)
        met = median <= self.bound if self.at_most else median >= self.bound
        return [self.label, median_and_range(values), bound, "yes" if met else "no"]


# Workloads are measured in this order, so those of a ratio are next to each other.
WORKLOADS = (
    Workload("raw_kuka", OURS, 20_000),
    Workload("env_kuka", OURS, 20_000),
    Workload("raw_place", OURS, 20_000),
    Workload("env_place", OURS, 20_000),
    Workload("collector_1", OURS, 20_000),
    Workload("collector_2", OURS, 40_000, cores=2),
    Workload("env_panda_matched", OURS, 10_000),
    Workload("panda_gym_reach", PEERS, 5_000),
    Workload("panda_gym_reach_lean", PEERS, 5_000),
    Workload("env_panda_nl_matched", OURS, 10_000),
    Workload("lanro_nl_reach", PEERS, 2_000),
    Workload("ppo_frames", OURS, 40_960, cores=2),
    Workload("sb3_ppo", PEERS, 8_192, cores=2),
    Workload("sac_gradient_steps", OURS, 1_000, cores=2),
    Workload("sb3_sac", PEERS, 500, cores=2),
    Workload("sbx_sac", PEERS, 500, cores=2),
    Workload("sac_wide_gradient_steps", OURS, 1_000, cores=2),
    Workload("sbx_sac_wide", PEERS, 500, cores=2),
    Workload("tqc_gradient_steps", OURS, 1_000, cores=2),
    Workload("sbx_tqc", PEERS, 500, cores=2),
    Workload("crossq_gradient_steps", OURS, 1_000, cores=2),
    Workload("sbx_crossq", PEERS, 500, cores=2),
    Workload("sac_products", OURS, 1_000, cores=2),
    Workload("sac_frames", OURS, 4_000, cores=2),
    Workload("sb3_sac_frames", PEERS, 500, cores=2),
    Workload("memory_per_world", OURS, 16),
    Workload("reset_memory", OURS, 10_000),
)
COMPARISONS = (
    Comparison("env bare / raw loop (kuka, 1 core)", "env_kuka", "raw_kuka", 0.85),
    Comparison("the same for pick and place", "env_place", "raw_place", 0.8),
    Comparison("collector with policy / env bare (1 core)", "collector_1", "env_kuka", 0.7),
    Comparison("collector, 2 workers / 1 worker", "collector_2", "collector_1", 1.5),
    Comparison("collector, 2 workers / two raw loops", "collector_2", "raw_kuka", 0.5, times=2.0),
    Comparison("our panda reach / panda-gym", "env_panda_matched", "panda_gym_reach", 1.8),
    Comparison(
        "the same, panda-gym with our number of solver iterations", "env_panda_matched", "panda_gym_reach_lean", 1.0
    ),
    Comparison("our panda nl_reach / lanro-gym", "env_panda_nl_matched", "lanro_nl_reach", 1.0),
    Comparison("PPO frames/s / stable-baselines3", "ppo_frames", "sb3_ppo", 6.0),
    Comparison("SAC gradient steps/s / stable-baselines3", "sac_gradient_steps", "sb3_sac", 1.5),
    Comparison("SAC gradient steps/s / SBX", "sac_gradient_steps", "sbx_sac", 1.0),
    Comparison("the same with 400 x 300", "sac_wide_gradient_steps", "sbx_sac_wide", 1.0),
    Comparison("TQC gradient steps/s / SBX", "tqc_gradient_steps", "sbx_tqc", 1.0),
    Comparison("CrossQ gradient steps/s / SBX", "crossq_gradient_steps", "sbx_crossq", 1.0),
    Comparison("SAC gradient steps/s / their matrix products alone", "sac_gradient_steps", "sac_products", 0.5),
    Comparison("memory of a world while training, MiB", "memory_per_world", "", 25.0, at_most=True),
    Comparison("memory after 10 000 resets / before", "reset_memory", "", 1.05, at_most=True),
)


def _pin(cores: int) -> Callable[[], None]:
    chosen = sorted(os.sched_getaffinity(0))[:cores]
    return lambda: os.sched_setaffinity(0, chosen)


def _last_result(output: str) -> dict[str, Any] | None:
    """Return the last JSON object with a rate. PyBullet may print other lines."""
    for line in reversed(output.splitlines()):
        if line.startswith("{") and '"rate"' in line:
            return dict(json.loads(line))
    return None


def measure(workload: Workload, quick: bool) -> dict[str, Any]:
    """Return the result of a workload in a fresh process; {"error": ...} where it failed."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(workload.cores), "PYTHONWARNINGS": "ignore"}
    try:
        done = subprocess.run(
            workload.command(quick),
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIME_LIMIT,
            preexec_fn=_pin(workload.cores),
        )
    except subprocess.TimeoutExpired:
        return {"error": f"took longer than {TIME_LIMIT} s"}
    result = _last_result(done.stdout)
    if done.returncode == 0 and result is not None:
        return result
    last_lines = done.stderr.strip().splitlines() or ["printed no rate"]
    return {"error": last_lines[-1], "exit_code": done.returncode}


def run_rounds(workloads: Sequence[Workload], repeats: int, quick: bool) -> list[Round]:
    """Measure every workload once a round, every second round in reverse order."""
    rounds: list[Round] = []
    for index in range(repeats):
        rounds.append({})
        for workload in workloads if index % 2 == 0 else reversed(workloads):
            result = measure(workload, quick)
            rounds[-1][workload.name] = result
            outcome = result.get("error") or f"{result['rate']:,.4g} {result['unit']}"
            print(f"round {index + 1}/{repeats}  {workload.name:22} {outcome}", file=sys.stderr, flush=True)
    return rounds


def median_and_range(values: Sequence[float]) -> str:
    """Return median, least and greatest as text; a dash if there are no values."""
    if not values:
        return "-"
    return f"{statistics.median(values):,.4g} ({min(values):,.4g}-{max(values):,.4g})"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def rate_table(rounds: Sequence[Round]) -> list[str]:
    """Return the lines of a Markdown table with a row for each workload."""
    rows = []
    for name in [w.name for w in WORKLOADS if any(w.name in entry for entry in rounds)]:
        found = [entry[name] for entry in rounds if "rate" in entry.get(name, {})]
        unit = found[0]["unit"] if found else "failed"
        rows.append([name, median_and_range([one["rate"] for one in found]), unit])
    return _table(["workload", "median", "unit"], rows)


def comparison_table(rounds: Sequence[Round]) -> list[str]:
    """Return one row for each comparison that this run measured: median, spread, bound, whether it is met."""
    ran = set().union(*rounds)
    rows = [
        comparison.row(rounds) for comparison in COMPARISONS if ran & {comparison.numerator, comparison.denominator}
    ]
    return _table(["what", "median", "bar", "met"], rows)


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "absent"


def machine() -> dict[str, Any]:
    """Return the machine and the versions. load_before: the mean load of the last minute."""
    return {
        "python": platform.python_version(),
        "processor": platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "load_before": os.getloadavg()[0],
        "packages": {package: _version(package) for package in PACKAGES},
    }


def write(path: Path, about: dict[str, Any], rounds: Sequence[Round], table: Sequence[str]) -> None:
    """Write a table to `path` (Markdown), and all measurements to the JSON file beside it."""
    command = " ".join(["python benchmarks/throughput.py", *sys.argv[1:]])
    versions = ", ".join(f"{package} {version}" for package, version in about["packages"].items())
    head = f"{about['cores']} cores, {about['processor']}, Python {about['python']}; {versions}."
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(["# Throughput", "", *INTRODUCTION, "", f"`{command}`", "", head, "", *table, ""]))
    compared = {each.label: statistics.median(values) for each in COMPARISONS if (values := each.values(rounds))}
    content = {"command": command, "machine": about, "comparisons": compared, "rounds": rounds}
    measured = json.dumps(content, indent=1)
    path.with_suffix(".json").write_text(measured + "\n")


def _chosen(names: str | None) -> list[Workload]:
    if names is None:
        return list(WORKLOADS)
    known = {workload.name: workload for workload in WORKLOADS}
    wanted = names.split(",")
    if unknown := [name for name in wanted if name not in known]:
        sys.exit(f"no workload {', '.join(unknown)}; choose from {', '.join(known)}")
    return [known[name] for name in known if name in wanted]


def main() -> None:
    """Measure, print both tables, and exit with 1 if a workload failed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--repeats", type=int, default=5, help="rounds, 5 by default")
    parser.add_argument("--only", metavar="NAME,NAME", help="only these workloads")
    parser.add_argument("--quick", action="store_true", help="a tenth of the steps, as a check")
    parser.add_argument("--write", type=Path, metavar="FILE.md", help="write Markdown here, and JSON beside it")
    args = parser.parse_args()
    if args.repeats < 1:
        parser.error(f"--repeats={args.repeats}: it must be at least 1")
    about = machine()
    rounds = run_rounds(_chosen(args.only), args.repeats, args.quick)
    comparisons = comparison_table(rounds)
    print("\n".join([*comparisons, "", *rate_table(rounds)]))
    if args.write:
        write(args.write, about, rounds, comparisons)
    sys.exit(any("error" in result for entry in rounds for result in entry.values()))


if __name__ == "__main__":
    main()

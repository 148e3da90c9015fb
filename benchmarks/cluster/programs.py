"""The programs on a cluster: sweeps whose nodes die, evaluations in shards, and the start without a cluster."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from random import Random

from benchmarks.cluster.collection import start_cluster
from benchmarks.cluster.network import kill_all
from benchmarks.cluster.rows import row
from benchmarks.faults.rows import Outcome

ROOT = Path(__file__).parents[2]
RUNS = 12
POLICY = "pretrained/nl_reach_kuka"
SHORT = ["task=reach", "collector.worlds=4", "algo.horizon=64", "algo.minibatch=64", "eval.episodes=4", "logger=[]"]
SHORT += ["eval.interval=1024", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0"]
SWEEP_NODES = (1, 2, 3, 4)  # namespaces with one core each


def program(name: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a program of this project to its end."""
    return subprocess.run(
        [sys.executable, str(ROOT / name), *words],
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )


@row("sweep", "12 runs, half of the nodes killed on the way: 12 results, none run twice to its end", 1, isolated=True)
def sweep(tries: int, random: Random, folder: Path) -> Outcome:
    """Two of four nodes are killed once the first run has a result."""
    outcome = Outcome(figures={"results": [], "started again": []})
    for attempt in range(tries):
        start_cluster(SWEEP_NODES)
        place = folder / f"sweep-{attempt}"
        seeds = ",".join(map(str, range(RUNS)))
        words = ["-m", f"seed={seeds}", "total_frames=4096", *SHORT, "hydra/launcher=ray", "sweep.retries=3"]
        words.append(f"hydra.sweep.dir={place}")
        with open(folder / "output.txt", "w") as output:
            process = subprocess.Popen(
                [sys.executable, str(ROOT / "train.py"), *words], cwd=ROOT, stdout=output, stderr=subprocess.STDOUT
            )
            while process.poll() is None and not list(place.glob("*/eval.json")):
                time.sleep(0.2)
            for index in random.sample(SWEEP_NODES, 2):
                kill_all(f"deixis-{index}")
            code = process.wait()
        told = (folder / "output.txt").read_text()
        results, ends = len(list(place.glob("*/eval.json"))), told.count("has finished on node")
        outcome.figures["results"].append(results)
        outcome.figures["started again"].append(told.count("; it is started again"))
        wrong = f"exit code {code}, {results} results, {ends} runs to the end: {told[-300:]}"
        outcome.count("" if (code, results, ends) == (0, RUNS, RUNS) else wrong)
        for index in (*SWEEP_NODES, 0):
            kill_all(f"deixis-{index}")
    return outcome


@row("evaluation", "2,500 episodes for each try, on Ray and in one process, same shards: the same figures", 4)
def evaluation(tries: int, random: Random, folder: Path) -> Outcome:
    """Evaluate 2,500 episodes for each try, in 4 shards."""
    outcome, results = Outcome(), {}
    for name in ("local", "ray"):
        out = folder / f"{name}.json"
        start = time.perf_counter()
        words = [f"checkpoint={POLICY}", f"episodes={2500 * tries}", "shards=4", f"collector={name}", f"out={out}"]
        done = program("evaluate.py", *words)
        if done.returncode:
            outcome.count(done.stderr[-300:])
            return outcome
        outcome.figures[f"{name} s"] = round(time.perf_counter() - start, 1)
        results[name] = json.loads(out.read_text())
    outcome.figures |= {name: results["ray"][name] for name in ("episodes", "success_at_end", "shards")}
    outcome.count("" if results["local"] == results["ray"] else "the figures differ")
    return outcome


@row("start", "train.py --help imports no Ray; collector=ray without Ray says what to install", 3)
def start(tries: int, random: Random, folder: Path) -> Outcome:
    """The time of --help with Ray installed and without it."""
    outcome = Outcome()
    seconds: dict[str, list[float]] = {"with": [], "without": []}
    for _ in range(tries):
        for name, hidden in (("with", False), ("without", True)):
            begin = time.perf_counter()
            done = without_ray("--help", hidden=hidden)
            seconds[name].append(round(time.perf_counter() - begin, 2))
            outcome.count("" if done.returncode == 0 else done.stderr[-200:])
    done = without_ray("collector=ray", f"hydra.run.dir={folder / 'run'}")
    outcome.count("" if "needs ray, which is not installed: pip install" in done.stderr else done.stderr[-300:])
    outcome.figures = {f"--help {name} Ray, s": min(each) for name, each in seconds.items()}
    outcome.figures["message"] = done.stderr.strip()
    return outcome


def without_ray(*words: str, hidden: bool = True) -> subprocess.CompletedProcess[str]:
    """Run train.py in a process where Ray cannot be imported. hidden: False for the same with Ray."""
    hide = "sys.modules['ray'] = None; " if hidden else ""
    code = f"import runpy, sys; {hide}sys.argv = ['train.py', *{list(words)}]; "
    code += "runpy.run_path('train.py', run_name='__main__')"
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)

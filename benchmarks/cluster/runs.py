"""Runs, sweeps and evaluations on a cluster: the results of a local run, whatever happens to actors and nodes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from omegaconf import OmegaConf

from benchmarks.cluster import RowResult, row
from benchmarks.cluster.network import cut, kill_all, start_node
from core.overrides import compose
from envs.config import read_env
from language import Tokenizer
from tools.whole_runs import ROOT, SMALL, command, differences, finish, rows_of
from train import build_env
from trainers.algorithms.algorithm import build_algorithm
from trainers.cluster.ray_session import RaySession
from trainers.collect.rollouts import Rollouts, WorkerPool
from trainers.config import read_training
from trainers.run.metrics import read_metrics
from trainers.run.train_loop import fit

FAULTS = ("actor killed", "actor stopped", "node killed", "network cut")
NODES = (1, 2)  # namespaces with one core each
RUN = ["collector=ray", "collector.workers=2", *SMALL, "algo.horizon=64", "algo.minibatch=64", "total_frames=2560"]
RUN += ["eval.interval=100000"]
NODE_SECONDS = 25.0  # for a node to join or to be counted as dead
TRIES = 3  # of a node to join
SWEEP_RUNS = 12
SWEEP_NODES = (1, 2, 3, 4)  # namespaces with one core each
SHORT = ["task=reach", "collector.worlds=4", "algo.horizon=64", "algo.minibatch=64", "eval.episodes=4", "logger=[]"]
SHORT += ["eval.interval=1024", "eval.interval_episodes=4", "eval.worlds=4", "eval.video_episodes=0"]
POLICY = "pretrained/nl_reach_kuka"


@row("equal", "2 workers on Ray and in processes: the same metrics and weights, and the frames/s of each", 1)
def equal(tries: int, random: Random, folder: Path) -> RowResult:
    """Compare `tries` tenths of the default run's 80,000 frames; 10 are the whole run."""
    outcome = RowResult()
    words = ["collector.workers=2", f"total_frames={8_000 * tries}", f"schedule_frames={8_000 * tries}"]
    words += ["eval.video_episodes=0", "logger=[]"]
    rates = {}
    for name in ("local", "ray"):
        wrong = finish(command(folder / name, f"collector={name}", *words))
        if wrong:
            outcome.count(wrong)
            return outcome
        rows = read_metrics(folder / name / "metrics.csv")[1:]  # the first batch includes the start of the workers
        seconds = sum(each["time/collect"] + each["time/update"] for each in rows)
        rates[name] = (rows[-1]["frames"] - rows[0]["frames"]) / seconds
    outcome.count(differences(folder / "local", folder / "ray"))
    outcome.figures = {f"{name} frames/s": round(rate) for name, rate in rates.items()}
    outcome.figures |= {"ratio": round(rates["ray"] / rates["local"], 3), "rows": len(rows_of(folder / "ray"))}
    return outcome


class ClusterFault:
    """A fault that happens once to a random worker's actor or node, and how long it took to be noticed."""

    def __init__(self, kind: str, iteration: int, random: Random) -> None:
        self.kind, self.iteration, self.random = kind, iteration, random
        self.at: float | None = None
        self.noticed: float | None = None
        self.node: int | None = None  # the namespace that was lost

    def patches(self) -> list[Any]:
        """Return the patches, as arguments of `patch.object`."""
        collect, replace = WorkerPool.collect, WorkerPool._replace

        def collecting(pool: Any, order: Any) -> Any:
            if self.at is None and order.iteration == self.iteration:
                self.at = time.monotonic() + self.random.uniform(0.0, 0.3)
                threading.Timer(self.at - time.monotonic(), self.happen, [pool]).start()
            return collect(pool, order)

        def replacing(pool: Any, *more: Any) -> Any:
            if self.noticed is None and self.at is not None:
                self.noticed = time.monotonic() - self.at
            return replace(pool, *more)

        return [(WorkerPool, "collect", collecting), (WorkerPool, "_replace", replacing)]

    def happen(self, pool: Any) -> None:
        """Cause the fault."""
        worker = self.random.choice(pool.workers)
        if self.kind.startswith("actor"):
            os.kill(worker.pid, signal.SIGKILL if self.kind == "actor killed" else signal.SIGSTOP)
            return
        addresses = {node.id: node.address for node in pool.host.session.nodes}
        self.node = int(addresses[worker.node_id].rpartition(".")[2]) - 1
        if self.kind == "node killed":
            kill_all(f"deixis-{self.node}")
        else:
            cut(self.node)


def train(folder: Path, fault: ClusterFault | None) -> None:
    """Train in this process."""
    config = compose(RUN)
    plain: Any = OmegaConf.to_container(config, resolve=True)
    patches = [patch.object(*each) for each in (fault.patches() if fault else [])]
    for each in patches:
        each.start()
    try:
        fit(read_training(config), _maker(config), folder, plain, list(Tokenizer.default().vocabulary))
    finally:
        for each in patches:
            each.stop()


def _maker(config: Any) -> Any:
    return partial(build_env, read_env(config))


def start_cluster(nodes: Sequence[int], head: bool = True) -> None:
    """Start a head without cores, and nodes with one core each, one after another."""
    if head:
        start_node(0, cpus=0)
    for index in nodes:
        before = count_nodes()
        for _ in range(TRIES):
            start_node(index, cpus=1)
            if wait_for_nodes(before + 1):
                break
            kill_all(f"deixis-{index}")  # nodes that share a disk sometimes do not start
        else:
            raise TimeoutError(f"node {index} has not joined {TRIES} times")


def wait_for_nodes(count: int) -> bool:
    """Return whether the cluster gets `count` nodes beside its head in time."""
    deadline = time.monotonic() + NODE_SECONDS
    while (found := count_nodes()) != count and time.monotonic() < deadline:
        time.sleep(0.5)
    return found == count


def count_nodes() -> int:
    """Return the nodes of the cluster beside its head."""
    try:
        session = RaySession()
    except ValueError:  # the head is starting
        return 0
    count = len(session.nodes) - 1
    session.close()
    return count


@row("faults", "a random actor or node is killed, stopped or cut off: the undisturbed run's result", 20, isolated=True)
def faults(tries: int, random: Random, folder: Path) -> RowResult:
    """Cause each fault in turn, at a random moment. A lost node joins again before the next try."""
    outcome, before = RowResult(figures={"noticed after s, at most": 0.0, "never happened": 0}), segments()
    start_cluster(NODES)
    train(folder / "whole", None)
    for index in range(tries):
        fault = ClusterFault(FAULTS[index % len(FAULTS)], random.randint(1, 8), random)
        place = folder / f"try-{index}"
        try:
            train(place, fault)
            wrong = differences(folder / "whole", place)
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
        outcome.count(f"{fault.kind}: {wrong}" if wrong else "")
        outcome.figures["never happened"] += fault.noticed is None
        longest = max(outcome.figures["noticed after s, at most"], round(fault.noticed or 0.0, 2))
        outcome.figures["noticed after s, at most"] = longest
        print(f"{fault.kind}: noticed after {fault.noticed} s {wrong}", file=sys.stderr, flush=True)
        if fault.node is not None:
            kill_all(f"deixis-{fault.node}")
            cut(fault.node, up=True)
            wait_for_nodes(len(NODES) - 1)
            start_cluster([fault.node], head=False)
    outcome.figures |= {"actors left": actors_left(), "segments left": len(segments() - before)}
    return outcome


def actors_left(seconds: float = 10.0) -> int:
    """Return processes of actors in all namespaces, after the seconds that they take to end."""
    deadline = time.monotonic() + seconds
    while True:
        lines = [_title(entry) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
        count = sum(line.startswith("ray::CollectorActor") for line in lines)
        if not count or time.monotonic() > deadline:
            return count
        time.sleep(0.2)


def _title(entry: Path) -> str:
    try:
        return (entry / "cmdline").read_text(errors="replace")
    except OSError:
        return ""


def segments() -> set[str]:
    """Return the names in shared memory, without the semaphores of other programs."""
    names = {path.name for path in Path("/dev/shm").iterdir()}
    return {name for name in names if not name.startswith("sem.") or name.startswith("sem.mp-deixis-")}


@row("node_added", "a node that joins in mid-run is used within 10 s", 1, isolated=True)
def node_added(tries: int, random: Random, folder: Path) -> RowResult:
    """Collect with two workers on one core, until a second node joins."""
    outcome = RowResult(figures={"used after s": []})
    start_node(0, cpus=0)
    for _ in range(tries):
        start_cluster(NODES[:1], head=False)
        config = compose([*RUN, "collector.cpus=0.5"])
        training, env = read_training(config), _maker(config)(1, 0)
        words = list(Tokenizer.default().vocabulary)
        policy, _ = build_algorithm(training, env.observation_spec, env.action_unit, words, env.hindsight)
        rollouts = Rollouts(_maker(config), policy, training.collector, horizon=64, seed=0)
        rollouts.next()
        start_node(2, cpus=1)
        pool: Any = rollouts.pool
        joined, used = None, None
        deadline = time.monotonic() + 60
        while used is None and time.monotonic() < deadline:
            rollouts.next()
            if joined is None and pool.host.session.cpus >= 2:
                joined = time.monotonic()
            if len({worker.node_id for worker in pool.workers}) == 2:
                used = time.monotonic()
        rollouts.close()
        seconds = round(used - joined, 1) if used and joined else None
        outcome.figures["used after s"].append(seconds)
        outcome.count("" if seconds is not None and seconds <= 10 else f"used after {seconds} s")
        for index in NODES:
            kill_all(f"deixis-{index}")
        wait_for_nodes(0)
    return outcome


# ---- Programs


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
def sweep(tries: int, random: Random, folder: Path) -> RowResult:
    """Kill two of four nodes once the first run has a result."""
    outcome = RowResult(figures={"results": [], "started again": []})
    for attempt in range(tries):
        start_cluster(SWEEP_NODES)
        place = folder / f"sweep-{attempt}"
        seeds = ",".join(map(str, range(SWEEP_RUNS)))
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
        outcome.count("" if (code, results, ends) == (0, SWEEP_RUNS, SWEEP_RUNS) else wrong)
        for index in (*SWEEP_NODES, 0):
            kill_all(f"deixis-{index}")
    return outcome


@row("evaluation", "2,500 episodes for each try, on Ray and in one process, same shards: the same figures", 4)
def evaluation(tries: int, random: Random, folder: Path) -> RowResult:
    """Evaluate 2,500 episodes for each try, in 4 shards."""
    outcome, results = RowResult(), {}
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
def start(tries: int, random: Random, folder: Path) -> RowResult:
    """Measure the time of --help with Ray installed and without it."""
    outcome = RowResult()
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

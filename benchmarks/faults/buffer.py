"""The cost of a checkpoint of a long off-policy run."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import torch

from benchmarks.faults.rows import Outcome, row
from core.overrides import compose
from envs.config import read_env
from envs.workspace_env import WorkspaceEnv
from language import Tokenizer
from trainers.collect.collection import Rollouts
from trainers.config import read_plan
from trainers.run.train_loop import TrainingRun

FRAMES, STEPS = 200_000, 16  # of the buffer, and of each world in the recorded batch


@row("buffer", "checkpoints of a run with a full replay buffer of 200,000 frames", 4)
def buffer(tries: int, random: Random, folder: Path) -> Outcome:
    """The first try writes the whole buffer, later ones the 50,000 frames since the last one, as by default."""
    config = compose(["algo=sac", f"algo.horizon={STEPS}"])
    env_config, plan = read_env(config), read_plan(config)
    run = TrainingRun(plan, partial(WorkspaceEnv, env_config), folder, {}, list(Tokenizer.default().vocabulary))
    algorithm: Any = run.algorithm
    run.rollouts = Rollouts(run.make_env, run.policy, plan.collector, STEPS, 0)
    batch = run.rollouts.next()
    algorithm.relabelling.episodes(batch)  # frames of unfinished episodes are saved too
    algorithm.add_batch_scenes(batch, [])
    outcome = Outcome(figures={"buffer MB": 0.0, "seconds": [], "MB on disk": []})
    for index in range(tries):
        for _ in range((FRAMES if index == 0 else plan.eval.interval) // batch.numel() + 1):
            algorithm.replay.extend(batch)
        start = time.perf_counter()
        run.save_last()
        seconds = time.perf_counter() - start
        bytes_used = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        stored = algorithm.replay.frames.storage.get(torch.arange(FRAMES)).bytes()
        outcome.figures["buffer MB"] = round(stored / 1e6, 1)
        outcome.figures["seconds"].append(round(seconds, 2))
        outcome.figures["MB on disk"].append(round(bytes_used / 1e6, 1))
        outcome.tries += 1
        if seconds > 1 or bytes_used > 1.3 * stored:
            outcome.failures.append(f"{seconds:.2f} s, {bytes_used / stored:.2f} of the buffer's bytes")
    run.rollouts.close()
    run.close()
    return outcome

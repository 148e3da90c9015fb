"""The cost of a checkpoint of a long off-policy run."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import pytest
import torch

from core.overrides import compose
from envs.config import read_env
from envs.workspace_env import WorkspaceEnv
from language import Tokenizer
from tests.helpers.thorough import cases
from trainers.collect.rollouts import Rollouts
from trainers.config import read_training
from trainers.run.train_loop import TrainingRun

FRAMES, STEPS = 200_000, 16  # of the buffer, and of each world in the recorded batch


@pytest.mark.slow
def test_a_checkpoint_of_a_full_replay_buffer_is_hardly_larger_than_it_and_soon_written(row, tmp_path):
    """The first try writes the whole buffer, later ones the frames since the last one, as by default."""
    config = compose(["algo=sac", "collector.workers=1", f"algo.horizon={STEPS}"])
    env_config, training = read_env(config), read_training(config)
    run = TrainingRun(
        training,
        partial(WorkspaceEnv, env_config),
        tmp_path,
        config={},
        vocabulary=list(Tokenizer.default().vocabulary),
    )
    algorithm: Any = run.algorithm
    run.rollouts = Rollouts(run.make_env, run.policy, training.collector, horizon=STEPS, seed=0)
    batch = run.rollouts.next()
    algorithm.relabelling.episodes(batch)  # frames of unfinished episodes are saved too
    algorithm.add_batch_scenes(batch, [])
    row.figures |= {"buffer MB": 0.0, "seconds": [], "MB on disk": []}
    for index in range(row.number(sample=2, thorough=4)):
        for _ in range((FRAMES if index == 0 else training.eval.interval) // batch.numel() + 1):
            algorithm.replay.extend(batch)
        start = time.perf_counter()
        run.save_last()
        seconds = time.perf_counter() - start
        bytes_used = sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file())
        stored = algorithm.replay.frames.storage.get(torch.arange(FRAMES)).bytes()
        row.figures["buffer MB"] = round(stored / 1e6, 1)
        row.figures["seconds"].append(round(seconds, 2))
        row.figures["MB on disk"].append(round(bytes_used / 1e6, 1))
        slow, large = seconds > cases(60, 1), bytes_used > 1.3 * stored
        row.count(f"{seconds:.2f} s, {bytes_used / stored:.2f} of the buffer's bytes" if slow or large else "")
    run.rollouts.close()
    run.close()
    row.check()

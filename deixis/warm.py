"""Compile gradient steps before a run needs them: `deixis warm algo=sac robot=panda task=nl_push`.

    algo=sac robot=panda ...   the words of the later `deixis train`; each combination of algorithm, task, policy and
                               sizes has compiled functions of its own

With `algo.compile`, a run spends 5 to 30 s on its first gradient steps, once on each machine. This trains for a few of
them in a folder that is deleted, so that an image, or the machines of a cluster, have them compiled. They stand in
~/.cache/deixis/compiled, or in $TORCHINDUCTOR_CACHE_DIR, and hold for the kind of processor that compiled them.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from contextlib import redirect_stdout
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from core.composition import compose
from core.errors import ConfigError, RunError
from core.program import run_program

if TYPE_CHECKING:
    from trainers.config import TrainingConfig

STEPS = 20  # of gradients, at least: some losses are computed at every second one
LIBRARIES = "*.so"  # what a compiler makes of a function


def main(words: Sequence[str]) -> int:
    """Compile what a run with these overrides compiles, say how much that was, and return the number of functions.

    Raises:
        ConfigError: the words are not those of a run that compiles gradient steps.
        RunError: nothing could be compiled.
    """
    from trainers.algorithms.compiled import CACHE_VARIABLE, choose_cache
    from trainers.config import read_training

    run = import_module("train").run  # a program, by its name, as in `deixis.cli`
    training = read_training(compose(words))
    short = shortened(training)
    choose_cache()
    cache = Path(os.environ[CACHE_VARIABLE])
    before = set(cache.rglob(LIBRARIES))
    with TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):  # the result of so short a run says nothing
        run(compose([*words, *short]), Path(folder) / "run")
    compiled = set(cache.rglob(LIBRARIES))
    if not compiled:
        raise RunError("no gradient step could be compiled, for the reason above")
    print(f"{cache}: {len(compiled - before)} functions compiled, {len(before)} were there")
    return len(compiled - before)


def shortened(training: TrainingConfig) -> list[str]:
    """Return the overrides that make a run end after a few gradient steps. Raises ConfigError as `main` does."""
    from trainers.algorithms.settings import OffPolicyConfig, ReplayConfig
    from trainers.config import PixelsConfig

    algo, collector = training.algo, training.collector
    if not isinstance(algo, ReplayConfig) or isinstance(training.policy, PixelsConfig):
        what = "policy=pixels" if isinstance(algo, ReplayConfig) else f"algo={algo.name}"
        raise ConfigError(f"{what} compiles no gradient steps; algo=sac, td3, crossq, tqc, redq and bc do")
    if collector.name != "local":
        raise ConfigError(f"collector={collector.name} compiles where it learns: leave it out, and warm that machine")
    batch = collector.worlds * algo.horizon
    starts = ["algo.learning_starts=0"] if isinstance(algo, OffPolicyConfig) else []
    frames = 2 * batch + max(batch, round(STEPS / algo.updates_per_frame))
    evaluation = ["eval.episodes=1", "eval.worlds=1", f"eval.interval={10 * frames}", "eval.video_episodes=0"]
    return [*starts, *evaluation, "algo.compile=on", "collector.workers=1", "logger=[]", f"total_frames={frames}"]


def cli() -> None:
    """Run the program with the words of the command line. Exits with one line for bad input."""
    run_program(main, __file__)


if __name__ == "__main__":
    cli()

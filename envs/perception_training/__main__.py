"""Training and evaluation of the network that sees: `python -m envs.perception_training train | evaluate`.

    train
      out=sight.safetensors   file for the weights; give perception.weights that file
      pictures=24000          that the simulator draws and labels
      steps=6000              of the optimiser, 48 pictures each
      rate=0.0025             the highest learning rate
      init=<file>             weights to begin with, for your own table, cameras and objects
      device=cpu              cpu | cuda
      bfloat16=true           convolutions in 16 bits: half the time on a processor with instructions for them
      processes=2             that draw pictures
      seed=0                  of scenes and network
      setup=task=nl_reach,robot=panda    draw from this setup alone; default: those of the project
    evaluate
      weights=<file>          default: the weights that come with the project
      scenes=400              of each setup and condition
      seed=1                  of the scenes

`train` prints the terms of the loss. `evaluate` prints how exactly fresh scenes are seen, as episodes begin and with
the arm among the objects, and in each condition that the training varies, beyond what it varied.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import torch

from core.command_line import check_file, chosen, split
from core.errors import ConfigError, did_you_mean
from core.program import run_program
from core.schema import Checked, any_path, one_of, read, within
from envs.perception.weights_file import load, save
from envs.perception_training.conditions import report_conditions
from envs.perception_training.fitting import fit
from envs.perception_training.scenes import SETUPS, SHARES, draw_in_processes


@dataclass(frozen=True, kw_only=True)
class SightTraining(Checked):
    """Keys of `train`; the module's docstring describes them."""

    out: str = any_path()
    pictures: int = within(100, 10_000_000)
    steps: int = within(1, 10_000_000)
    rate: float = within(1e-6, 1.0)
    init: str | None = any_path()
    device: str = one_of("cpu", "cuda")
    bfloat16: bool
    processes: int = within(1, 256)
    seed: int = within(0, 2**20)
    setup: str | None = any_path()


@dataclass(frozen=True, kw_only=True)
class SightEvaluation(Checked):
    """Keys of `evaluate`; the module's docstring describes them."""

    weights: str | None = any_path()
    scenes: int = within(1, 1_000_000)
    seed: int = within(0, 2**20)


DEFAULTS: dict[type, dict[str, Any]] = {
    SightTraining: {
        "out": "sight.safetensors",
        "pictures": 24_000,
        "steps": 6000,
        "rate": 0.0025,
        "init": None,
        "device": "cpu",
        "bfloat16": True,
        "processes": 2,
        "seed": 0,
        "setup": None,
    },
    SightEvaluation: {"weights": None, "scenes": 400, "seed": 1},
}


def train(config: SightTraining) -> None:
    """Draw pictures, train a network on them, and save it. Raises ConfigError."""
    out = check_file("out", config.out)
    if config.device == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device=cuda needs a GPU that torch can use; leave it out to train on the CPU")
    init = None if config.init is None else load(config.init)
    began = time.perf_counter()
    setups, shares = (SETUPS, SHARES) if config.setup is None else ((tuple(config.setup.split(",")),), (1.0,))
    pictures = draw_in_processes(config.pictures, config.seed, config.processes, setups=setups, shares=shares)
    print(f"{len(pictures.pictures)} pictures drawn in {time.perf_counter() - began:.0f} s", flush=True)

    def tell(step: int, terms: dict[str, float]) -> None:
        if step % 200 == 0 or step == config.steps - 1:
            told = "  ".join(f"{name} {value:.3f}" for name, value in terms.items())
            print(f"{time.perf_counter() - began:6.0f} s  step {step:6d}  {told}", flush=True)

    network = fit(
        pictures,
        steps=config.steps,
        learning_rate=config.rate,
        seed=config.seed,
        device=config.device,
        bfloat16=config.bfloat16,
        init=init,
        report=tell,
    )
    save(out, network.cpu())
    print(f"saved {out.stat().st_size / 1e6:.1f} MB in {out}, {time.perf_counter() - began:.0f} s in all")


def evaluate(config: SightEvaluation) -> None:
    """Print how exactly fresh scenes are seen. Raises ConfigError."""
    torch.set_num_threads(1)
    report_conditions(load(config.weights), config.scenes, config.seed)


# ---- command line

COMMANDS: dict[str, tuple[type, Any]] = {"train": (SightTraining, train), "evaluate": (SightEvaluation, evaluate)}


def main(arguments: Sequence[str]) -> Any:
    """Run `train` or `evaluate` with the arguments that follow it. Raises ConfigError."""
    (kind, run), words = chosen(COMMANDS, arguments)
    names = [field.name for field in fields(kind)]
    own, others = split(words, names, "seed=1")
    if others:
        key = others[0].partition("=")[0]
        raise ConfigError(f"{others[0]}: {key} is not a known key" + did_you_mean(key, names))
    return run(read(kind, DEFAULTS[kind] | own, ""))


if __name__ == "__main__":
    run_program(main, __file__)

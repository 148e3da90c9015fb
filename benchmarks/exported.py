"""Exported policies beside their own: `python -m benchmarks.exported [NAME ...] [--observations 10000]`.

For each pretrained policy, or those that are named: the greatest difference of an action between PyTorch and the ONNX
and TorchScript files on observations of the policy at work, and the median time of one step of one world with ONNX
Runtime on one core.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import closing, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from numpy.typing import NDArray

from deixis import load_policy
from deixis.export import FILES, WORLDS, draw_samples, main
from trainers.export.exported_policy import ExportedPolicy
from trainers.export.exported_policy import names as input_names
from trainers.export.policy_file import names

CALLS = 1000  # that are timed


def measure(name: str, observations: int) -> tuple[float, float, float]:
    """Return the greatest differences with ONNX and TorchScript, and milliseconds of a step with ONNX."""
    with tempfile.TemporaryDirectory() as scratch:
        for form in ("onnx", "torchscript"):
            with redirect_stdout(StringIO()):
                main([f"checkpoint={name}", f"format={form}", f"out={scratch}/{form}"])
        samples, action = _samples(name, observations)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(Path(scratch, "onnx", FILES["onnx"]), options)
        script = torch.jit.load(str(Path(scratch, "torchscript", FILES["torchscript"])))
        with torch.no_grad():
            scripted = script(*(torch.from_numpy(values) for values in samples.values())).numpy()
        one, times = {key: values[:1] for key, values in samples.items()}, []
        for _ in range(CALLS):
            begin = time.perf_counter()
            session.run(None, one)
            times.append(time.perf_counter() - begin)
        exported = session.run(None, samples)[0]
    differences = [float(np.abs(each - action).max()) for each in (exported, scripted)]
    return differences[0], differences[1], 1000 * statistics.median(times)


def _samples(name: str, count: int) -> tuple[dict[str, NDArray], NDArray]:
    """Return observations by the names of the files' inputs, and the policy's actions."""
    policy = load_policy(name)
    with closing(policy.make_env(WORLDS, seed=1)) as env:
        frames = draw_samples(policy, env, count)
    exported = ExportedPolicy(policy.networks)
    inputs = zip(input_names(exported.keys), exported.inputs(frames), strict=True)
    return {key: values.numpy() for key, values in inputs}, frames["action"].numpy()


def cli(words: Sequence[str] | None = None) -> int:
    """Print a row for each policy. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="pretrained policies; all by default")
    parser.add_argument("--observations", type=int, default=10_000)
    options = parser.parse_args(words)
    print("| policy | ONNX | TorchScript | a step with ONNX, ms |\n|---|---|---|---|")
    for name in options.names or names():
        onnx, script, milliseconds = measure(name, options.observations)
        print(f"| `{name}` | {onnx:.1e} | {script:.1e} | {milliseconds:.2f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(cli())

"""Losses and their gradients as compiled functions: `algo.compile`.

A gradient step on small networks spends more time in Python and autograd than in products of matrices. Here losses and
gradients are traced once, as the tensor operations that they consist of, and inductor makes one C++ function of these.
It releases the interpreter's lock, so that parts of a step run beside each other. The losses are those that run
uncompiled, TorchRL's among them.

A first compilation takes 5 to 30 s. Inductor keeps what it has compiled in a folder, `~/.cache/deixis/compiled` or
$TORCHINDUCTOR_CACHE_DIR, from which any later process takes it in 1 to 3 s.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from torch import Tensor

from trainers.algorithms.algorithm import Part, backward, one_thread, total_loss

if TYPE_CHECKING:
    from torch.fx import GraphModule, Node

CACHE = Path("~/.cache/deixis/compiled")
OPTIONS = {
    "cpp_wrapper": True,  # one C++ function, without Python between the operations
    "cpp.threads": 1,  # the parts of a step use a core each
    "fallback_random": True,  # the same random numbers as without compilation
}

Losses = Callable[..., dict[str, Tensor]]  # from frames and tensors to scalars; those named loss/... are minimised
Function = Callable[..., Sequence[Tensor | None]]


class LossGradients:
    """Computes losses and adds their gradients to the parameters.

    Args:
        losses: from frames (B,) and further tensors to the measured scalars.
        parameters: whose gradients are computed.
    """

    def __init__(self, losses: Losses, parameters: Sequence[Tensor]) -> None:
        self._losses, self._parameters = losses, list(parameters)

    def part(self, frames: TensorDictBase, *tensors: Tensor, variant: object = None) -> Part:
        """Return the function that computes them; it may run beside other ones.

        What is to be done once for such arguments is done here. No other thread may use torch meanwhile.

        variant: tells apart what the losses compute for the same shapes.
        """
        return lambda: backward(self._losses(frames, *tensors), self._parameters)


class CompiledLosses(LossGradients):
    """The same, compiled.

    Each combination of shapes is compiled at its first use. What the losses read besides their arguments is found by
    tracing them: tensors are inputs, which others may change in place between two calls; numbers are constants.

    Args:
        losses: from frames (B,) and further tensors to the measured scalars.
        parameters: whose gradients are computed.
        buffers: that the losses change, such as running means.
    """

    def __init__(self, losses: Losses, parameters: Sequence[Tensor], buffers: Sequence[Tensor] = ()) -> None:
        super().__init__(losses, parameters)
        self._buffers = list(buffers)
        self._compiled: dict[Any, tuple[Function | None, list[str]]] = {}

    def part(self, frames: TensorDictBase, *tensors: Tensor, variant: object = None) -> Part:
        keys = sorted(frames.keys(True, True), key=str)
        values = [*(frames[key] for key in keys), *tensors]
        shape = variant, tuple(keys), tuple(value.shape for value in values)
        if shape not in self._compiled:
            self._compiled[shape] = self._compile(keys, len(frames), values)
        function, names = self._compiled[shape]
        if function is None:
            return super().part(frames, *tensors, variant=variant)
        return partial(self._run, function, names, values)

    def _run(self, function: Function, names: list[str], values: list[Tensor]) -> dict[str, Tensor]:
        with one_thread():  # a second one gains little within a product, and waits if other processes are at work
            results = function(*values)
        for parameter, gradient in zip(self._parameters, results[len(names) :], strict=True):
            if gradient is not None:
                parameter.grad = gradient if parameter.grad is None else parameter.grad + gradient
        return {name: value for name, value in zip(names, results, strict=False) if value is not None}

    def _compile(self, keys: list[NestedKey], count: int, values: list[Tensor]) -> tuple[Function | None, list[str]]:
        """Return the function from the values to measured scalars and gradients, and the names of the scalars.

        None in place of the function: it could not be compiled.
        """
        names: list[str] = []

        def compute(*values: Tensor) -> list[Tensor | None]:
            frames = TensorDict({}, [count])
            for key, value in zip(keys, values, strict=False):
                frames[key] = value
            with torch.enable_grad():
                measured = self._losses(frames, *values[len(keys) :])
                gradients = torch.autograd.grad(total_loss(measured), self._parameters, allow_unused=True)
            names[:] = measured
            return [*(value.detach() for value in measured.values()), *gradients]

        _tell()
        generator, buffers = torch.get_rng_state(), [buffer.clone() for buffer in self._buffers]
        try:
            return _compiled(compute, values), names
        except (RuntimeError, OSError, ImportError) as error:  # the errors of inductor are RuntimeErrors
            reason = (str(error).strip() or type(error).__name__).splitlines()[0]
            print(f"warning: gradient steps are not compiled, and training goes on: {reason}", file=sys.stderr)
            return None, names
        finally:  # tracing computes, too: it has drawn, and changed buffers
            torch.set_rng_state(generator)
            for buffer, value in zip(self._buffers, buffers, strict=True):
                buffer.copy_(value)


def loss_gradients(
    losses: Losses, parameters: Sequence[Tensor], compiles: bool, buffers: Sequence[Tensor] = ()
) -> LossGradients:
    """Return what computes losses and adds their gradients, compiled or not; arguments as of `CompiledLosses`."""
    return CompiledLosses(losses, parameters, buffers) if compiles else LossGradients(losses, parameters)


@cache
def _tell() -> None:
    print("compiling gradient steps (once: later runs find them compiled)", file=sys.stderr, flush=True)


def _compiled(compute: Function, values: Sequence[Tensor]) -> Function:
    """Return the function, compiled. values: an example of its arguments."""
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", str(CACHE.expanduser()))
    # Imported here, since they take half a second, and read the variable.
    from torch._inductor import compile as compile_graph
    from torch.fx.experimental.proxy_tensor import make_fx

    traced = make_fx(compute)(*values)
    held = _lift_constants(traced)
    with torch.no_grad():
        function: Any = compile_graph(traced, [*values, *held], options=dict(OPTIONS))
    return lambda *arguments: function(*arguments, *held)


def _lift_constants(traced: GraphModule) -> list[Tensor]:
    """Make inputs of the tensors that a traced function has as constants, and return these."""
    inputs: dict[Any, Node] = {}
    held: list[Tensor] = []
    for node in list(traced.graph.nodes):
        node.meta.clear()  # shapes of the tracing, which inductor finds anew
        value = getattr(traced, node.target) if node.op == "get_attr" else None
        if not isinstance(value, Tensor):
            continue
        place = value.data_ptr(), value.dtype, value.shape, value.stride()
        if place not in inputs:
            last = [each for each in traced.graph.nodes if each.op == "placeholder"][-1]
            with traced.graph.inserting_after(last):
                inputs[place] = traced.graph.placeholder(f"held_{len(held)}")
            held.append(value.detach())
        node.replace_all_uses_with(inputs[place])
        traced.graph.erase_node(node)
    traced.recompile()
    return held

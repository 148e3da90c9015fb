"""Losses and their gradients as compiled functions: `algo.compile`.

A gradient step on small networks spends more time in Python and autograd than in products of matrices. Here losses and
gradients are traced once, as the tensor operations that they consist of, and inductor makes one C++ function of these.
It releases the interpreter's lock, so that parts of a step run beside each other. The losses are those that run
uncompiled, TorchRL's among them.

A first compilation takes 5 to 30 s. Inductor keeps what it has compiled in a folder, `~/.cache/deixis/compiled` or
$TORCHINDUCTOR_CACHE_DIR, from which any later process takes it in 1 to 4 s.
"""

from __future__ import annotations

import operator
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from tensordict import NestedKey, TensorDict, TensorDictBase
from torch import Tensor

from trainers.algorithms.algorithm import Part, backward, one_thread

if TYPE_CHECKING:
    from torch.fx import Graph, GraphModule, Node

CACHE, CACHE_VARIABLE = Path("~/.cache/deixis/compiled"), "TORCHINDUCTOR_CACHE_DIR"
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

    def parts(self, frames: TensorDictBase, *tensors: Tensor, variant: object = None) -> list[Part]:
        """Return the functions that compute them, the longest first; they may run beside each other and other ones.

        What is to be done once for such arguments is done here. No other thread may use torch meanwhile.

        variant: tells apart what the losses compute for the same shapes.
        """
        return [lambda: backward(self._losses(frames, *tensors), self._parameters)]


class CompiledLosses(LossGradients):
    """The same, compiled, in several parts if losses have no product of matrices in common.

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
        self._compiled: dict[Any, CompiledGradients | None] = {}

    def parts(self, frames: TensorDictBase, *tensors: Tensor, variant: object = None) -> list[Part]:
        named = dict(frames.items(True, True))  # a tenth of the time that looking up each key takes
        values = [*named.values(), *tensors]
        shape = variant, tuple(named), tuple(value.shape for value in values)
        if shape not in self._compiled:
            self._compiled[shape] = self._compile(list(named), len(frames), values)
        program = self._compiled[shape]
        if program is None:
            return super().parts(frames, *tensors, variant=variant)
        known = [*values, *program.held]
        if program.head is not None:
            with one_thread():
                known += program.head(known)
        return [partial(self._run, piece, program.names, known) for piece in program.pieces]

    def _run(self, piece: Piece, names: list[str], known: list[Tensor | None]) -> dict[str, Tensor]:
        with one_thread():  # a second one gains little within a product, and waits if other processes are at work
            results = piece(known)
        measured = {}
        for number, result in zip(piece.writes, results, strict=True):
            if number < len(names):
                assert result is not None
                measured[names[number]] = result
            elif result is not None:
                parameter = self._parameters[number - len(names)]
                parameter.grad = result if parameter.grad is None else parameter.grad + result
        return measured

    def _compile(self, keys: list[NestedKey], count: int, values: list[Tensor]) -> CompiledGradients | None:
        """Return the functions from the values to measured scalars and gradients; None: they could not be compiled."""
        names: list[str] = []

        def compute(*values: Tensor) -> list[Tensor | None]:
            frames = TensorDict({}, [count])
            for key, value in zip(keys, values, strict=False):
                frames[key] = value
            with torch.enable_grad():
                measured = self._losses(frames, *values[len(keys) :])
                minimised = [value for name, value in measured.items() if name.startswith("loss/")]
                # Each of them for itself, since their sum would depend on all of them.
                gradients = torch.autograd.grad(
                    [loss for loss in minimised if loss.requires_grad], self._parameters, allow_unused=True
                )
            names[:] = measured
            return [*(value.detach() for value in measured.values()), *gradients]

        _tell()
        generator, buffers = torch.get_rng_state(), [buffer.clone() for buffer in self._buffers]
        try:
            return _compiled(compute, values, names)
        except (RuntimeError, OSError, ImportError) as error:  # the errors of inductor are RuntimeErrors
            reason = (str(error).strip() or type(error).__name__).splitlines()[0]
            print(f"warning: gradient steps are not compiled, and training goes on: {reason}", file=sys.stderr)
            return None
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


@dataclass(frozen=True)
class Piece:
    """A function of some known tensors.

    Attributes:
        function: of the tensors that it reads.
        reads: their numbers in the list of those that are known.
        writes: numbers of its results among those of the whole.
    """

    function: Function
    reads: list[int]
    writes: list[int]

    def __call__(self, known: Sequence[Tensor | None]) -> list[Tensor | None]:
        return list(self.function(*(known[i] for i in self.reads)))


@dataclass(frozen=True)
class CompiledGradients:
    """Compiled losses and gradients.

    Attributes:
        held: tensors that the losses read besides their arguments.
        head: what is to be computed first: random numbers, and what changes buffers; None: nothing. Its results are
            appended to what is known: values and held tensors.
        pieces: the others, the longest first. They may run beside each other.
        names: of the first results, which are scalars; the others are the gradients of the parameters.
    """

    held: list[Tensor]
    head: Piece | None
    pieces: list[Piece]
    names: list[str]


def _compiled(compute: Function, values: Sequence[Tensor], names: list[str]) -> CompiledGradients:
    """Return the function, compiled.

    Args:
        compute: the function.
        values: an example of its arguments.
        names: of its first results.
    """
    from torch.fx.experimental.proxy_tensor import make_fx  # takes long, and is needed here alone

    choose_cache()
    traced = make_fx(compute)(*values)
    held = _lift_constants(traced)
    graph = traced.graph
    inputs = [node for node in graph.nodes if node.op == "placeholder"]
    results: list[Node | None] = list(graph.output_node().args[0])  # type: ignore[arg-type]
    head = _head(graph)
    groups = _groups(results, head)
    inner = [_ancestors([results[i] for i in group], head) for group in groups]
    passed = [node for node in graph.nodes if node in head and node.op != "placeholder"]
    passed = [node for node in passed if node in results or any(user in part for user in node.users for part in inner)]
    known = dict(zip([*inputs, *passed], range(len(inputs) + len(passed)), strict=True))
    example: list[Any] = [*values, *held]

    first = _piece(traced, head, passed, known, [], example) if head else None
    if first is not None:
        example += first(example)
    pieces = [
        _piece(traced, part, [results[i] for i in group], known, group, example)
        for part, group in zip(inner, groups, strict=True)
    ]
    return CompiledGradients(held, first, pieces, list(names))


def _piece(
    traced: GraphModule,
    nodes: set[Node],
    results: list[Node | None],
    known: dict[Node, int],
    writes: list[int],
    example: list[Any],
) -> Piece:
    """Return a part of a traced function, compiled if it has products of matrices.

    Args:
        traced: the whole.
        nodes: those that the part computes.
        results: of the part.
        known: nodes whose values are given, with their numbers.
        writes: numbers of the results among those of the whole.
        example: of what is known.
    """
    from torch._inductor import compile as compile_graph

    needed = {each for node in nodes for each in node.all_input_nodes} | {each for each in results if each is not None}
    read = [node for node in known if node in needed and node not in nodes]
    graph = torch.fx.Graph()
    copies = {node: graph.placeholder(node.name) for node in read}
    for node in traced.graph.nodes:
        if node in nodes:
            copies[node] = graph.node_copy(node, copies.__getitem__)
    graph.output([None if node is None else copies[node] for node in results])
    part = torch.fx.GraphModule(traced, graph)
    reads = [known[node] for node in read]
    function: Any = part
    if any(_is_product(node) for node in nodes):
        with torch.no_grad(), _cached():
            function = compile_graph(part, [example[i] for i in reads], options=dict(OPTIONS))
    return Piece(function, reads, writes)


def _cached() -> AbstractContextManager[object]:
    """Return a context in which inductor keeps the code of a graph, and not only what a C++ compiler makes of it.

    Without an environment of shapes, it keeps no code.
    """
    from torch._guards import TracingContext, tracing
    from torch._subclasses.fake_tensor import FakeTensorMode
    from torch.fx.experimental.symbolic_shapes import ShapeEnv

    mode = FakeTensorMode(allow_non_fake_inputs=True, shape_env=ShapeEnv(), static_shapes=True)
    return tracing(TracingContext(mode))


def _head(graph: Graph) -> set[Node]:
    """Return the nodes that draw random numbers or change inputs, and all that they and their order depend on."""
    order = {node: i for i, node in enumerate(graph.nodes)}
    first: list[Node] = []
    changed: dict[Node, Node] = {}  # what is changed, and what changes it last
    for node in order:
        if not isinstance(node.target, torch._ops.OpOverload):
            continue
        if torch.Tag.nondeterministic_seeded in node.target.tags:
            first.append(node)
        if node.target._schema.is_mutable:
            base = _viewed(node)
            if base.op == "placeholder" or any(order[user] > order[node] for user in base.users):
                changed[base] = node
    last = {node: order[by] for node in order if (by := changed.get(_viewed(node))) is not None}  # of the views, too
    before = [node for node in order if any(order[node] < last.get(each, 0) for each in node.all_input_nodes)]
    head = _ancestors([*first, *changed.values(), *before], set())
    return head.union(*(_elements(node) for node in head))


def _elements(node: Node) -> set[Node]:
    """Return the nodes of the elements of this one, if it is a tuple, which no function can be given."""
    return {user for user in node.users if user.target is operator.getitem}


def _viewed(node: Node) -> Node:
    """Return the node whose memory the result of this one is."""
    while node.op == "call_function" and node.all_input_nodes:
        arguments = node.target._schema.arguments if isinstance(node.target, torch._ops.OpOverload) else []
        if node.target is not operator.getitem and (not arguments or arguments[0].alias_info is None):
            return node
        node = node.all_input_nodes[0]
    return node


def _groups(results: list[Node | None], head: set[Node]) -> list[list[int]]:
    """Return the numbers of the results, those together that have products in common; most products first.

    head: nodes that are computed before.
    """
    groups: list[tuple[set[Node], list[int]]] = []
    for i, result in enumerate(results):
        products = {node for node in _ancestors([result], head) if _is_product(node)}
        same = [group for group in groups if group[0] & products]
        groups = [group for group in groups if not group[0] & products]
        groups.append((products.union(*(each for each, _ in same)), sorted([i, *(n for _, ns in same for n in ns)])))
    groups.sort(key=lambda group: -len(group[0]))
    without = [i for products, numbers in groups if not products for i in numbers]
    return [sorted([*groups[0][1], *without]), *(numbers for products, numbers in groups[1:] if products)]


def _ancestors(nodes: Sequence[Node | None], known: set[Node]) -> set[Node]:
    """Return these nodes and all that they are computed from, without inputs and what is known."""
    found: set[Node] = set()
    new = [node for node in nodes if node is not None]
    while new:
        node = new.pop()
        if node not in found and node not in known and node.op != "placeholder":
            found.add(node)
            new += node.all_input_nodes
    return found


def _is_product(node: Node) -> bool:
    aten = torch.ops.aten
    return node.target in (aten.mm.default, aten.addmm.default, aten.bmm.default, aten.baddbmm.default)


def choose_cache() -> None:
    """Have inductor keep what it compiles in CACHE, unless the user has named a folder.

    Importing torch's compiler sets the variable to a temporary folder, which a restart of the machine empties.
    """
    from torch._inductor.runtime.cache_dir_utils import default_cache_dir

    if os.environ.get(CACHE_VARIABLE) in (None, default_cache_dir()):
        os.environ[CACHE_VARIABLE] = str(CACHE.expanduser())


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

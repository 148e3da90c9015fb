"""Imports of torch and TorchRL without two of their own imports: the compiler and Ray.

TensorDict and TorchRL import torch's compiler to mark functions for it, and Ray for buffers on a cluster. Together they
take as long as torch itself. Nothing is compiled here, and Ray is imported in `trainers.cluster`.
Python's garbage collector takes a third of the time of such imports, and finds nothing: it is paused meanwhile.
This file imports no torch.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

COMPILER, RAY = "torch._dynamo", "ray"


@contextmanager
def paused_collector() -> Iterator[None]:
    """Within this block, which only imports, the garbage collector is off. Afterwards it ignores what was imported."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


@contextmanager
def lean_imports() -> Iterator[None]:
    """Within this block, what is imported finds no Ray, and a compiler whose marks change nothing.

    A module that was imported before stays as it is. After the block both can be imported as always. To be used for
    imports alone, and while no other thread imports.
    """
    with paused_collector():
        import torch.compiler

        stubs = {COMPILER: _compiler(torch.compiler.is_compiling), RAY: None}
        added: dict[str, Any] = {name: stub for name, stub in stubs.items() if name not in sys.modules}
        sys.modules.update(added)
        try:
            yield
        finally:
            for name in added:
                sys.modules.pop(name, None)


def import_training() -> None:
    """Import the training loop and what it needs."""
    with lean_imports():
        import_module("trainers.run.train_loop")


def import_compiler() -> None:
    """Import the compiler, which takes a second. Otherwise the first step of an optimizer imports it."""
    with paused_collector():
        import_module(COMPILER)


def _compiler(is_compiling: Callable[[], bool]) -> ModuleType:
    module = ModuleType(COMPILER)
    marks = dict.fromkeys(("allow_in_graph", "assume_constant_result", "disable"), _mark)
    module.__dict__.update(marks, is_compiling=is_compiling)
    return module


def _mark(function: Any = None, *_: Any, **__: Any) -> Any:
    """A decorator with or without arguments that returns the function itself."""
    return (lambda decorated: decorated) if function is None else function

"""Independent parts of a gradient step, each on a core of its own.

The networks are small. With two threads, each of a step's hundreds of operations waits for the other thread, and waits
long if another process uses one of the cores. Two losses on a thread each wait for each other once per step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache

import torch
from torch import Tensor

Part = Callable[[], dict[str, Tensor]]


def run_parts(parts: Sequence[Part]) -> dict[str, Tensor]:
    """Run the parts, and return their measured values together.

    They run at the same time if torch may use several threads, each on one thread; otherwise one after another. So
    they must not depend on each other, and at most one of them may draw random numbers. A single part has all threads.

    Args:
        parts: the longest first.
    """
    threads = torch.get_num_threads()
    if threads == 1 or len(parts) == 1:
        results = [part() for part in parts]
    else:
        with one_thread():
            running = [_pool(threads).submit(part) for part in parts]
            wait(running)  # all of them, even if one raises: none is left running
        results = [each.result() for each in running]
    return {name: value for result in results for name, value in result.items()}


@contextmanager
def one_thread() -> Iterator[None]:
    """Within this block torch uses one thread: more would wait for each other longer than small operations take."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that use one core each: the number is a setting of each thread."""
    return ThreadPoolExecutor(threads, "gradients", initializer=torch.set_num_threads, initargs=(1,))

"""Parts of a gradient step: at the same time where torch has several threads, and none is left running."""

import threading

import pytest
import torch

from trainers.algorithms.algorithm import run_parts


@pytest.fixture
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_parts_meet_each_other_on_one_thread_each(two_threads):
    barrier = threading.Barrier(2, timeout=10)

    def part(name):
        barrier.wait()
        return {name: torch.tensor(torch.get_num_threads())}

    assert run_parts([lambda: part("a"), lambda: part("b")]) == {"a": torch.tensor(1), "b": torch.tensor(1)}
    assert torch.get_num_threads() == 2


def test_a_single_part_has_all_threads(two_threads):
    here = threading.get_ident()
    assert run_parts([lambda: {"threads": torch.get_num_threads(), "thread": threading.get_ident()}]) == {
        "threads": 2,
        "thread": here,
    }


def test_the_other_parts_have_ended_when_one_raises(two_threads):
    started, ended = threading.Event(), threading.Event()

    def slow():
        started.set()
        ended.wait(0.2)
        ended.set()
        return {}

    def fails():
        started.wait(10)
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_parts([fails, slow])
    assert ended.is_set()
    assert torch.get_num_threads() == 2

"""The pool, with workers that answer at once but one after another."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
import torch
from tensordict import TensorDict

from tests.helpers.training_configs import training
from trainers.collect.rollouts import CollectionError, Order, WorkerPool
from trainers.collect.worker import WorkerSpec

TIMEOUT = 0.2  # seconds
CONFIG = replace(training().collector, workers=4, worlds=4, timeout=TIMEOUT, restarts=0)


class SlowToRead:
    """A worker whose answer takes half of the timeout to read."""

    answered, collect_seconds = True, 0.0

    def __init__(self, spec):
        self.spec, self.requested_at = spec, 0.0

    def request(self, iteration, weights):
        self.requested_at = time.monotonic()

    def use_buffers(self, buffers):
        pass

    def receive(self):
        time.sleep(TIMEOUT / 2)
        return TensorDict({"index": torch.full((1, 2), self.spec.index)}, [1, 2]), {}

    def overdue(self, patience, waiting_since):
        return time.monotonic() - max(waiting_since, self.requested_at) > patience

    def kill(self):
        pass


class OneAfterAnother:
    """The host of workers whose answers arrive in turn. silent: the worker whose answer never does."""

    weights, buffers = None, 1

    def __init__(self, silent=None):
        self.silent = silent

    def start(self, spec, episodes, buffers):
        return SlowToRead(spec)

    def wait(self, workers, seconds):
        answering = [worker for worker in workers if worker.spec.index != self.silent]
        if not answering:
            time.sleep(seconds)
        return answering[:1]

    def moved(self, workers):
        return []

    def allocate(self, batch):
        return batch

    def close(self):
        pass


def pool(silent=None):
    return WorkerPool(OneAfterAnother(silent), [WorkerSpec(i, 1, 2, 0) for i in range(4)], CONFIG, None)


def test_a_worker_is_not_late_while_the_answers_of_others_are_read():
    batch, _ = pool().collect(Order(0))
    assert batch["index"][:, 0].tolist() == [0, 1, 2, 3]


def test_a_worker_that_does_not_answer_is_late_once_the_others_have_been_read():
    with pytest.raises(CollectionError, match=r"worker 1 did not answer for 0.2 s"):
        pool(silent=1).collect(Order(0))


def test_each_worker_that_is_late_makes_the_pool_wait_twice_as_long_even_before_any_batch(monkeypatch):
    monkeypatch.setattr("trainers.collect.rollouts.START_SECONDS", TIMEOUT)
    config = replace(CONFIG, timeout=None, restarts=2)
    slow = WorkerPool(OneAfterAnother(silent=0), [WorkerSpec(0, 1, 2, 0)], config, None)
    with pytest.raises(CollectionError, match=r"worker 0 did not answer for 0.8 s"):
        slow.collect(Order(0))

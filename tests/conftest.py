"""Settings that all tests share."""

import gc
import os

import pytest
from hypothesis import settings

from tests.helpers import thorough

# Before anything imports torch: two workers share the cores, and threads that wait for each other are slow.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def pytest_addoption(parser):
    parser.addoption("--thorough", action="store_true", help="run all random cases, not the same sample each time")


def pytest_configure(config):
    """Choose the number of random cases before any test module is imported."""
    thorough.option["thorough"] = config.getoption("--thorough")
    settings.register_profile("sample", derandomize=True)
    settings.load_profile("default" if config.getoption("--thorough") else "sample")


@pytest.hookimpl(trylast=True)  # a sample of what -k and -m select
def pytest_collection_modifyitems(config, items):
    """Leave out the cases of `sampled` tests that are not in the sample."""
    if not config.getoption("--thorough"):
        out = thorough.left_out(items)
        config.hook.pytest_deselected(items=out)
        gone = {id(item) for item in out}
        items[:] = [item for item in items if id(item) not in gone]


def pytest_collection_finish():
    """Imported objects stay for good, so the garbage collector need not look at them again and again."""
    gc.freeze()

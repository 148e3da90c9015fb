"""Settings that all tests share, and what several modules test: made once, and changed by no test."""

import gc
import os

import pytest
from hypothesis import settings

from tests.helpers import thorough
from tests.helpers.distribution import sort_longest_first
from tests.helpers.shared_runs import made_once

# Before anything imports torch: two workers share the cores, and threads that wait for each other are slow.
os.environ.setdefault("OMP_NUM_THREADS", "1")


# ---- which tests run, and in which order ----------------------------------------------------------------------------


def pytest_addoption(parser):
    parser.addoption("--thorough", action="store_true", help="run all random cases, not the same sample each time")
    parser.addoption("--tries", type=int, help="of each row of tests/faults, in place of its own number")


def pytest_configure(config):
    """Choose the number of random cases before any test module is imported."""
    thorough.option["thorough"] = config.getoption("--thorough")
    settings.register_profile("sample", derandomize=True)
    settings.load_profile("default" if config.getoption("--thorough") else "sample")


@pytest.hookimpl(trylast=True)  # a sample of what -k and -m select
def pytest_collection_modifyitems(config, items):
    """Leave out the cases of `sampled` tests that are not in the sample, and sort the others."""
    if not config.getoption("--thorough"):
        out = thorough.left_out(items)
        config.hook.pytest_deselected(items=out)
        gone = {id(item) for item in out}
        items[:] = [item for item in items if id(item) not in gone]
    sort_longest_first(items)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give each process whole files."""
    from tests.helpers.distribution import GroupScheduling

    return GroupScheduling(config, log)


def pytest_collection_finish():
    """Imported objects stay for good, so the garbage collector need not look at them again and again."""
    gc.freeze()


# ---- what is made once ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory):
    """The folder of a training run of 256 frames with the overrides `TINY_RUN`."""
    import train
    from core.overrides import compose
    from tests.helpers.tiny_run import TINY_RUN

    return made_once(tmp_path_factory, "tiny_run", lambda folder: train.run(compose(TINY_RUN), folder))


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """The directory of a small recording of the scripted expert, by its format."""
    from tests.helpers.recordings import FORMATS, directory_of, record_formats

    folder = made_once(tmp_path_factory, "recorded", record_formats)
    return {form: directory_of(folder, form) for form in FORMATS}


@pytest.fixture(scope="session")
def recorded_episodes():
    """The episodes of `recordings`, as the environment gives them."""
    from tests.helpers.recordings import expected_episodes

    return expected_episodes()

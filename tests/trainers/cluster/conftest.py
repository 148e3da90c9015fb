"""One Ray for all tests that use one after another; other tests must not find it in their process."""

import pytest

from tests.helpers.ray_cases import end_ray, start_ray

sessions = []


@pytest.fixture
def ray():
    """A Ray with two cores. Tests leave no task and no actor in it."""
    if not sessions:
        sessions.append(start_ray(2))
    return sessions[0]


def pytest_runtest_teardown(item, nextitem):
    """End the Ray where the next test does not use it."""
    if sessions and "ray" not in getattr(nextitem, "fixturenames", ()):
        end_ray(sessions.pop())


def pytest_collection_modifyitems(items):
    """Sort the tests that use the Ray together."""
    here = [i for i, item in enumerate(items) if "/cluster/test_ray_" in item.nodeid]
    ordered = sorted((items[i] for i in here), key=lambda item: "ray" not in item.fixturenames)
    for i, item in zip(here, ordered, strict=True):
        items[i] = item

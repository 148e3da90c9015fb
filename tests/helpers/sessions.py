"""A session of the page without the page, for the tests of a module, and driving it."""

from contextlib import closing

import pytest

from demo.session import Session
from demo.session_config import make_config

MAX_STEPS = 200  # control steps of one instruction


def session_fixture(seed=3, **choices):
    """A fixture: the session of a module, with these choices of `make_config`."""

    @pytest.fixture(scope="module")
    def session():
        with closing(Session(make_config(**choices), seed)) as session:
            yield session

    return session


def run_to_end(session, max_steps=MAX_STEPS):
    """Steps until the instruction has ended. Returns the status."""
    for _ in range(max_steps):
        if not session.busy:
            return session.view.status
        session.step()
    raise AssertionError(session.view.status)

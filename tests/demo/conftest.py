"""What the tests of pages share."""

import pytest

from tools.browser import headless_browser


@pytest.fixture(scope="module")
def browser():
    """A Chromium without a window."""
    with headless_browser() as browser:
        yield browser

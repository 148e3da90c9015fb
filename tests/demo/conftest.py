"""What the tests of pages share."""

import pytest

from tools.browser import CHROMIUM


@pytest.fixture(scope="module")
def browser():
    """A Chromium without a window and without a graphics card, for pages that draw no scene."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()

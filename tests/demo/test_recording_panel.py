"""Videos of the page that nobody downloads: they are saved."""

import time

import pytest

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from tools.browser import CHROMIUM, PageTab, PlayServer, headless_browser

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]

SECONDS = 60.0  # to wait for a file


def videos(folder, count):
    """The mp4 files in a folder, once there are so many."""
    deadline = time.monotonic() + SECONDS
    while len(files := list(folder.glob("deixis-*.mp4"))) < count and time.monotonic() < deadline:
        time.sleep(0.2)
    return files


def start_video(browser, server):
    page = PageTab(browser, server.address, blank=True)
    page.open_lab("Record")
    page.press("Start video")
    page.tab.get_by_role("button", name="Stop video").wait_for()
    return page.tab


def test_a_video_is_saved_when_the_last_tab_is_closed_and_when_the_server_ends(tmp_path):
    server = PlayServer("--seed", "3", "task=nl_reach", "driver=expert", folder=tmp_path)
    with headless_browser() as browser:
        start_video(browser, server).close()
        assert len(videos(tmp_path, 1)) == 1
        start_video(browser, server)
        errors = server.close()
    assert "Traceback" not in errors
    assert server.process.returncode == 0
    assert [path.read_bytes()[4:8] for path in videos(tmp_path, 2)] == [b"ftyp", b"ftyp"]

"""Docs: every page is in the navigation, links and anchors resolve, the site builds and loads no other host."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
LOADED = re.compile(
    r"<(?:script|img|iframe|source|video)\b[^>]*\bsrc=[\"']?(?:https?:)?//|<link\b[^>]*\bhref=[\"']?(?:https?:)?//"
)
EXAMPLES = re.findall(r"^```python\n(.*?)^```$", (DOCS / "quickstart.md").read_text("utf-8"), re.MULTILINE | re.DOTALL)


class Loader(yaml.SafeLoader):
    """Reads mkdocs.yml."""


def pages(entry):
    """Every page in an entry of the navigation."""
    if isinstance(entry, str):
        return [entry]
    return [page for each in (entry if isinstance(entry, list) else entry.values()) for page in pages(each)]


def test_every_page_is_in_the_navigation_once():
    listed = pages(yaml.load((ROOT / "mkdocs.yml").read_text("utf-8"), Loader)["nav"])
    assert sorted(listed) == sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))


def test_links_between_pages_and_to_files_are_valid():
    for page in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", re.sub(r"`[^`\n]*`", "", page.read_text("utf-8"))):
            assert link.startswith("http") or (page.parent / link).exists(), f"{page.name}: {link}"


def test_a_link_or_anchor_that_leads_nowhere_fails_the_strict_build():
    checked = yaml.load((ROOT / "mkdocs.yml").read_text("utf-8"), Loader)["validation"]
    assert set(checked["links"].values()) == set(checked["nav"].values()) == {"warn"}
    assert {"not_found", "anchors", "absolute_links", "unrecognized_links"} <= set(checked["links"])
    assert {"not_found", "omitted_files"} <= set(checked["nav"])


def test_the_glossary_defines_each_word_once():
    words = re.findall(r"^\* \*\*([\w ,-]+)\*\*: ", (DOCS / "glossary.md").read_text("utf-8"), re.MULTILINE)
    assert len(words) >= 40
    assert len(words) == len(set(words))


@pytest.mark.slow
@pytest.mark.parametrize("code", EXAMPLES, ids=range(len(EXAMPLES)))
def test_an_example_of_the_quick_start_runs(code):
    exec(compile(code, "docs/quickstart.md", "exec"), {"__name__": "example"})


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason='mkdocs is missing: pip install -e ".[docs]"')
def test_the_site_builds_strictly_and_loads_nothing_from_other_hosts(tmp_path):
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    offline = {
        "PATH": "/usr/bin:/bin",
        "NO_MKDOCS_2_WARNING": "1",
        "http_proxy": "http://127.0.0.1:9",
        "https_proxy": "http://127.0.0.1:9",
    }
    done = subprocess.run(build, cwd=ROOT, env=offline, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    made = sorted(tmp_path.rglob("*.html"))
    assert len(made) > len(list(DOCS.rglob("*.md")))  # one more: the page for errors 404
    for page in made:
        assert not LOADED.search(page.read_text("utf-8")), page
    styles = "".join(path.read_text("utf-8") for path in tmp_path.rglob("*.css"))
    assert not re.search(r"url\([\"']?(?:https?:)?//|@import", styles)
    assert not list(tmp_path.rglob("*.py"))
    for name, item in (("deixis", "deixis.policy.load_policy"), ("envs", "envs.registration.make_env")):
        assert f'id="{item}"' in (tmp_path / "reference" / "api" / f"{name}.html").read_text("utf-8")
    assert 'href="../tasks.html"' in (tmp_path / "reference" / "api" / "envs.html").read_text("utf-8")

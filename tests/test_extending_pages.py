"""docs/tutorial.md and docs/extending.md are true: a copy of the project, with what they add, runs and learns."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TUTORIAL, PAGE = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("tutorial.md", "extending.md"))
BLOCKS = [
    block for page in (TUTORIAL, PAGE) for block in re.findall(r"^```(\w*)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
]
FILE = re.compile(r"# ([\w/]+\.(?:py|yaml))\n")
PARTS = ("conf", "envs", "human", "language", "trainers", "train.py")
TRAIN = """
from pathlib import Path
import torch, train
from conf.overrides import compose
torch.set_num_threads(1)
small = ["total_frames=128", "collector.workers=1", "collector.worlds=4", "eval.episodes=2", "eval.worlds=2"]
small += ["eval.interval_episodes=2", "eval.video_episodes=0", "logger=[]", "task.max_steps=8"]
result = train.run(compose(["robot=ur5", "task=hover", "algo=a2c", *small]), Path("run"))
assert result["frames"] == 128 and Path("run/checkpoints/last.pt").is_file()
"""


def edited(text, block):
    """The text with the change that a diff block shows; the lines that are there already must be found once."""
    lines = block.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "-"))
    after = "".join(f"{line[1:]}\n" for line in lines if line[:1] in (" ", "+"))
    assert text.count(before) == 1, before
    return text.replace(before, after)


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The project with all that the pages add."""
    folder = tmp_path_factory.mktemp("extended")
    for part in PARTS:
        source, skipped = ROOT / part, shutil.ignore_patterns("__pycache__")
        shutil.copytree(source, folder / part, ignore=skipped) if source.is_dir() else shutil.copy(source, folder)
    for kind, block in BLOCKS:
        named = FILE.match(block)
        if not named:
            continue
        path, rest = folder / named[1], block[named.end() :]
        if kind == "diff":
            path.write_text(edited(path.read_text(encoding="utf-8"), rest), encoding="utf-8")
        else:
            assert not path.exists()
            path.write_text(rest, encoding="utf-8")
    return folder


def run(folder, code):
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env={"PYTHONPATH": str(folder)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def test_what_the_pages_add_runs_and_trains(copy):
    examples = [block for kind, block in BLOCKS if kind == "python" and not FILE.match(block)]
    assert len(examples) == 6  # three of the tutorial; a robot, a task, a relation
    run(copy, "\n".join([*examples, TRAIN]))


def test_one_page_shows_all_that_can_be_added():
    added = {FILE.match(block)[1] for kind, block in BLOCKS if FILE.match(block)}
    assert {path.split("/")[0] for path in added} == {"conf", "envs", "language", "trainers"}
    for kind in ("robot", "task", "relation", "algorithm"):
        assert re.search(rf"^## An? {kind}$", PAGE, re.MULTILINE)


def test_what_it_adds_is_in_the_style_of_the_house(copy):
    files = [str(copy / FILE.match(block)[1]) for kind, block in BLOCKS if kind == "python" and FILE.match(block)]
    for command in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--config", str(ROOT / "pyproject.toml"), "--no-cache", *files],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout

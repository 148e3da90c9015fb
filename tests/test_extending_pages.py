"""docs/tutorial.md and docs/extending.md are true: a copy of the project, with what they add, runs and learns."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.commands import FILE, copied, edited, followed

ROOT = Path(__file__).resolve().parent.parent
TUTORIAL, PAGE = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("tutorial.md", "extending.md"))
BLOCKS = [
    block for page in (TUTORIAL, PAGE) for block in re.findall(r"^```(\w*)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
]
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


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The project with all that the pages add."""
    folder = copied(tmp_path_factory.mktemp("extended"))
    docs = ROOT / "docs"
    with followed(docs / "tutorial.md", folder), followed(docs / "extending.md", folder):
        yield folder
    assert (folder / "language" / "relations.py").read_text() == (ROOT / "language" / "relations.py").read_text()
    assert not (folder / "conf" / "task" / "hover.yaml").exists()


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


def test_a_change_to_what_is_not_there_is_noticed():
    assert edited("a\nb\n", " a\n+c\n") == "a\nc\nb\n"
    with pytest.raises(ValueError, match="found 0 times"):
        edited("a\nb\n", "-c\n+d\n")
    with pytest.raises(ValueError, match="found 2 times"):
        edited("a\na\n", " a\n+d\n")

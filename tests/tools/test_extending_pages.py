"""docs/tutorial.md and docs/extending.md: a copy of the project with the files that they add runs and trains."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tools.documented_commands import FENCE, FILE_HEADER, copy_project, page_applied

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL, EXTENDING = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("tutorial.md", "extending.md"))
BLOCKS = [block for page in (TUTORIAL, EXTENDING) for block in FENCE.findall(page)]
TRAIN = """
from pathlib import Path
import torch, train
from core.overrides import compose
torch.set_num_threads(1)
small = ["total_frames=128", "collector.workers=1", "collector.worlds=4", "eval.episodes=2", "eval.worlds=2"]
small += ["eval.interval_episodes=2", "eval.video_episodes=0", "logger=[]", "task.max_steps=8"]
added = ["robot=ur10", "control=joint_step", "task=hover", "algo=awr", "algo.minibatch=64"]
result = train.run(compose([*added, *small]), Path("run"))
assert result["frames"] == 128 and Path("run/checkpoints/last.pt").is_file()
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The project with all files that the pages add."""
    folder = copy_project(tmp_path_factory.mktemp("extended"))
    docs = ROOT / "docs"
    with page_applied(docs / "tutorial.md", folder), page_applied(docs / "extending.md", folder):
        yield folder
    assert (folder / "language" / "relations.py").read_text() == (ROOT / "language" / "relations.py").read_text()
    assert not (folder / "conf" / "task" / "hover.yaml").exists()


def run(folder, code):
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env={"PYTHONPATH": str(folder)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_the_added_files_run_and_train(copy):
    examples = [block for kind, block in BLOCKS if kind == "python" and not FILE_HEADER.match(block)]
    # Three of the tutorial; a robot, a control, a task, a reward term, an observation, a relation, a check.
    assert len(examples) == 10
    run(copy, "\n".join([*examples, TRAIN]))


@pytest.mark.parametrize(
    ("kind", "files"),
    [
        ("robot", {"conf/robot/ur10.yaml"}),
        ("control mode", {"envs/mdp/controls.py", "conf/control/joint_step.yaml"}),
        ("task", {"envs/tasks/hover.py", "conf/task/hover.yaml", "envs/experts/hover.py"}),
        ("reward term", {"envs/tasks/hover.py", "conf/task/hover.yaml"}),
        ("observation", {"envs/mdp/observations.py"}),
        ("relation", {"language/relations.py"}),
        # A loss of TorchRL is one YAML; one that it lacks is a file more.
        ("algorithm", {"conf/algo/ddpg.yaml", "trainers/algorithms/awr.py", "conf/algo/awr.yaml"}),
    ],
)
def test_an_addition_touches_these_files_only(kind, files):
    section = re.search(rf"^## An? {kind}$(.*?)(?=^## )", EXTENDING, re.MULTILINE | re.DOTALL)[1]
    touched = {header[1] for _, block in FENCE.findall(section) if (header := FILE_HEADER.match(block))}
    assert touched == files


def test_the_added_files_pass_ruff(copy):
    files = [
        str(copy / FILE_HEADER.match(block)[1])
        for kind, block in BLOCKS
        if kind == "python" and FILE_HEADER.match(block)
    ]
    for command in (["check"], ["format", "--check"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--config", str(ROOT / "pyproject.toml"), "--no-cache", *files],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout

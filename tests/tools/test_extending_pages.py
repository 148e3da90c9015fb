"""docs/tutorial.md and docs/extending.md: a copy of the project with the files that they add runs and trains."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import trainers.run.train_loop  # noqa: F401  # and its libraries, for the forks
from tests.helpers.programs import run_code_from
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

READ = """
from pathlib import Path
import torch, train
from core.overrides import compose
from envs import make_env
from trainers.algorithms.algorithm import build_algorithm
from trainers.config import read_training
from trainers.run import checkpoint

torch.set_num_threads(1)
small = ["total_frames=256", "collector.workers=1", "collector.worlds=4", "eval.episodes=2", "eval.worlds=2"]
small += ["eval.interval_episodes=2", "eval.video_episodes=0", "logger=[]", "algo.minibatch=32", "device=cpu"]
train.run(compose(small), Path("run_of_{reader}"))
saved = checkpoint.load(checkpoint.find(Path("run_of_{reader}")))
env = make_env([], num_worlds=4)
assert env.readers["time_left"] == "{reader}"
others = {{key: each for key, each in env.readers.items() if key != "time_left"}}
built = []
for readers in (env.readers, others):
    torch.manual_seed(saved["config"]["seed"])
    training = read_training(saved["config"])
    words, unit = env.tokenizer.vocabulary, env.action_unit
    built.append(build_algorithm(training, env.observation_spec, unit, words, env.hindsight, readers)[1])
trained, plain = built


def network(algorithm):
    critic = algorithm.critic.module
    encoder, actor = algorithm.policy.encoder, algorithm.policy.actor
    return {{"actor": actor.net[0], "scene": encoder.slot_linear, "critic": critic.heads[0][0]}}["{reader}"]


layer = network(trained)
assert layer.in_features == network(plain).in_features + 1
column = env.observation_spec["robot"].shape[-1] if "{reader}" == "critic" else -1  # of time_left
initial = layer.weight[:, column].detach().clone()
trained.load_state_dict(saved["algorithm"])
assert (layer.weight[:, column] != initial).any()  # a gradient has reached it
frames = env.reset()
early, late = (frames.clone().set("time_left", torch.full((4, 1), share)) for share in (1.0, 0.0))
if "{reader}" == "critic":
    early, late = (trained.critic(each)["state_value"] for each in (early, late))
else:
    policy = checkpoint.fitted_policy(saved, saved["config"], env)
    early, late = (policy.act(each)["action"] for each in (early, late))
assert not torch.equal(early, late)
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
    done = run_code_from([folder], code, folder)
    assert done.code == 0, done.err
    assert "Traceback" not in done.err


@pytest.mark.slow
def test_the_added_files_run_and_train(copy):
    examples = [block for kind, block in BLOCKS if kind == "python" and not FILE_HEADER.match(block)]
    # Three of the tutorial; a robot, a control, a task, a reward term, an observation, a relation, a check.
    assert len(examples) == 10
    run(copy, "\n".join([*examples, TRAIN]))


@pytest.mark.slow
@pytest.mark.parametrize("reader", ["actor", "scene", "critic"])
def test_a_trained_network_reads_the_added_observation(copy, reader):
    table = copy / "envs" / "mdp" / "observations.py"
    text = table.read_text()
    declared = 'gymnasium=True,\n        reader="actor",\n    ),\n    ObservationTerm(\n        "robot",'
    assert text.count(declared) == 1
    table.write_text(text.replace(declared, declared.replace("actor", reader)))
    try:
        run(copy, READ.format(reader=reader))
    finally:
        table.write_text(text)


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

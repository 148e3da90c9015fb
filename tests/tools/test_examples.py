"""The programs of examples/ run; for how long, and how well, each is trained, its own page tells."""

import importlib.util
import json
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch

import record
from trainers.environment import TrainingEnv

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ppo_pytorch", "torchrl_ppo"])
def test_ppo_learns_for_a_few_batches(name, capsys):
    assert 0 <= example(name).main(["--frames", "2048"]) <= 1
    assert len(capsys.readouterr().out.splitlines()) == 2


@pytest.mark.slow
def test_stable_baselines3_learns_for_a_few_batches(capsys):
    pytest.importorskip("stable_baselines3")
    example("stable_baselines3_ppo").main(["--frames", "1024", "--interval", "1024", "--episodes", "16"])
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines() if line.startswith("{")]
    assert rows[0]["frames"] == 1024
    assert 0 <= rows[0]["success"] <= 1


def test_an_example_says_which_library_it_needs(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(SystemExit, match="this example needs `pip install stable-baselines3`"):
        example("stable_baselines3_ppo")


@pytest.mark.slow
@pytest.mark.parametrize("env", ["Deixis/NLPush-v0", "Deixis/Reach-v0"])
@pytest.mark.parametrize("learner", ["sb3-ppo", "sb3-sac", "sbx-ppo", "sbx-sac"])
def test_others_learn_with_words_and_with_goals(env, learner, capsys, monkeypatch):
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("sbx" if learner.startswith("sbx") else "stable_baselines3")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example("other_learners").main([env, learner, "--frames", "2048", "--interval", "2048", "--episodes", "4"])
    settings, *_, row = (json.loads(line) for line in capsys.readouterr().out.splitlines() if line.startswith("{"))
    assert set(settings) == {"settings"}
    assert row["frames"] == 2048
    assert 0 <= row["success"] <= 1
    assert row["evaluating"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lerobot", "minari"])
def test_a_recording_is_imitated(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    folder = tmp_path / "demos-v0"
    record.main(["expert=true", "task=reach", "episodes=8", f"format={kind}", f"out={folder}"])
    assert example("imitation").main([str(folder), "--steps", "300", "--episodes", "20"]) > 0


@pytest.mark.slow
def test_our_trainers_learn_in_a_gymnasium_environment_with_goals(tmp_path, capsys):
    words = ["algo=sac", "total_frames=600", "algo.learning_starts=300", "collector.worlds=4", "collector.workers=1"]
    result = example("goal_env").main(["Deixis/Reach-v0", *words, "eval.episodes=4", "--folder", str(tmp_path)])
    assert result["frames"] == 600
    assert 0 <= result["success_at_end"] <= 1
    assert json.loads(capsys.readouterr().out.splitlines()[-1]) == {"success_at_end": result["success_at_end"]}
    more = [*words, "total_frames=800", "eval.episodes=4", "--folder", str(tmp_path)]
    assert example("goal_env").main(["Deixis/Reach-v0", *more])["frames"] > 600  # the same run goes on


@pytest.fixture(scope="module")
def goal_worlds():
    goal_env = example("goal_env")
    with closing(goal_env.GoalWorlds("Deixis/Reach-v0", goal_env.measure_bounds("Deixis/Reach-v0"), 2)) as env:
        yield env


def test_worlds_with_goals_are_a_training_env_whose_episodes_can_be_continued(goal_worlds):
    assert isinstance(goal_worlds, TrainingEnv)
    goal_worlds.set_seed(1)
    frames = goal_worlds.rollout(5)
    beginnings = list(goal_worlds.beginnings)
    goal_worlds.continue_episodes(beginnings, frames["action"], torch.tensor([5, 5]))
    assert torch.equal(goal_worlds.reset()["robot"], frames[:, -1]["next", "robot"])


def test_hindsight_of_worlds_with_goals_ends_where_the_new_goal_is_achieved(goal_worlds):
    goal_worlds.set_seed(2)
    episodes = [goal_worlds.rollout(20)[i] for i in range(2)]
    relabelled = goal_worlds.hindsight(episodes, 0)
    assert relabelled
    for frames in relabelled:
        goal, achieved = frames["next", "privileged", "goal"], frames["next", "robot"][:, -3:]
        apart = (goal - achieved).norm(dim=-1)
        assert frames["next", "reward"][-1] == 0
        assert (frames["next", "reward"][:-1] < 0).all()
        assert apart[-1] < apart[:-1].min()


@pytest.mark.parametrize(("name", "said"), [("Nothing-v0", "not known"), ("CartPole-v1", "desired_goal")])
def test_an_environment_without_goals_is_refused(name, said):
    with pytest.raises(SystemExit, match=said):
        example("goal_env").main([name])


def notebook_cells():
    """The code cells of the notebook, by their ids."""
    content = json.loads((EXAMPLES / "first_policy.ipynb").read_text("utf-8"))
    return {cell["id"]: cell for cell in content["cells"] if cell["cell_type"] == "code"}


class Notebook:
    """Runs cells in one namespace, as a kernel does.

    names: what the cells define. axes: those of each figure that they show.
    """

    def __init__(self, monkeypatch):
        import matplotlib.pyplot as plt

        plt.switch_backend("agg")
        monkeypatch.setattr(plt, "show", lambda: self.axes.extend(plt.gcf().axes) or plt.close())
        self.cells = {name: "".join(cell["source"]) for name, cell in notebook_cells().items()}
        self.names, self.axes = {"__name__": "notebook"}, []

    def run(self, *ids):
        for name in ids or self.cells:
            exec(compile(self.cells[name], f"cell {name}", "exec"), self.names)
            if name == "parameters":
                assert {"FRAMES", "EPISODES"} <= set(self.names)
                self.names |= {"FRAMES": 1024, "EPISODES": 12}


@pytest.fixture
def notebook(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # of the training, a process of its own
    monkeypatch.chdir(tmp_path)
    return Notebook(monkeypatch)


def test_the_notebook_is_kept_without_outputs():
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in notebook_cells().values())


@pytest.mark.slow
def test_the_notebook_trains_evaluates_plots_and_films(notebook, capsys):
    notebook.run()
    names = notebook.names
    assert "success_at_end" in capsys.readouterr().out.splitlines()[0]
    assert [row["frames"] for row in names["metrics"]] == [1024]
    assert {name: result.episodes for name, result in names["results"].items()} == dict.fromkeys(names["readers"], 12)
    assert [axes.get_xlabel() for axes in notebook.axes] == ["frames", "success", "y, metres: to the robot's left"]
    assert len(notebook.axes[1].patches) == len(names["bars"]) > 3
    assert len(names["pictures"]) == len(names["paths"]) - 1 == len(list(names["film"].new_frame_seq()))


@pytest.mark.slow
def test_the_notebook_shows_that_a_trained_policy_follows_the_words(notebook):
    notebook.run("imports", "parameters")
    notebook.names["FOLDER"] = "nl_reach_kuka"
    notebook.run("evaluate", "effect", "film")
    names = notebook.names
    success = {name: result.success_at_end for name, result in names["results"].items()}
    assert success["its sentence"] >= 0.9
    assert max(success["no words"], success["another sentence"]) <= 0.7
    assert names["outcomes"] == ["success"] * 3
    assert len(set(names["sentences"])) == 3
    paths, places = np.array(names["paths"]), names["objects"][:, :3].numpy()
    assert np.ptp(paths[0], axis=0).max() == 0  # equal beginnings
    ends = np.linalg.norm(paths[:, :, None] - places, axis=-1).min(0)  # (3 worlds, 3 objects) least distances
    assert sorted(ends.argmin(1)) == [0, 1, 2]
    assert "<img" in names["film"]._repr_html_()

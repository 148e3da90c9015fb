"""A package of a user's own beside the project: its classes are found by every program, also in worker processes."""

from pathlib import Path

import pytest

import trainers.run.train_loop  # noqa: F401  # and its libraries, for the forks
from tests.helpers.own_package import OWN_OPTIONS, USES, write_own_package
from tests.helpers.programs import run_code_from, run_module_from

ROOT = Path(__file__).resolve().parents[2]
TINY = ["total_frames=256", "collector.worlds=8", "algo.horizon=16", "algo.minibatch=64", "eval.episodes=2"]
TINY += ["eval.interval_episodes=2", "eval.worlds=2", "eval.video_episodes=0", "logger=[]", "task.max_steps=8"]


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Runs Python where the package is installed, with `-c` and code, or `-m` and a module with its words."""
    place = tmp_path_factory.mktemp("own")
    paths = [ROOT, write_own_package(place / "site")]

    def run(option, what, *words):
        run = run_code_from if option == "-c" else run_module_from
        done = run(paths, what, *words, folder=place)
        assert "Traceback" not in done.err, done.err
        return done

    return run


@pytest.mark.slow
def test_an_own_expert_does_an_own_task_with_an_own_verb(python):
    assert python("-c", USES).code == 0
    assert "object the red cube" in python("-m", "deixis", "parse", "greet the red cube").out


@pytest.mark.slow
def test_an_own_algorithm_trains_an_own_policy_in_workers(python):
    done = python("-m", "train", *OWN_OPTIONS, *TINY, "collector.workers=2", "hydra.run.dir=run")
    assert "256 frames" in done.out, done.err
    done = python("-m", "train", "resume=run", "total_frames=384")
    assert "384 frames" in done.out, done.err
    done = python("-m", "evaluate", "checkpoint=run", "episodes=2", "worlds=2")
    assert "success_at_end" in done.out, done.err
    done = python("-m", "train", *OWN_OPTIONS, "algo.decay=2")
    assert done.err.startswith("error: algo.decay=2.0 is out of range"), done.err
    done = python("-m", "train", *OWN_OPTIONS, "policy.dropout=1")
    assert done.err.startswith("error: policy.dropout=1.0 is out of range"), done.err


@pytest.mark.slow
def test_every_loss_of_an_own_module_is_minimised_and_reported(python):
    done = python("-m", "train", "algo=my_loss", "collector.workers=1", *TINY, "hydra.run.dir=loss")
    assert "256 frames" in done.out, done.err
    header = python("-c", "print(open('loss/metrics.csv').readline())").out
    assert {"loss/actor", "loss/smooth"} <= set(header.strip().split(","))


@pytest.mark.slow
def test_a_loss_of_another_module_is_not_imported(python):
    done = python("-m", "train", "algo=a2c", "algo.loss=this.Zen")
    assert done.err.startswith("error: algo.loss=this.Zen is not known"), done.err
    assert "Beautiful" not in done.out

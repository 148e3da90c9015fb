"""`python -m human.camera`: training and evaluation from the command line."""

import numpy as np
import pytest
import torch

from core.errors import ConfigError
from human import camera
from human.arms import Unreachable
from human.camera import fit, generate_frames, main, ray_loss
from human.ray_reader import SHIPPED_WEIGHTS, as_input, load
from tests.helpers.programs import run_module


@pytest.mark.slow
def test_train_and_evaluate_run_from_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(camera, "VALIDATION_BODIES", 1)
    monkeypatch.setattr("human.synthetic_frames.BODIES", 2)
    out = tmp_path / "deep" / "weights.npz"
    main(["train", f"out={out}", "frames=70", "epochs=2"])
    assert "epoch 2/2: loss" in capsys.readouterr().out
    found = main(["evaluate", f"weights={out}", "scenes=5", "objects=3"])
    assert found["true_ray"] == 1
    assert main(["evaluate", f"weights={out}", "scenes=3", "aim=area"])["true_ray"] == 1
    assert "frames/s rendered and read" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing is not a command"),
        (["trian"], "did you mean 'train'"),
        (["train", "frames"], "key=value"),
        (["train", "frames=0"], "frames=0 is out of range"),
        (["train", "frames=many"], "frames=many"),
        (["train", "epoch=3"], "did you mean 'epochs'"),
        (["train", "out=/proc/none/x.npz"], "out=/proc/none/x.npz cannot be written"),
        (["train", "workspace.human.camera.width=100"], "a multiple of 16"),
        (["evaluate", "aim=sky"], "aim=sky is not known"),
        (["evaluate", "workspace=table"], "has no person"),
        (["evaluate", "workspace.human.camera=null"], "needs workspace.human.camera"),
        (["evaluate", "workspace.human.camra.yaw=3"], "is not a known key"),
        (["evaluate", "weights=nowhere.npz"], "gesture.weights=nowhere.npz is not a file"),
        (["evaluate", "objects=12", "task.spacing=0.4"], "do not fit"),
    ],
)
def test_wrong_arguments_are_reported_in_one_line(words, message, tmp_path):
    if words and words[0] == "train" and not any(word.startswith("out=") for word in words):
        words = [*words, f"out={tmp_path / 'w.npz'}"]
    with pytest.raises(ConfigError) as caught:
        main(words)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_an_area_out_of_reach_is_reported_in_one_line(camera_setup, monkeypatch):
    def refuse(self, target, style="finger"):
        raise Unreachable("target: the person can't point there")

    monkeypatch.setattr("human.body.Body.solve", refuse)
    with pytest.raises(ConfigError, match=r"^workspace\.object_area=\[.*contains places out of reach: target"):
        main(["evaluate", "scenes=1"])
    with pytest.raises(ConfigError, match=r"^workspace\.object_area=\[.*can't point at any of 1000 places$"):
        generate_frames(camera_setup, 1, np.random.default_rng(0), bodies=1)


@pytest.mark.slow
def test_training_does_not_change_the_shipped_weights(camera_setup, monkeypatch, tmp_path):
    before = SHIPPED_WEIGHTS.stat().st_mtime_ns
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(camera, "VALIDATION_BODIES", 1)
    monkeypatch.setattr("human.synthetic_frames.BODIES", 1)
    main(["train", "frames=2", "epochs=1"])
    load(tmp_path / "pointing.npz", camera_setup.human)
    assert SHIPPED_WEIGHTS.stat().st_mtime_ns == before


def test_errors_exit_with_1_and_no_traceback():
    done = run_module("human.camera", "evaluate", "scenes=-1")
    assert done.code == 1
    assert done.err.splitlines()[-1].startswith("error: scenes=-1 is out of range")
    assert "Traceback" not in done.err


@pytest.mark.slow
def test_the_loss_falls_on_a_few_frames(frames):
    every = np.arange(len(frames.tips))

    def loss(network):
        with torch.no_grad():
            return float(ray_loss(network(as_input(frames.pictures)), frames, every))

    before = loss(fit(frames, 1, seed=0))
    assert loss(fit(frames, 25, seed=0)) < 0.6 * before


@pytest.mark.slow
def test_training_repeats_bit_for_bit_with_the_seed(frames):
    one, again, other = (fit(frames, 2, seed).state_dict() for seed in (3, 3, 4))
    assert all(torch.equal(value, again[name]) for name, value in one.items())
    assert not all(torch.equal(value, other[name]) for name, value in one.items())


def test_the_help_names_every_key():
    for defaults in camera.DEFAULTS.values():
        assert all(f"{key}=" in camera.__doc__ for key in defaults)

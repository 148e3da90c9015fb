"""The programs of examples/ run; for how long, and how well, each is trained, its own page tells."""

import importlib.util
import json
from pathlib import Path

import pytest

import record

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


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


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lerobot", "minari"])
def test_a_recording_is_imitated(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    folder = tmp_path / "demos-v0"
    record.main(["expert=true", "task=reach", "episodes=8", f"format={kind}", f"out={folder}"])
    assert example("imitation").main([str(folder), "--steps", "300", "--episodes", "20"]) > 0

"""train.py and evaluate.py as a person uses them, on real worlds. One short training serves most tests."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

import evaluate
import train
from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.tiny_run import TINY_RUN
from tools.forked import call
from trainers.run.metrics import read_metrics

pytestmark = pytest.mark.slow
ROOT = Path(train.__file__).parent
SHORT = [
    "total_frames=20_480",
    "collector.workers=2",
    "collector.worlds=32",
    "eval.episodes=60",
    "eval.video_episodes=1",
]


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train.run(compose(SHORT), folder)
    return folder


def command(*arguments: str, program: str = "train.py", timeout: float = 120) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(ROOT / program), *arguments],
        capture_output=True,
        text=True,
        timeout=timeout,
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
    )


def test_a_run_writes_its_report(trained):
    names = {str(path.relative_to(trained)) for path in trained.rglob("*")}
    wanted = {"config.yaml", "metrics.csv", "eval.json", "learning_curve.png", "evaluation.mp4"}
    assert wanted | {"checkpoints/last.pt", "checkpoints/best.pt"} <= names
    assert any("events" in name for name in names)
    result = json.loads((trained / "eval.json").read_text())
    assert {"success_at_end", "success_once", "wrong_object", "ci95", "frames", "wall_s", "frames_per_s"} <= set(result)
    assert sum(part["episodes"] for part in result["by_kind"].values()) == result["episodes"] == 60
    rows = read_metrics(trained / "metrics.csv")
    assert rows[-1]["frames"] == result["frames"] == 20_480
    assert {"reward/progress", "reward/success", "reward/wrong_object", "reward/time"} <= set(rows[0])


def test_a_short_run_learns_to_ground_instructions(trained):
    result = json.loads((trained / "eval.json").read_text())
    assert result["success_at_end"] > 0.6
    assert read_metrics(trained / "metrics.csv")[-1]["grounding/accuracy"] > 0.9


def test_without_the_words_a_trained_policy_falls_to_chance(trained):
    env, policy = restored(trained)
    try:
        normal, blank = outcomes(env, policy, blank=False), outcomes(env, policy, blank=True)
    finally:
        env.close()
    assert normal["attended"] > 0.95
    assert abs(blank["attended"] - 1 / 3) < 0.112  # three standard errors of 160 scenes
    assert blank["success"] < 1 / 3 + 0.112 < normal["success"]


def restored(folder: Path):
    from envs import read_env
    from trainers.run import checkpoint

    saved = checkpoint.load(checkpoint.find(folder))
    env = train.build_env(read_env(saved["config"]), 40, 77)
    return env, checkpoint.fitted_policy(saved, saved["config"], env).act


@torch.no_grad()
def outcomes(env, policy, blank: bool) -> dict[str, float]:
    """Over 160 episodes: how often attention selects the referent at the start, and how often they succeed."""
    env.set_seed(3)
    attended, success = [], []
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        for _ in range(4):
            state = env.reset()
            done = torch.zeros(40, 1, dtype=torch.bool)
            for t in range(env.config.task.max_steps):
                seen = state.exclude("privileged").clone()
                if blank:
                    seen["instruction"].zero_()
                acted = policy(seen)
                if t == 0:
                    attended.append(acted["attention_logits"].argmax(-1) == state["privileged", "referent"])
                state["action"] = acted["action"]
                state = env.step(state)["next"]
                success.append((state["success"] & ~done).sum() / 160)
                done |= state["done"]
                if done.all():
                    break
    return {"attended": float(torch.stack(attended).float().mean()), "success": float(sum(success))}


def test_evaluate_prints_the_interval_and_never_overwrites(trained, capsys):
    first = evaluate.main([f"checkpoint={trained}", "episodes=20"])
    again = evaluate.main([f"checkpoint={trained / 'checkpoints' / 'last.pt'}", "episodes=20"])
    assert first["success_at_end"] == again["success_at_end"]
    assert "95 %" in capsys.readouterr().out
    assert {"evaluation_1.json", "evaluation_2.json"} <= {path.name for path in trained.iterdir()}


def test_a_policy_trained_on_three_objects_is_evaluated_on_six(trained):
    assert evaluate.main([f"checkpoint={trained}", "episodes=20", "task.num_objects=6"])["episodes"] == 20


def test_evaluate_ablates_instructions_and_names_each_object_in_turn(trained):
    success = evaluate.main([f"checkpoint={trained}", "episodes=40"])["success_at_end"]
    for words in ("blank", "swapped"):
        ablated = evaluate.main([f"checkpoint={trained}", "episodes=40", f"words={words}"])["success_at_end"]
        assert ablated < success - 0.2
    in_turn = evaluate.main([f"checkpoint={trained}", "in_turn=12"])
    assert (in_turn["scenes"], in_turn["episodes"]) == (12, 36)
    assert in_turn["success_at_end"] > 0.6  # by chance, a third


def test_the_oracle_understands_every_sentence(trained):
    assert evaluate.main([f"checkpoint={trained}", "episodes=40", "reader=oracle"])["success_at_end"] >= 0.95


def test_evaluate_reports_each_split(trained, capsys):
    held_out = ["color_noun=[[red,cube]]", "relation_noun=[[behind,cube]]", "phrases=['touch {object}']"]
    short = [f"checkpoint={trained}", "episodes=8", "worlds=4", "splits=true"]
    report = evaluate.main([*short, *(f"task.held_out.{pair}" for pair in held_out)])
    assert set(report["by_split"]) == {"train", "test_composition", "test_paraphrase", "test_length"}
    assert all(part["episodes"] == 8 for part in report["by_split"].values())
    assert "test_paraphrase" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="held out"):
        evaluate.main(short)


def test_resume_continues_in_the_same_folder(tiny_run, tmp_path):
    copied = Path(shutil.copytree(tiny_run, tmp_path / "run"))
    config, folder = train.resumed(str(copied), ["total_frames=320", "eval.episodes=3"])
    assert folder == copied
    assert train.run(config, folder)["frames"] == 320
    frames = [row["frames"] for row in read_metrics(copied / "metrics.csv")]
    assert frames == sorted(set(frames))
    assert frames[-1] == 320


def test_a_new_run_never_overwrites_another_one(tiny_run):
    before = (tiny_run / "metrics.csv").read_bytes()
    done = call(partial(train.cli, [*TINY_RUN, "seed=6", f"hydra.run.dir={tiny_run}"]), ROOT)
    check_refusal(done.code, done.out, done.err, [f"hydra.run.dir={tiny_run}", f"resume={tiny_run}"])
    assert (tiny_run / "metrics.csv").read_bytes() == before


def test_a_run_is_not_resumed_to_fewer_frames_than_it_has(tiny_run):
    before = (tiny_run / "config.yaml").read_bytes()
    with pytest.raises(
        ConfigError, match=f"total_frames=128 is less than the 256 frames of resume={tiny_run}; give more"
    ):
        train.resumed(str(tiny_run), ["total_frames=128"])
    assert (tiny_run / "config.yaml").read_bytes() == before


def test_a_run_that_is_resumed_keeps_its_seed_and_its_folder(tiny_run, tmp_path):
    with pytest.raises(ConfigError, match=f"seed=6: resume={tiny_run} was trained with seed=5, and keeps it"):
        train.resumed(str(tiny_run), ["seed=6"])
    done = call(partial(train.cli, [f"resume={tiny_run}", f"hydra.run.dir={tmp_path / 'other'}"]), ROOT)
    check_refusal(done.code, done.out, done.err, [f"goes on in {tiny_run}", "leave out hydra.run.dir"])
    assert not (tmp_path / "other").exists()


def test_a_run_that_goes_on_from_its_best_policy_says_so(tiny_run, tmp_path, capsys):
    copied = Path(shutil.copytree(tiny_run, tmp_path / "run"))
    (copied / "checkpoints" / "last.pt").unlink()
    train.resumed(str(copied), [])
    assert "has no last.pt: its best.pt of " in capsys.readouterr().out
    train.resumed(str(copied / "checkpoints" / "best.pt"), [])
    assert capsys.readouterr().out == ""


def test_the_same_seed_gives_the_same_training_bit_for_bit(tiny_run, tmp_path):
    def rows(folder: Path) -> list[dict[str, float]]:
        measured = read_metrics(folder / "metrics.csv")
        return [{k: v for k, v in row.items() if not k.startswith("time/")} for row in measured]

    train.run(compose(TINY_RUN), tmp_path)
    assert str(rows(tiny_run)) == str(rows(tmp_path))


@pytest.mark.parametrize(
    ("arguments", "expected_words"),
    [
        (["algo.lrr=1"], ["algo.lrr", "did you mean 'algo.lr'"]),
        (["robt=kuka"], ["robt", "did you mean 'robot'"]),
        (["algo.lr=-1"], ["algo.lr=-1", "[1e-07, 1]"]),
        (["algo.lr=nan"], ["algo.lr=nan"]),
        (["task.num_objects=9"], ["task.num_objects=9", "[1, 8]"]),
        (["task.num_objects=few"], ["task.num_objects=few", "Integer"]),
        (["collector.worlds=0"], ["collector.worlds=0", "[1, 4096]"]),
        (["task.reward.progres=1"], ["progres"]),
        (["device=abacus"], ["device=abacus"]),
        (["resume=/nowhere"], ["/nowhere", "does not exist"]),
        (["robot.urdf=nothing.urdf"], ["robot.urdf=nothing.urdf"]),
        (["nonsense"], ["nonsense", "key=value"]),
        (["logger=[books]"], ["logger=books", "tensorboard"]),
        (["algo.minibatch=100_000"], ["algo.minibatch=100000"]),
        (["collector.workers=3"], ["collector.worlds=64", "collector.workers=3"]),
        (["scenario=7"], ["scenario=7 is not known", "1, 2, 3, 4, 5, none"]),
        (["sweep.resume=/nowhere"], ["/nowhere is not the directory of a sweep"]),
    ],
)
def test_bad_input_gets_one_clear_message(arguments, expected_words, tmp_path):
    done = call(partial(train.cli, [*arguments, f"hydra.run.dir={tmp_path / 'run'}"]), ROOT)
    check_refusal(done.code, done.out, done.err, expected_words)
    assert not (tmp_path / "run").exists()


def check_refusal(code: int, out: str, err: str, expected_words: list[str]) -> None:
    assert code == 1
    assert "Traceback" not in err + out
    lines = [line for line in err.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    for words in expected_words:
        assert words in lines[0]


def test_bad_input_ends_the_process_with_one_clear_message():
    done = command("robot=kuca")
    check_refusal(done.returncode, done.stdout, done.stderr, ["robot=kuca", "did you mean 'kuka'"])


@pytest.mark.parametrize(
    ("overrides", "expected_words"),
    [
        ([], "checkpoint"),
        (["checkpoint=/nowhere"], "/nowhere"),
        (["checkpoint={run}", "robot=panda"], "trained with robot=kuka"),
        (["checkpoint={run}", "control=joints"], "trained with control=step"),
        (["checkpoint={run}", "episodes=0"], "episodes=0"),
        (["checkpoint={run}", "epsiodes=3"], "epsiodes=3: epsiodes is not a known key; did you mean 'episodes'"),
        (["checkpoint={run}/eval.json"], "not a checkpoint of this project"),
        (["checkpoint={run}", "words=loud"], "words=loud is not known"),
        (["checkpoint={run}", "splits=true"], "splits=true needs a task with held-out sentences"),
        (["checkpoint={run}", "out={run}/result.png"], "result.png must end in .json"),
        (["checkpoint={run}", "out={run}/eval.json"], "eval.json exists already and is not overwritten"),
        (["checkpoint={run}", "words=swapped", "worlds=1"], "worlds of at least 2"),
        (["checkpoint={run}", "reader=parrot"], "reader=parrot"),
        (["checkpoint={run}", "eval.episodes="], "eval.episodes=: eval.episodes is for .*; give episodes=<number>$"),
        (["checkpoint={run}", "eval.episodes=3"], "eval.episodes=3: eval.episodes is for .*; give episodes=<number>$"),
        (["checkpoint={run}", "eval.video_episodes=1"], "give video=<number>$"),
        (["checkpoint={run}", "eval.overlap=false"], "leave it out$"),
    ],
)
def test_evaluate_refuses_bad_input(tiny_run, overrides, expected_words):
    with pytest.raises(ConfigError, match=expected_words):
        evaluate.main([word.format(run=tiny_run) for word in overrides])


def test_help_needs_neither_torch_nor_pybullet():
    code = "import sys, train, evaluate; sys.exit(any(m in sys.modules for m in ('torch', 'pybullet', 'torchrl')))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
    assert "robot" in command("--help").stdout

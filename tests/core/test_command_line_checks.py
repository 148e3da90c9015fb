"""Words after `train.py`, and overrides that a file stores: each mistake gets one sentence before Hydra starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from core.command_line import check_file, check_folder, check_run, check_stored, split
from core.errors import ConfigError
from core.overrides import apply, compose


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["~seed"], "~seed: every run needs seed"),
        (["~robot"], "robot=None is not known; choose from"),
        (["seed=${nosuch}"], "seed=${nosuch} cannot be resolved: .*; write the value itself"),
        (["seed=???"], "seed=??? has no value; give seed=<value>"),
        (["resume="], "resume= has no value"),
        (["+x=1"], "+x=1: x is not a known key; choose from"),
        (["+robot=kuka"], "an option is chosen as robot=kuka"),
        (["robot@foo=kuka"], "an option is chosen as robot=kuka"),
        (["seed=range(0,0)"], "has no values: give at least one"),
        (["robot=kuka,panda"], "python train.py -m robot=kuka,panda"),
        (["task.objects=[1,2]"], "task.objects=[1,2]: Cannot merge .*; it is a group of keys: init, goal"),
        (["сид=1"], "сид=1: сид is not a known key; keys are written in Latin letters"),
        (["seed==3"], "seed==3: .*; overrides are written key=value"),
        (["seed =3"], "seed =3 has a blank in its key; give seed=3"),
        ([" seed= 3"], " seed= 3 has a blank in its key; give seed=3"),
        (["=3"], "=3: .*is not a known key"),
        (["--config-dir=/nosuch"], "--config-dir=/nosuch: the config is that of this project"),
        (["--experimental-rerun", "x.pickle"], "--experimental-rerun: the config"),
        (["--nosuch"], "--nosuch is not a flag"),
        (["--cfg", "jobs"], "--cfg jobs is not known; did you mean 'job'"),
        (["hydra/launcher=nosuch"], "hydra/launcher=nosuch: .*; choose from basic, joblib"),
        (["hydra.nosuch=1"], "hydra.nosuch=1: Could not override"),
        (["hydra.run.dir=/dev/null/x"], "hydra.run.dir=/dev/null/x cannot be a folder: /dev/null is a file"),
        (["-m", "seed=1,2", "hydra.launcher.n_jobs=x"], "hydra.launcher.n_jobs=x: Value 'x' .* Integer"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mistake_is_named_with_what_would_be_right(words, message):
    with pytest.raises(ConfigError) as caught:
        check_run(words)
    text = str(caught.value)
    parts = message.split(".*")
    assert all(part in text for part in parts), text
    assert "\n" not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--cfg", "job"],
        ["--help"],
        ["seed=3", "hydra.run.dir=runs/a", "+task.reward.extra=1"],
        ["-m", "seed=1,2", "robot=kuka,panda", "hydra/launcher=joblib"],
        ["eval.interval=${total_frames}"],
    ],
)
def test_good_words_pass(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_run(words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "word",
    [
        "+hydra.callbacks.x._target_=joblib.load",
        "hydra.callbacks.sweep._target_=os.system",
        "hydra.launcher._target_=os.system",
        "++hydra.launcher._target_=os.system",
        "hydra.searchpath=[file:///tmp]",
        "hydra/launcher=submitit_local",
        "hydra/job_logging=default",
        "hydra.sweep.subdir=../../x",
        "hydra.run.dir=${oc.env:HOME}",
        "seed=${oc.env:HOME}",
        "'task.name=${oc.env:HOME}'",
        "+task.reward.extra=1",
        "++seed=1",
        "robot@hydra.launcher=kuka",
        "nosuch=1",
        "~seed",
        "--config-dir=/tmp",
        "--experimental-rerun",
        "seed=1\nhydra.run.dir=x",
        "",
        "collector=ray",
        "collector=local,ray",
        "device=cuda:1",
        "logger=[wandb]",
        "robot.urdf=/etc/passwd",
        "robot.package=file",
        "gesture.weights=/etc/passwd",
        "init=/home",
        "resume=/home",
        "sweep.resume=/home",
    ],
)
def test_a_file_sets_only_keys_of_the_project(word):
    with pytest.raises(ConfigError, match=r"^sweep\.yaml is refused: ") as caught:
        check_stored(["seed=0,1", word], Path("sweep.yaml"))
    assert "command line" in str(caught.value)


@pytest.mark.slow
def test_overrides_of_a_sweep_are_accepted_from_a_file():
    check_stored(["scenario='1','2'", "seed=range(0,3)", "algo.lr=0.1,0.2", "robot=kuka,panda"], Path("x"))
    check_stored(["hydra.sweep.dir='/tmp/a b'", "hydra/launcher=basic", "~task.reward.time"], Path("x"))


def test_arguments_of_a_program_are_given_once_and_with_a_value():
    with pytest.raises(ConfigError, match="episodes=2: episodes is given twice, with episodes=1 before"):
        split(["episodes=1", "episodes=2"], ["episodes"], "episodes=1")
    with pytest.raises(ConfigError, match="out= has no value"):
        split(["out="], ["out"], "episodes=1")


def test_a_misspelt_argument_of_a_program_gets_its_nearest_name():
    with pytest.raises(ConfigError, match="episods=1: episods is not a known key; did you mean 'episodes'"):
        split(["episods=1"], ["episodes", "out"], "episodes=1")
    kept = ["seed=1", "eval.episodes=2", "robot=panda"]  # keys of the config, however near to an argument's name
    assert split(kept, ["seeds", "episodes", "robots"], "episodes=1") == ({}, kept)


def test_places_that_cannot_be_written_are_found_before_the_work(tmp_path):
    (tmp_path / "file").touch()
    for place in ("/proc/x", tmp_path / "file" / "x", "/nosuch" * 1000, "a\0b"):
        with pytest.raises(ConfigError, match=r"out=.* cannot be"):
            check_folder("out", str(place))
        with pytest.raises(ConfigError, match=r"out=.* cannot be"):
            check_file("out", f"{place}/x")
    with pytest.raises(ConfigError, match=r"is a folder; give the name of a file in it"):
        check_file("out", tmp_path)
    with pytest.raises(ConfigError, match=r"must end in \.mp4 or \.avi"):
        check_file("out", tmp_path / "x.gif", (".mp4", ".avi"))
    assert check_file("out", tmp_path / "new" / "x.json") == tmp_path / "new" / "x.json"


@pytest.mark.slow
def test_overrides_of_a_checkpoint_that_do_not_fit_are_named(tmp_path, monkeypatch):
    from omegaconf import OmegaConf

    monkeypatch.chdir(tmp_path)
    saved = OmegaConf.to_container(compose(), resolve=True)
    for word in ("task.objects=[1,2]", "seed=", "seed=???", "eval.episodes=[", "seed=${oc.env:HOME"):
        with pytest.raises(ConfigError, match="^" + word.partition("=")[0].replace(".", r"\.")) as caught:
            apply(saved, [word])
        assert "\n" not in str(caught.value)

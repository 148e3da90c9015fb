"""Options of the config from a folder of the user's own, and modules of installed packages."""

import shutil

import pytest
import yaml

import evaluate
from core.composition import compose, groups
from core.errors import ConfigError
from core.overrides import check, comment
from core.plugins import ROOT, VARIABLE, take_config_dir
from envs import make_env
from tests.helpers.own_robots import own_robot


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with an option `robot=my_arm`: a kuka whose URDF is a file of the user's own."""
    monkeypatch.setenv(VARIABLE, "")
    (tmp_path / "conf of mine" / "robot").mkdir(parents=True)
    own = yaml.safe_load((ROOT / "robot" / "kuka.yaml").read_text())
    own |= {"name": "my_arm", "package": "file", "urdf": own_robot(tmp_path / "urdf").urdf}
    (tmp_path / "conf of mine" / "robot" / "my_arm.yaml").write_text("# Mine.\n" + yaml.safe_dump(own))
    return tmp_path / "conf of mine"


def test_a_robot_of_a_folder_is_an_option_like_ours(folder):
    with pytest.raises(ConfigError, match="robot=my_arm is not known"):
        check(["robot=my_arm"])
    assert take_config_dir(["--config-dir", str(folder), "task=nl_push"]) == ["task=nl_push"]
    assert "my_arm" in groups()["robot"]
    assert comment("robot", "my_arm") == "Mine."
    env = make_env(["robot=my_arm"])
    assert env.config.robot.name == "my_arm"
    env.close()


def test_a_yaml_that_was_edited_is_read_again(folder):
    take_config_dir([f"--config-dir={folder}"])
    path = folder / "robot" / "my_arm.yaml"
    assert compose(["robot=my_arm"]).robot.gain == 0.3
    path.write_text(path.read_text().replace("gain: 0.3", "gain: 0.2"))
    assert compose(["robot=my_arm"]).robot.gain == 0.2
    path.write_text(path.read_text().replace("gain: 0.2", "gain: 7"))
    with pytest.raises(ConfigError, match=r"robot\.gain=7\.0 is out of range"):
        make_env(["robot=my_arm"])


def test_an_own_robot_does_not_replace_that_of_a_checkpoint(folder):
    words = take_config_dir(["--config-dir", str(folder), "checkpoint=nl_reach_kuka", "robot=my_arm"])
    with pytest.raises(ConfigError, match="robot=my_arm: the checkpoint was trained with robot=kuka"):
        evaluate.main(words)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--config-dir=/nosuch"], "--config-dir /nosuch is not a folder"),
        (["--config-dir"], "is not a folder"),
        (["--config-dir", "{taken}"], "has the name of an option that"),
        (["--config-dir", "{group}"], "is in no group of the config"),
    ],
)
def test_a_folder_that_cannot_be_taken_is_refused_with_the_reason(folder, words, message):
    shutil.copytree(ROOT / "robot", folder / "taken" / "robot")
    (folder / "group" / "robots").mkdir(parents=True)
    (folder / "group" / "robots" / "a.yaml").write_text("name: a\n")
    places = {"taken": folder / "taken", "group": folder / "group"}
    with pytest.raises(ConfigError, match=message):
        take_config_dir([word.format(**places) for word in words])

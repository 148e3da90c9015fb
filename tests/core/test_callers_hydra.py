"""A program with a Hydra of its own keeps it when it builds an environment."""

import pytest
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.version import VersionBase

from core.composition import compose_hydra
from core.errors import ConfigError


@pytest.fixture
def own_config(tmp_path):
    (tmp_path / "mine.yaml").write_text("learning_rate: 0.5\n")
    return tmp_path


def test_a_program_composes_its_own_config_before_and_after_ours(own_config):
    with initialize_config_dir(str(own_config), version_base="1.2"):
        assert hydra_compose("mine").learning_rate == 0.5
        assert compose_hydra(["robot=panda"]).robot.name == "panda"
        with pytest.raises(ConfigError):
            compose_hydra(["robot=nobody"])
        assert hydra_compose("mine", ["learning_rate=1"]).learning_rate == 1
        assert str(VersionBase.instance().getbase()) == "1.2"
    assert not GlobalHydra.instance().is_initialized()


def test_a_program_without_a_hydra_of_its_own_has_none_afterwards():
    GlobalHydra.instance().clear()
    compose_hydra([])
    assert not GlobalHydra.instance().is_initialized()

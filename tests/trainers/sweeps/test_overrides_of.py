"""The overrides that compose a config."""

from __future__ import annotations

import pytest
from omegaconf import OmegaConf

from core.errors import ConfigError
from core.overrides import compose
from tests.helpers.training_keys import training_keys
from trainers.sweeps.runs import overrides_of


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["scenario=4", "task.reward.lift=0"],
        ["task=nl_reach_gesture", "robot=jaco", "gesture.noise_deg=3.5", "task.reward.time=-1e-05"],
        ["task=nl_reach_large", "algo=sac", "task.held_out.phrases=['touch {object}', ball]", "task.varied=false"],
    ],
)
def test_the_overrides_of_a_config_compose_it_again(words):
    config = compose(words)
    words_again = overrides_of(OmegaConf.to_container(config, resolve=True))
    assert training_keys(compose(words_again)) == training_keys(config)
    assert len(words_again) == len(words)


def test_a_config_that_is_older_than_a_group_is_composed_with_its_default():
    config = OmegaConf.to_container(compose(["robot=panda", "perception=camera"]), resolve=True)
    del config["choices"]["perception"]
    words = overrides_of(config)
    assert words[0] == "robot=panda"
    assert "perception.name=camera" in words


def test_a_config_without_recorded_options_is_refused():
    config = OmegaConf.to_container(compose(), resolve=True)
    del config["choices"]
    with pytest.raises(ConfigError, match="saved by an earlier version"):
        overrides_of(config)

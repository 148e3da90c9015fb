"""Every YAML of conf/ reads into its dataclass; overrides are checked and applied."""

from dataclasses import fields
from pathlib import Path

import hydra
import pytest
import yaml
from hydra import initialize_config_module
from omegaconf import OmegaConf, open_dict

import conf
from core.composition import quoted
from core.errors import ConfigError
from core.overrides import apply, check, compose, groups
from envs import read_env
from trainers.config import read_training

FOLDER = Path(conf.__file__).parent
OPTIONS = sorted((path.parent.name, path.stem) for path in FOLDER.glob("*/*.yaml"))


@pytest.fixture(scope="module")
def default():
    return compose()


def test_every_file_is_an_option_of_a_group():
    assert sorted((group, option) for group, each in groups().items() for option in each) == OPTIONS
    assert sorted(FOLDER.rglob("*.yaml")) == sorted(
        [
            *FOLDER.glob("*/*.yaml"),
            *FOLDER.glob("hydra/launcher/*.yaml"),  # options of Hydra's own group
            FOLDER / "config.yaml",
            FOLDER / "task_defaults.yaml",
        ]
    )


def test_the_same_overrides_are_composed_once_and_give_configs_of_their_own(monkeypatch):
    words = ["robot=panda", "total_frames=4_321"]
    first = compose(words)
    first.total_frames = 1
    monkeypatch.setattr("core.composition.compose_hydra", lambda words: pytest.fail("composed again"))
    assert compose(words).total_frames == 4_321


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["robot=panda", "robot=jaco", "control=step"],
        ["scenario=1", "task.num_objects=3", "robot=jaco", "logger=[]", "task.reward={time: -1}"],
        ["task=press", "~task.reward.success", "+task.reward={other: 2}", "+task.reward.another=3"],
        ["hydra.run.dir=somewhere", "seed=1"],
        ["task.num_objects=${seed}", "seed=2"],
    ],
)
def test_options_and_values_are_set_as_hydra_sets_them(words):
    with initialize_config_module("conf", version_base="1.3"):
        wanted = hydra.compose("config", quoted(words), return_hydra_config=True)
    choices = wanted.hydra.runtime.choices
    config = compose(words)
    assert dict(config.choices) == {group: choices[group] for group in groups()}
    with open_dict(config), open_dict(wanted):
        del config["choices"], wanted["hydra"]
    assert OmegaConf.to_yaml(config) == OmegaConf.to_yaml(wanted)


def test_config_yaml_names_every_group():
    contents = yaml.safe_load((FOLDER / "config.yaml").read_text())["defaults"]
    named = {key for entry in contents if isinstance(entry, dict) for key in entry}
    assert {key for key in named if not key.startswith("override hydra/")} == set(groups())


def test_the_help_lists_every_task_in_one_family():
    header = yaml.safe_load((FOLDER / "config.yaml").read_text())["hydra"]["help"]["header"]
    listed = [task for line in header.splitlines()[3:] for task in line.partition(": ")[2].split(", ")]
    assert sorted(listed) == groups()["task"]


@pytest.mark.slow
@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_option_reads_into_its_dataclass(group, option):
    needed = {"fingers": ["robot=panda"], "hinge": ["robot=so_arm"], "pixels": ["algo=bc"]}.get(option, [])
    config = compose([f"{group}={option}", *needed])
    environment, training = read_env(config), read_training(config)
    if group == "scenario":
        return  # values of other groups
    holder = environment if hasattr(environment, group) else training
    values = getattr(holder, group)
    if hasattr(values, "name"):
        # A larger nl_reach is the same task with other values; PPO with a rising discount factor is PPO.
        assert values.name == option.removesuffix("_large").removesuffix("_rising_gamma")


def test_every_key_of_the_config_is_declared(default):
    environment, training = read_env(default), read_training(default)
    declared = {*vars(environment), *vars(training), *vars(training.run), "choices", "resume", "run", "sweep"}
    assert set(default) <= declared


NEWER = {
    "cameras",
    "instructions",
    "verbs",
    "devices",
    "hand",
    "by_verb",
    "critic_warmup",
    "device_area",
    "clearance",
    "hinge",
    "gap",
    "randomize",
    "automatic",
    "radius",
    "hold_steps",
    "max_steps",
    "drawn_objects",
    "final_gamma",
}  # keys that the configs of earlier policies lack


def test_dataclasses_of_the_config_have_no_defaults():
    """A dataclass that declares a value has no default beside it, but for configs that are older than the key."""
    config = compose()
    for holder in (read_env(config), read_training(config)):
        for part in filter(None, vars(holder).values()):  # pictures are None unless a policy asks for them
            defaults = {field.name for field in fields(part) if field.default is not field.default_factory}
            assert defaults <= NEWER, type(part)


# ---- overrides as they are typed -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        [],
        ["robot=panda", "task.num_objects=6", "total_frames=50_000"],
        ["+task.reward.extra=1"],
        ["~task.reward.time"],
        ["robot=kuka,panda", "seed=1,2"],
        ["--help"],
        ["-m", "robot=kuka,jaco"],
        ["hydra.run.dir=somewhere"],
        ["task=reach", "task.max_steps=5"],
    ],
)
def test_valid_overrides_pass(words):
    check(words)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("robot=pand", r"^robot=pand is not known; did you mean 'panda'\?$"),
        ("robot=kuka,pand", r"^robot=pand is not known; did you mean 'panda'\?$"),
        ("contrl=step", r"^contrl=step: contrl is not a known key; did you mean 'control'\?$"),
        ("task.raduis=1", r"^task\.raduis=1: task\.raduis is not a known key; did you mean 'task\.radius'\?$"),
        ("seeds=1", r"^seeds=1: seeds is not a known key; did you mean 'seed'\?$"),
        ("seed", "overrides are written key=value$"),
    ],
)
def test_invalid_overrides_are_refused_with_a_suggestion(word, message):
    with pytest.raises(ConfigError, match=message) as caught:
        check([word])
    assert "\n" not in str(caught.value)


def test_errors_of_hydra_become_config_errors():
    with pytest.raises(ConfigError):
        compose(["robot=nobody"])


@pytest.mark.slow
def test_overrides_apply_to_a_saved_config(default):
    kept = OmegaConf.to_container(default, resolve=True)
    changed = apply(kept, ["task.max_steps=7", "task.reward.time=-1", "physics.sleeping=false", "total_frames=5_000"])
    assert read_env(changed).task.max_steps == 7
    assert read_env(changed).task.reward["time"] == -1
    assert read_env(changed).physics.sleeping is False
    assert read_training(changed).run.total_frames == 5000
    assert read_env(apply(kept, ["task=reach"])).task.name == "reach"
    assert kept == OmegaConf.to_container(default, resolve=True)
    with pytest.raises(ConfigError, match=r"did you mean 'task\.max_steps'"):
        apply(kept, ["task.max_step=7"])


def test_a_resumed_run_keeps_its_worlds_where_another_collector_is_chosen():
    kept = OmegaConf.to_container(compose(["collector.worlds=32", "collector.workers=4"]), resolve=True)
    changed = apply(kept, ["collector=ray", "collector.cpus=0.5"])
    assert (changed.collector.name, changed.collector.worlds, changed.collector.workers) == ("ray", 32, 4)
    assert (changed.collector.cpus, changed.collector.mode, changed.choices.collector) == (0.5, "async", "ray")
    back = apply(OmegaConf.to_container(changed), ["collector=local", "collector.workers=2"])
    assert (back.collector.workers, "mode" in back.collector) == (2, False)

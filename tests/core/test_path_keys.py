"""Words that set a path: Hydra gets the path that stands in them, whatever characters it has."""

from __future__ import annotations

import pytest

from core.command_line import check_run
from core.composition import composed, output_folder, parse, split_run_folder
from core.errors import ConfigError
from core.overrides import apply, first_value
from core.path_keys import PATH_KEYS, from_hydra, to_hydra, unescaped
from core.stored_config import PLACES
from tests.helpers.folder_names import NAMES

MORE = (
    "null ",
    "true",
    "1e3",
    "\\${b}",
    "a\\",
    "\\'",
    "a'\\''",
    "..",
    "a\tb",
    "[1,2]",
    "{a: 1}",
    "a: b",
    "# a",
    "!a b",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NAMES, *MORE, "/tmp/'a', \"b\"/c = d"])
def test_a_path_reaches_the_config_as_it_was_written(name):
    word = f"init={name}"
    assert from_hydra(to_hydra(word)) == word
    assert first_value(parse([word])[0]) == word
    assert composed([word])[0].init == name
    saved = {"init": None, "seed": 0}
    assert apply(saved, [word]).init == name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a${b}", "${oc.env}{x}", "a b,c", "it's", "{a}$"])
def test_an_output_folder_is_named_as_it_was_written(name):
    assert unescaped(output_folder([f"hydra.run.dir=/tmp/{name}"], "run")) == f"/tmp/{name}"


@pytest.mark.slow
def test_an_output_folder_can_be_named_by_interpolations_that_exist():
    for known in ("${seed}", "${now:%H}", "${algo.name}"):
        assert to_hydra(f"hydra.run.dir=runs/{known}", lambda name: name != "b") == f"hydra.run.dir='runs/{known}'"
        assert output_folder([f"hydra.run.dir=runs/{known}"], "run") == f"runs/{known}"
    assert composed(["init=${seed}"])[0].init == "${seed}"


def test_no_path_and_several_paths_of_a_sweep_are_left_to_hydra():
    assert composed(["init=null"])[0].init is None
    [override] = parse(["init=choice(a,'b c')"])
    assert [*override.sweep_string_iterator()] == ["a", "b\\ c"]
    assert [from_hydra(f"init={value}") for value in override.sweep_string_iterator()] == ["init=a", "init=b c"]
    assert first_value(override) == "init=a"
    with pytest.raises(ConfigError, match="init= has no value"):
        check_run(["init="])


def test_every_key_that_names_a_file_of_the_machine_is_a_path():
    others = {"device", "logger", "collector.name", "collector.address", "collector.dashboard"}
    assert {*PLACES} - others <= {*PATH_KEYS}


def test_hydra_is_not_told_a_folder_whose_name_it_would_replace():
    words, folder = split_run_folder(["seed=1", "hydra.run.dir=/tmp/a${b}/c"])
    assert (words, str(folder)) == (["seed=1", "hydra.run.dir=/tmp"], "/tmp/a${b}/c")
    assert split_run_folder(["hydra.run.dir=runs/${seed}"]) == (["hydra.run.dir=runs/${seed}"], None)
    with pytest.raises(ConfigError, match=r"hydra\.sweep\.dir=a\$\{b\}: Hydra would replace"):
        split_run_folder(["hydra.sweep.dir=a${b}"])

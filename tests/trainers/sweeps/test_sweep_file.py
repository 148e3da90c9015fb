"""sweep.yaml: the starts of a sweep."""

from __future__ import annotations

import pytest

from core.errors import ConfigError
from trainers.sweeps.runs import add_start, read_starts


def test_starts_are_read_in_the_order_in_which_they_were_added(tmp_path):
    add_start(tmp_path, ["seed=0,1"])
    add_start(tmp_path, ["seed=2"])
    first, second = read_starts(tmp_path)
    assert (first["overrides"], second["overrides"]) == (["seed=0,1"], ["seed=2"])
    assert "cores" in first["machine"]


def test_a_directory_without_a_sweep_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"not the directory of a sweep: it has no sweep\.yaml"):
        read_starts(tmp_path)

"""Optional dependencies."""

from __future__ import annotations

import math
import sys

import pytest

import record
from core.errors import ConfigError
from core.system import import_optional


def test_a_missing_library_is_named_with_the_extra_that_installs_it(monkeypatch, tmp_path):
    for library, form in (("minari", "minari"), ("pyarrow", "lerobot")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(
            ConfigError, match=rf"need {library}, which is not installed: pip install -e \"\.\[record\]\""
        ):
            record.main(["expert=true", f"format={form}", f"out={tmp_path / 'it'}"])
    assert not list(tmp_path.iterdir())


def test_installed_modules_are_returned():
    assert import_optional("math", "os.path")[0] is math

"""The random messages of `tools.hostile_messages`."""

from __future__ import annotations

import json
from typing import get_args

import numpy as np
import pytest

from demo.tab_messages import KINDS, TabCheck
from tools.hostile_messages import ACTIONS, sensible_message


def test_thesensible_messages_are_those_that_a_tab_can_ask_for():
    assert set(ACTIONS) == {kind.__struct_config__.tag for kind in get_args(KINDS)}


@pytest.mark.parametrize("action", list(ACTIONS))
def test_the_page_takes_what_a_person_could_do(action):
    check, rng = TabCheck(), np.random.default_rng(0)
    drawn = [each for each in (sensible_message(rng) for _ in range(2000)) if each["do"] == action]
    assert len(drawn) > 20
    assert all(check.read(json.dumps(each)) is not None for each in drawn)

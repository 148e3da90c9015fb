"""Random instructions."""

import numpy as np
import pytest

from language import Wording, parse, say, understand
from language.sampling import sample


@pytest.mark.slow
@pytest.mark.parametrize("depth", [None, 0, 1, 2, 3])
@pytest.mark.parametrize("steps", [1, 3])
def test_samples_are_understood_and_have_the_requested_depth(depth, steps):
    rng = np.random.default_rng(0)
    for drawn in sample(20, rng, depth=depth, steps=steps, wording=Wording()):
        assert parse(drawn.sentence) == parse(say(drawn.command)) == drawn.command
        assert len(understand(drawn.command, drawn.scene).steps) == steps
        if depth is not None:
            assert {step.phrase.depth for step in drawn.command.steps} == {depth}

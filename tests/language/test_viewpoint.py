"""Viewpoints of a scene."""

import numpy as np
import pytest

from language import LanguageError, Object, Scene

THINGS = (
    Object("cube", "red", (0.4, 0.1, 0.02), size=0.04),
    Object("sphere", "blue", (0.5, -0.1, 0.02), role="target"),
)


def test_the_human_viewpoint_is_opposite_the_robot():
    seen = Scene(THINGS, viewpoint="human").seen
    assert np.allclose(seen, [(0.6, -0.1, 0.02), (0.5, 0.1, 0.02)])
    assert (Scene(THINGS).seen == Scene(THINGS).positions).all()


def test_an_unknown_viewpoint_is_refused():
    with pytest.raises(LanguageError, match="did you mean 'human'"):
        Scene(THINGS, viewpoint="humans")

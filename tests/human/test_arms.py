"""The arm that holds out an open hand: where the palm lies, which way it faces, and what is out of reach."""

import itertools

import numpy as np
import pytest

from core.overrides import compose
from envs.config import read_env
from human import Unreachable, read_arm
from human.arms import HAND, NORMAL, PALM, AttachedPoint, OfferingArm


@pytest.fixture(scope="module")
def human():
    return read_env(compose(["workspace=handover"])).workspace.human


def test_the_palm_is_where_it_is_wanted_and_faces_up_all_over_its_workspace(human):
    chain = read_arm(human).model.other
    arm, sides = OfferingArm(chain), np.reshape(human.palm, (3, 2))
    for place in itertools.product(*(np.linspace(*side, 5) for side in sides)):
        angles = arm.solve(place)
        assert (angles >= chain.low).all()
        assert (angles <= chain.high).all()
        frames = chain.frames(angles)
        palm, end = (chain.place(AttachedPoint(HAND, point), frames) for point in (PALM, PALM + NORMAL))
        np.testing.assert_allclose(palm, place, atol=2e-3)
        np.testing.assert_allclose((end - palm) / 0.1, [0.0, 0.0, 1.0], atol=0.03)


def test_a_place_beyond_the_arm_is_unreachable(human):
    with pytest.raises(Unreachable, match="the person cannot hold an open hand there"):
        OfferingArm(read_arm(human).model.other).solve((-0.3, 0.0, 0.1))

"""A session of the page in which the robot sees its objects with cameras, by the network of the project."""

from contextlib import closing

import numpy as np

from demo.session import Session
from demo.session_config import make_config
from language import Plan
from tests.helpers.sessions import run_to_end


def test_a_session_acts_on_what_cameras_see_and_says_why_it_stands_still(monkeypatch):
    with closing(Session(make_config(driver="expert", objects=2, overrides=["perception=camera"]), seed=3)) as session:
        session.env.set_seed(3)
        session.shuffle()
        seen = {(thing.noun, thing.color) for thing in session.scene()}
        there = session.env.state.shown[0].sum()
        assert len(seen) == there
        assert isinstance(session.say(f"reach {session.object_names()[0]}"), Plan)
        assert run_to_end(session).startswith("Done")
        assert session.arm_note == ""
        world = session.env._worlds[0]
        picture = world.picture
        monkeypatch.setattr(world, "picture", lambda *arguments: np.zeros_like(picture(*arguments)))
        session.step()
        assert session.arm_note.startswith("The arm holds still: the picture of camera front is black")
        assert {(thing.noun, thing.color) for thing in session.scene()} == seen

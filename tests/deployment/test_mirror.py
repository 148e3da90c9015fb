"""What a policy sees of an arm: measured angles, and objects that are where somebody said until they are carried."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from deployment.connecting import episode_of
from deployment.mirror import FixedScene, MirrorEnv
from deployment.safe_arm import SafeArm
from deployment.safety import Limits, Safety, SafetyConfig
from envs import read_env
from envs.sim.robot import read_kinematics
from tests.helpers.obedient_arm import ObedientArm

SCENE = """
- {noun: cube, color: red, position: [0.4, 0.1, 0.0]}
- {noun: cube, color: green, position: [0.5, 0.2, 0.0]}
- {noun: cube, color: blue, position: [0.45, -0.1, 0.0], role: target}
"""
RED, GREEN, BLUE = [0.4, 0.1, 0.025], [0.5, 0.2, 0.025], [0.45, -0.1, 0.025]
SENTENCE = "pick the red cube and place it to the same position as the blue cube"


@pytest.fixture(scope="module")
def setup():
    return read_env(compose(["task=nl_pick_and_place"])).without_curriculum()


def mirror(setup, folder, scene):
    """An environment with an obedient arm beside these objects."""
    (folder / "scene.yaml").write_text(scene, encoding="utf-8")
    kinematics, rules = read_kinematics(setup.robot), SafetyConfig(slow_start=0.0)
    arm = ObedientArm(setup, kinematics.rest + 0.01)
    safe = SafeArm(arm, Safety(rules, Limits(setup, kinematics, rules, magnet=True)))
    safe.connect()
    return MirrorEnv(setup, safe, FixedScene(safe, episode_of(folder / "scene.yaml", setup)))


@pytest.fixture
def env(setup, tmp_path):
    with closing(mirror(setup, tmp_path, SCENE)) as env:
        env.reset()
        yield env


def places(env):
    """Position of each object by its colour and role."""
    scene = env.scene()
    return {(thing.color, thing.role): list(thing.position) for thing in scene}


def go(env, state, place, close):
    """Twenty control steps towards a place. Returns the last observation."""
    for _ in range(20):
        state["action"] = env.towards(np.array([place]), np.array([close]))
        state = env.step(state)["next"]
    return state


def test_an_episode_begins_with_the_arm_and_the_objects_as_they_are(env):
    assert places(env) == {("red", "real"): RED, ("green", "real"): GREEN, ("blue", "target"): BLUE}
    np.testing.assert_allclose(env.state.gripper, env.kinematics.forward(env.kinematics.rest[None] + 0.01).position)


def test_an_object_goes_along_with_the_gripper_that_took_it_and_stays_where_it_was_opened(env):
    state = env.give_instruction(SENTENCE, [thing.color for thing in env.scene()].index("red"))
    above = [*RED[:2], 0.052]
    state = go(env, state, above, False)
    assert env.held is None
    state = go(env, state, above, True)
    assert env.scene()[env.held].color == "red"
    state = go(env, state, [0.5, 0.0, 0.2], True)
    np.testing.assert_allclose(places(env)["red", "real"], [0.5, 0.0, 0.173], atol=0.01)
    state = go(env, state, [0.5, 0.0, 0.2], False)
    assert env.held is None
    state = go(env, state, [0.4, -0.2, 0.2], False)
    np.testing.assert_allclose(places(env)["red", "real"], [0.5, 0.0, 0.173], atol=0.01)
    assert places(env)["green", "real"] == GREEN


def test_the_next_command_starts_where_the_arm_was_really_sent(env):
    state = env.give_instruction(SENTENCE, 0)
    env.arm.safety.stop("somebody pressed stop")
    before = env.arm.angles
    state = go(env, state, [0.5, 0.0, 0.2], False)
    np.testing.assert_allclose(env.arrays.commanded[0], before, atol=1e-9)
    assert env.world.decision.reasons == ("somebody pressed stop",)


def test_a_mark_can_be_put_elsewhere_and_a_real_object_cannot(env):
    colors = [thing.color for thing in env.scene()]
    env.put_object(colors.index("blue"), (0.5, 0.1, 0.025))
    assert places(env)["blue", "target"] == [0.5, 0.1, 0.025]
    with pytest.raises(ConfigError, match="this arm's objects are real: move them by hand"):
        env.put_object(colors.index("red"), (0.5, 0.1, 0.025))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- {noun: cube, color: blue, position: [0.4, 0, 0], role: target}", "has 0 objects and 1 targets"),
        (3 * "- {noun: cube, color: blue, position: [0.4, 0, 0]}\n", "has 3 objects and 0 targets"),
        ("- {noun: cube, color: blue, position: [0.4, 0, 0], size: 0.1}", "object 1 is 0.1 m wide"),
        ("- {noun: cube, color: blau, position: [0.4, 0, 0]}", "blau"),
        ("?", "scene.yaml"),
    ],
)
def test_a_scene_that_does_not_fit_is_one_sentence(setup, tmp_path: Path, text, message):
    (tmp_path / "scene.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message) as refusal:
        episode_of(tmp_path / "scene.yaml", setup)
    assert "\n" not in str(refusal.value)


def test_a_person_who_points_moves_beside_a_real_arm(tmp_path):
    words = ["task=nl_reach_gesture", "gesture=ray", "workspace=collabtable"]
    setup = read_env(compose(words)).without_curriculum()
    with closing(mirror(setup, tmp_path, SCENE.rpartition("- ")[0].replace("}", ", size: 0.03}"))) as env:
        env.reset()
        referent = [thing.color for thing in env.scene()].index("green")
        origin, direction = env.point_at(env.scene().positions[referent])
        state = env.give_instruction("reach that", referent)
        for _ in range(8):
            state["action"] = env.hold_action()
            state = env.step(state)["next"]
        assert not env.world.person.moving
        np.testing.assert_allclose(state["gesture"][0, :6], [*origin, *direction], atol=0.02)


def test_an_arm_without_cameras_is_refused(tmp_path):
    seeing = read_env(compose(["task=nl_pick_and_place", "perception=camera"])).without_curriculum()
    with pytest.raises(ConfigError, match=r"perception\.name=camera needs cameras, which only arm=sim has yet"):
        mirror(seeing, tmp_path, SCENE)

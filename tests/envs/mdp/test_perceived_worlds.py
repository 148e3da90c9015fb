"""With perception=camera, what policies observe of the world is what was seen of it, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from omegaconf import OmegaConf

from core.cameras import CameraFrame
from core.errors import ConfigError
from core.overrides import compose
from envs import read_env
from envs.experts import Oracle, expert
from envs.experts.labelled_env import LabelledEnv
from envs.interactive.interactive_env import InteractiveEnv
from envs.mdp.object_rows import FACING
from envs.perception import UnusablePicture, View
from envs.perception.camera_reader import CameraReader
from envs.perception.detections import Detections, check_picture
from tests.helpers.env_cases import act, config_of, differences, hold, leaves, make, partial_reset, succeed_in_all
from tests.helpers.perceived_cases import TrueReader, TrulySeeingEnv, seeing

PLACE = "task=nl_pick_and_place"


def observed_by_the_simulator(env):
    """What the same env would show with perception=state."""
    return env._observer.observe(replace(env._source, perceived=None))


def driven(env, steps, each=lambda t, td: None):
    """What is observed, step by step, while the expert acts."""
    guide, td, kept = expert(env, privileged=True), env.reset(), []
    for t in range(steps):
        td = act(env, td, guide(td.clone())["action"])
        each(t, td)
        kept.append(td)
        if td["done"].any():
            td = partial_reset(env, td, td["done"][:, 0])
    return kept


def test_with_perception_state_nothing_is_copied():
    env = make()
    env.reset()
    assert env.sight.state is env.state
    assert env.sight.task is env.task
    assert env.rows is env._arrays.rows
    assert env.blind == [None]
    env.close()


@pytest.mark.parametrize("task", ["nl_pick_and_place", "nl_put_in", "nl_switch", "nl_hand_over"])
def test_perfect_detections_are_observed_as_the_simulator_tells_the_world(task):
    env = seeing(f"task={task}", worlds=2, sure=0.999)
    quaternions = [4, 5, 6]  # of a lever, z and w are told a control step late

    def compare(t, td):
        true = observed_by_the_simulator(env)
        assert torch.equal(td["objects_mask"], true["objects_mask"])
        assert torch.equal(td["stage"], true["stage"])
        apart = (td["objects"] - true["objects"]).abs()
        apart[..., quaternions] = 0.0
        late = 0.25 if task == "nl_switch" else 0.02
        assert apart[..., :3].max() < 0.012
        assert (apart[..., FACING.start :] < late).all()
        assert (env.sight.state.held == env.state.held).all()
        assert (env.sight.state.goals == env.state.goals).all()
        assert (env.sight.state.movable == env.state.movable).all()

    driven(env, 30, compare)
    env.close()


def test_the_same_seed_gives_the_same_bits_whatever_the_number_of_worlds():
    runs = []
    for worlds in (1, 2):
        env = seeing(PLACE, worlds=worlds, seed=4, noise=0.003)
        runs.append([td.exclude("action")[:1] for td in driven(env, 12)])
        env.close()
    for one, other in zip(*runs, strict=True):
        assert differences(one, other) == []


def test_the_order_of_detections_changes_nothing_that_is_observed():
    runs = []
    for backwards in (False, True):
        env = seeing(PLACE, seed=4, backwards=backwards)
        runs.append([td.exclude("action") for td in driven(env, 10)])
        env.close()
    for one, other in zip(*runs, strict=True):
        for key, value in leaves(one).items():
            torch.testing.assert_close(leaves(other)[key], value, atol=1e-6, rtol=0.0)


def test_what_is_overlooked_is_not_shown_and_the_rest_keeps_its_slot():
    env = seeing(PLACE)
    true = env.reset()
    gone = int(np.flatnonzero(env.state.shown[0])[0])
    env.set_seed(0)
    env.reader.missing = {gone}
    td = env.reset()
    assert td["objects_mask"][0].sum() == true["objects_mask"][0].sum() - 1
    assert not td["objects_mask"][0, gone]
    assert (td["objects"][0, gone] == 0).all()
    others = np.flatnonzero(td["objects_mask"][0])
    assert (td["objects"][0, others, :3] - true["objects"][0, others, :3]).abs().max() < 1e-5
    assert torch.equal(td["privileged", "referent"], true["privileged", "referent"])
    env.close()


def test_what_is_invented_gets_an_empty_slot_or_none():
    env = seeing("task=nl_reach", "task.min_objects=2", "task.num_objects=4", seed=1)
    env.reader.invented = [((0.35, 0.29, 0.025), "cube", "pink"), ((0.55, -0.29, 0.025), "sphere", "gray")]
    for _ in range(4):
        td = env.reset()
        shown, true = td["objects_mask"][0].numpy(), env.state.shown[0]
        assert (shown | ~true).all()
        assert shown.sum() == min(true.sum() + 2, 4)
        apart = np.abs(env.sight.state.objects[0, true] - env.state.objects[0, true]).max()
        assert apart < 1e-5
    env.close()


def test_rewards_and_success_are_the_simulators():
    env = seeing("task=nl_reach")
    env.reader.missing = set(range(10))
    ends = [td for td in driven(env, 40) if td["done"].any()]
    assert ends[0]["success"].all()
    assert not ends[0]["objects_mask"].any()
    env.close()


def test_an_arm_that_sees_nothing_holds_still_and_tells_why():
    env = seeing("task=nl_reach", worlds=2)
    td, sideways = env.reset(), torch.tensor([[0.0, 1.0, 0.0]]).expand(2, 3)
    for _ in range(6):
        td = act(env, td, hold(env, td))
    env.reader.blind = "the picture of camera front is black: is it covered, or the light off?"
    td = act(env, td, hold(env, td))
    before, rows = env.gripper, td["objects"][..., :3]
    for _ in range(5):
        td = act(env, td, sideways)
    assert np.abs(env.gripper - before).max() < 0.004
    assert torch.equal(td["objects"][..., :3], rows)
    assert env.blind == [env.reader.blind] * 2
    env.reader.blind = None
    td = act(env, td, sideways)
    assert env.blind == [None, None]
    act(env, td, sideways)
    assert np.abs(env.gripper - before).max() > 0.004
    env.close()


def test_an_episode_that_begins_blind_shows_nothing():
    env = seeing(PLACE)
    env.reset()
    env.reader.blind = "the picture of camera side is 64 x 64, and the camera's are 128 x 128"
    td = env.reset()
    assert not td["objects_mask"].any()
    assert not td["objects"].any()
    act(env, td, hold(env, td))
    env.close()


def test_a_copy_of_an_environment_sees_the_same():
    env = seeing("task=nl_reach", noise=0.0)
    td = env.reset()
    td = act(env, td, hold(env, td))
    other = TrulySeeingEnv(env.config, 1)
    other.restore_present(env.present())
    assert torch.equal(other.sight.state.shown is not None and torch.from_numpy(other.rows), torch.from_numpy(env.rows))
    env.close()
    other.close()


# ---- pictures


def test_pictures_of_every_camera_are_read_from_where_the_camera_is():
    env = make("kuka", "step", "nl_reach", "gesture=none", render=True)
    env.reset()
    views = {}

    def keep(given):
        views.update(given)
        return Detections.none()

    config = config_of("perception=camera", "perception.cameras=[side,wrist]").perception
    reader = CameraReader(env._worlds, env.config.workspace, config, keep)
    pose = env._arrays.pose
    gripper = pose.position[0], pose.rotation[0]
    assert len(reader.read(0, gripper)) == 0
    assert list(views) == ["side", "wrist"]
    for name, view in views.items():
        assert isinstance(view, View)
        assert view.picture.shape == (128, 128, 3)
        assert view.picture.dtype == np.uint8
        assert view.picture.std() > 10, name
    places = reader.places(gripper)
    assert np.abs(places - [view.frame.place for view in views.values()]).max() < 1e-12
    assert np.linalg.norm(places[1] - gripper[0]) < 0.3
    env.close()


@pytest.mark.parametrize(
    ("picture", "reason"),
    [
        (np.zeros((128, 128, 3), np.uint8), "the picture of camera front is black"),
        (np.full((128, 128, 3), 255, np.uint8), "the picture of camera front is saturated"),
        (np.full((128, 128, 3), 90, np.uint8), "the picture of camera front shows a single colour"),
        (np.zeros((64, 96, 3), np.uint8), "is 96 x 64 pixels, and the camera's are 128 x 128"),
    ],
)
def test_a_picture_in_which_nothing_can_be_seen_is_refused(picture, reason):
    camera = config_of().workspace.cameras["front"]
    with pytest.raises(UnusablePicture, match=reason):
        check_picture("front", View(picture, camera, CameraFrame.of(camera)))


# ---- config


def test_where_a_person_points_the_ray_is_read_from_pictures():
    assert config_of("perception=camera", "task=reach_gesture", "gesture=ray").gesture.source == "camera"
    assert config_of("perception=state", "task=reach_gesture", "gesture=ray").gesture.source == "ray"
    assert config_of("perception=camera").gesture.source == "none"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["perception.cameras=[front,sid]"], "has no camera sid; did you mean 'side'"),
        (["perception.cameras=[]"], r"perception.cameras=\[\] must name at least one of workspace.cameras"),
        (["workspace.cameras.side.target=[3.0,3.0,0.1]"], "workspace.cameras.side sees nothing of the table"),
        (
            ["workspace.cameras.side.width=100"],
            "workspace.cameras.side takes pictures of 100 x 128, and .* multiples of 16",
        ),
        (["perception.presence=2"], "perception.presence=2.0 is out of range"),
    ],
)
def test_a_perception_that_cannot_work_is_refused(words, message):
    with pytest.raises(ConfigError, match=message):
        read_env(compose(["perception=camera", *words]))


def test_configs_that_are_older_than_cameras_are_told_by_the_simulator():
    old = OmegaConf.to_container(compose(["perception=camera"]), resolve=True)
    del old["perception"]
    assert read_env(old).perception.name == "state"


# ---- who else acts on what is seen


@pytest.mark.parametrize("task", ["nl_reach", "nl_pick_and_place"])
def test_experts_and_the_oracle_act_on_what_is_seen(task):
    for actor in (expert, Oracle):
        env = seeing(f"task={task}", seed=2, noise=0.002)
        succeed_in_all(env, env.reset(), actor(env))
        env.reader.missing = set(range(10))
        td, guide = env.reset(), actor(env)
        before = env.gripper
        for _ in range(8):
            td = act(env, td, guide(td.clone())["action"])
        assert np.abs(env.gripper - before)[:, :2].max() < 0.01  # it may sink into the box of the control
        env.close()


def test_the_labels_of_imitation_come_from_the_simulator():
    class LabelledSeeingEnv(TrulySeeingEnv, LabelledEnv):
        pass

    env = LabelledSeeingEnv(config_of("perception=camera"), 1, 2)
    env.reader.missing = set(range(10))
    td = env.reset()
    before = np.linalg.norm(env.gripper - env.state.objects[0, env.state.referent[0]])
    for _ in range(8):
        td = act(env, td, td["privileged", "expert_action"])
    assert np.linalg.norm(env.gripper - env.state.objects[0, env.state.referent[0]]) < before - 0.05
    env.close()


def test_the_scene_that_a_person_talks_about_is_the_perceived_one():
    class SeeingInteractiveEnv(InteractiveEnv):
        def _make_reader(self, config):
            self.reader = TrueReader(self)
            return self.reader

    env = SeeingInteractiveEnv(config_of("perception=camera", "task=nl_reach"), seed=3)
    env.reset()
    every, bodies = env.scene(), env.bodies()
    assert None not in bodies
    env.reader.missing = {int(np.flatnonzero(env.state.shown[0])[1])}
    env.reader.invented = [((0.35, 0.29, 0.025), "cube", "pink")]
    env.set_seed(3)
    env.reset()
    scene, bodies = env.scene(), env.bodies()
    named = {(thing.noun, thing.color) for thing in every} - {(every[1].noun, every[1].color)} | {("cube", "pink")}
    assert {(thing.noun, thing.color) for thing in scene} == named
    assert bodies.count(None) <= 1
    real = next(i for i, thing in enumerate(scene) if (thing.noun, thing.color) != ("cube", "pink"))
    env.put_object(real, (0.45, -0.28, 0.025))
    np.testing.assert_allclose(env.scene().positions[real], [0.45, -0.28, 0.025], atol=2e-3)
    env.close()


def test_episodes_that_cameras_saw_are_relabelled_by_where_things_were():
    env = seeing("task=nl_reach", worlds=4, seed=1, noise=0.002)
    guide, td = expert(env, privileged=True), env.reset()
    wrong = env.state.referent.copy()
    for i, slots in enumerate(env.state.shown):
        wrong[i] = next(slot for slot in np.flatnonzero(slots) if slot != env.state.referent[i])
    frames = []
    for _ in range(25):
        step = env.step(td.set("action", guide.act(wrong, wrong)))
        frames.append(step.clone())
        td = step["next"].exclude("reward").clone()
    episodes = torch.stack(frames, 1)
    relabelled = env.hindsight([episodes[i] for i in range(4)], 0)
    assert len(relabelled) >= 2
    for each in relabelled:
        assert each["next", "success"][-1]
        assert set(each["privileged", "referent"].tolist()) <= set(wrong.tolist())
    env.close()

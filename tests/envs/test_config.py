"""Invalid settings are errors before anything is loaded: one sentence with key, value and what would be right."""

import copy
import re
from pathlib import Path

import pybullet_data
import pytest
from omegaconf import OmegaConf

from core.errors import ConfigError
from core.overrides import compose
from envs import make_env, read_env
from envs.workspace_env import WorkspaceEnv
from tests.helpers.env_cases import clients

DEFAULT = compose()

TYPED = [
    ("robot=kukka", "robot=kukka is not known; did you mean 'kuka'?"),
    ("robot=scara", "robot=scara is not known; choose from "),
    ("robots=kuka", "robots is not a known key; did you mean 'robot'?"),
    ("task.num_object=3", "task.num_object is not a known key; did you mean 'task.num_objects'?"),
    ("control.max_mov=0.1", "control.max_mov is not a known key; did you mean 'control.max_move'?"),
    ("task", "overrides are written key=value"),
    ("task.radius=[1", "overrides are written key=value"),
    ("~task", "task=None is not known"),
    (
        "robot=panda task=nl_pick_and_place task.curriculum.off_centre=0.03",
        "task.curriculum.off_centre=0.03 must be 0 with fingers: only a magnet holds objects off its middle",
    ),
]

VALUES = [
    ("task.num_object=3", "task.num_object is not a known key; did you mean 'num_objects'?"),
    ("task.num_objects=9", "task.num_objects=9 is out of range: it must be in [1, 8]"),
    ("task.num_objects=0", "task.num_objects=0 is out of range"),
    ("task.num_objects=two", "task.num_objects=two: Value 'two' of type 'str' could not be converted to Integer"),
    ("task.num_objects=2.5", "task.num_objects=2.5: "),
    ("task.min_objects=4", "task.min_objects=4 must be at most num_objects=3"),
    ("task.spacing=0.05", "task.spacing=0.05 must be at least 0.1, twice the radius"),
    ("task.object_size=0.1", "task.spacing=0.12 must be at least 0.15, 1.5 times the object_size"),
    ("task.num_objects=8 task.spacing=0.3", "task.num_objects=8 objects with task.spacing=0.3 do not fit"),
    ("task.num_objects=1 task.kinds=[relation]", "task.kinds=['relation'] cannot name each of 1 objects"),
    ("task.kinds=[]", "task.kinds=[] must name at least one kind"),
    ("task.kinds=[colour]", "task.kinds=colour is not known; did you mean 'color'?"),
    ("task.radius=nan", "task.radius=nan is not a finite number"),
    ("task.reward.success=inf", "task.reward.success=inf is not a finite number"),
    ("task.reward.succes=1", "task.reward.succes is not a known term of task.name=nl_reach; did you mean 'success'?"),
    ("task.name=reech", "task.name=reech is not a task; did you mean 'reach'?"),
    ("control.max_move=-1", "control.max_move=-1.0 is out of range: it must be in [0.001, 0.2]"),
    ("control.max_move=null", "control.max_move=None"),
    ("control.name=steps", "control.name=steps is not known; did you mean 'step'?"),
    ("physics.substeps=0", "physics.substeps=0 is out of range: it must be in [1, 1000]"),
    ("physics.time_step=-0.1", "physics.time_step=-0.1 is out of range"),
    ("physics.sleeping=maybe", "physics.sleeping=maybe: Value 'maybe' is not a valid bool"),
    (
        "robot.joints=[lbr_iiwa_joint_11] robot.rest=[0] robot.max_speed=[1]",
        "robot.joints: 'lbr_iiwa_joint_11' is not in the URDF; did you mean '",
    ),
    ("robot.joints=[]", "robot.joints=[] must name at least one joint"),
    ("robot.tip=lbr_iiwa_link_77", "robot.tip: 'lbr_iiwa_link_77' is not in the URDF; did you mean 'lbr_iiwa_link_7'?"),
    ("robot.rest=[0,0]", "robot.rest=[0.0, 0.0] must be 7 numbers, one for each joint"),
    (
        "robot.rest=[0,0,0,0,0,0,99]",
        "robot.rest: 99.0 is beyond lbr_iiwa_joint_7's limits [-3.05432619099, 3.05432619099]",
    ),
    ("robot.max_speed=[1]", "robot.max_speed=[1.0] must be 7 numbers, one for each joint"),
    ("robot.base=[0,0]", "robot.base=[0.0, 0.0] must be 3 numbers"),
    ("robot.tip_offset=[0,0]", "robot.tip_offset=[0.0, 0.0] must be 3 numbers"),
    ("robot.grippers=[hand]", "robot.grippers=hand is not known; choose from magnet, fingers"),
    ("robot.grippers=[fingers]", "robot.grippers=['fingers'] needs names in fingers and a finger_opening above 0"),
    ("robot.finger_opening=0.1", "robot.grippers=['magnet'] has no fingers: give fingers=[] and finger_opening=0"),
    ("robot.urdf=no/such.urdf", "robot.urdf=no/such.urdf is not a file in "),
    ("robot.package=pybulletdata", "robot.package=pybulletdata is not known; did you mean 'pybullet_data'?"),
    (
        "workspace.object_area=[1,0,0,1]",
        "workspace.object_area=[1.0, 0.0, 0.0, 1.0] must be 4 numbers, each low < high",
    ),
    ("workspace.gripper_box=[0,1]", "workspace.gripper_box=[0.0, 1.0] must be 6 numbers"),
    ("workspace.furniture.top.size=[1,1]", "workspace.furniture.top.size=[1.0, 1.0] must be 3 numbers"),
    ("workspace.furniture.top.position=[1]", "workspace.furniture.top.position=[1.0] must be 3 numbers"),
    ("workspace.furniture.top.color=[1]", "workspace.furniture.top.color=[1.0] must be 3 numbers"),
    ("workspace.cameras.film.target=[0]", "workspace.cameras.film.target=[0.0] must be 3 numbers"),
    ("workspace.cameras.film.width=8", "workspace.cameras.film.width=8 is out of range"),
]


def built(words):
    """The environment of the default config with these "key=value" in it, past what checks the command line."""
    config = copy.deepcopy(DEFAULT)
    for word in words.split():
        key, _, value = word.partition("=")
        OmegaConf.update(config, key, OmegaConf.from_dotlist([f"v={value}"]).v, merge=False, force_add=True)
    return WorkspaceEnv(read_env(config))


@pytest.mark.parametrize(("words", "message"), TYPED)
def test_words_that_mean_nothing_or_do_not_fit_are_an_error_that_names_them(words, message):
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        make_env(words.split())
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "message"), VALUES)
def test_an_invalid_value_is_an_error_that_names_it(words, message):
    before = clients()
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        built(words)
    assert "\n" not in str(caught.value)
    assert clients() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [({"num_worlds": 0}, "num_worlds=0 must be at least 1"), ({"seed": -1}, "seed=-1 must be at least 0")],
)
def test_invalid_arguments_are_errors_that_name_them(arguments, message):
    with pytest.raises(ConfigError, match=message):
        make_env(**arguments)


# ---- broken URDFs -------------------------------------------------------------------------------------------------

KUKA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
BARE = re.sub(r"<(visual|collision)>.*?</\1>", "", KUKA.read_text(), flags=re.S)  # needs no mesh beside it


def changed(part, pattern, replacement):
    """The URDF with one thing replaced in the element of this link or joint, or after its name."""
    start = BARE.index(f'name="{part}"')
    text, count = re.subn(pattern, replacement, BARE[start:], count=1)
    assert count == 1
    return BARE[:start] + text


def test_a_urdf_file_of_the_user_is_loaded(tmp_path):
    path = tmp_path / "mine.urdf"
    path.write_text(BARE)
    built(f"robot.package=file robot.urdf={path}").close()


JOINT = "lbr_iiwa_joint_4"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("this is no XML", "holds no XML"),
        ("", "holds no XML"),
        ("<robot name='x'></robot>", "does not load"),
        (BARE[:3000], "is not XML"),
        (
            changed("lbr_iiwa_link_3", r'<mass value="[^"]*"', '<mass value="nan"'),
            'link lbr_iiwa_link_3 has mass value="nan"',
        ),
        (
            changed("lbr_iiwa_link_3", r'<mass value="[^"]*"', '<mass value="-1"'),
            "link lbr_iiwa_link_3 has mass -1; it",
        ),
        (
            changed(JOINT, r'lower="[^"]*"', 'lower="3.5"'),
            f"joint {JOINT} must be revolute with limits low < high in radians, or prismatic",
        ),
        (
            changed(JOINT, r'upper="[^"]*"', 'upper="nan"'),
            f'joint {JOINT} has limit upper="nan"',
        ),
        (changed(JOINT, 'type="revolute"', 'type="prismatic"'), f"joint {JOINT} must be revolute"),
    ],
    ids=["text", "empty", "no link", "cut off", "mass nan", "mass -1", "low > high", "limit nan", "prismatic"],
)
def test_a_broken_urdf_is_an_error_that_names_it(text, message, tmp_path):
    path, before = tmp_path / "broken.urdf", clients()
    path.write_text(text)
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        built(f"robot.package=file robot.urdf={path}")
    assert f"robot.urdf={path}" in str(caught.value)
    assert clients() == before


def test_several_objects_without_words_are_an_error():
    with pytest.raises(ConfigError, match=r"task.num_objects=3 must be 1 in a task without words"):
        make_env(["task=reach", "task.num_objects=3", "task.min_objects=3"])


@pytest.mark.slow
@pytest.mark.parametrize("urdf", ["/etc/passwd", "../../x.urdf", "franka_panda/../../../x.urdf"])
def test_a_urdf_does_not_leave_its_package(urdf):
    with pytest.raises(ConfigError, match=r"robot\.urdf=\S+ leaves the package"):
        read_env(compose([f"robot.urdf={urdf}"]))

"""Single pictures become things that stay what they are."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from envs.perception.assignment import assignment
from envs.perception.config import STATE
from envs.perception.detections import Detections
from envs.perception.poses import heading
from envs.perception.tracking import KnownThings, Moment, SceneTracker
from envs.sim.devices import DEVICES
from envs.tasks import NOTHING
from language import COLORS, FITTINGS, HAND, NOUNS, SHAPES
from language import DEVICES as DEVICE_NOUNS
from tests.helpers.env_cases import config_of
from tests.helpers.perceived_cases import unsure

SIZE, WIDTH = 0.05, 0.07
AWAY = np.array([[0.0, 0.0, 0.3], [0.1, 0.4, 0.5], [0.2, 0.5, 0.5]])  # an arm that hides nothing
CAMERAS = np.array([[1.2, 0.6, 0.9], [1.2, -0.6, 0.9]])
FRIDGE = config_of("workspace=room").workspace.fittings["fridge"]


def known(**changes):
    nouns = np.isin(list(NOUNS), [*SHAPES, *DEVICE_NOUNS, HAND])
    bounds = np.array([[0.0, -0.6, -0.1], [0.9, 0.6, 0.8]])
    base = KnownThings(
        nouns=nouns,
        targets=True,
        roles=None,
        size=SIZE,
        width=WIDTH,
        fittings={},
        most=8,
        bounds=bounds,
        grip_depth=0.025,
        tips=0.0,
    )
    return replace(base, **changes)


def tracker(**changes):
    return SceneTracker(STATE, known(**changes))


def moment(arm=AWAY, holds=False, rotation=None):
    return Moment(arm=np.array(arm), rotation=np.eye(3) if rotation is None else rotation, holds=holds, cameras=CAMERAS)


def seen(*things, std=0.002):
    """Detections of things (place, noun, colour, and further values)."""
    nouns = [list(NOUNS).index(noun) for _, noun, *_ in things]
    colors = [list(COLORS).index(color) for _, _, color, *_ in things]
    more = [each[3] if len(each) > 3 else {} for each in things]
    count = len(things)
    return Detections(
        positions=np.reshape([place for place, *_ in things], (-1, 3)).astype(float),
        covariances=np.tile(std**2 * np.eye(3), (count, 1, 1)),
        nouns=unsure(np.array(nouns, int), len(NOUNS), 0.9),
        colors=unsure(np.array(colors, int), len(COLORS), 0.9),
        sizes=np.full(count, SIZE),
        yaws=np.array([each.get("yaw", 0.0) for each in more]),
        shares=np.array([each.get("share", 0.0) for each in more]),
        targets=np.array([each.get("target", 0.02) for each in more]),
        presence=np.array([each.get("presence", 0.99) for each in more]),
    )


CUBE = (0.4, 0.1, 0.025), "cube", "red"
BALL = (0.5, -0.1, 0.025), "sphere", "blue"


def names(found):
    return [(list(NOUNS)[n], list(COLORS)[c]) for n, c in zip(found.nouns, found.colors, strict=True)]


def test_what_the_first_picture_shows_is_observed_at_once():
    follows = tracker()
    follows.update(seen(CUBE, BALL), moment())
    found = follows.seen()
    assert names(found) == [("cube", "red"), ("sphere", "blue")]
    np.testing.assert_allclose(found.positions, [CUBE[0], BALL[0]], atol=1e-9)
    assert found.held == NOTHING


def test_a_thing_at_rest_is_placed_better_than_by_a_single_picture():
    follows, rng, errors = tracker(), np.random.default_rng(0), []
    for _ in range(40):
        place = np.array(CUBE[0]) + 0.004 * rng.standard_normal(3)
        follows.update(seen((place, "cube", "red"), std=0.004), moment())
        errors.append(np.linalg.norm(follows.seen().positions[0] - CUBE[0]))
    assert len(follows.seen().ids) == 1
    assert max(errors[20:]) < 0.004


def test_a_noun_that_is_misread_once_stays():
    follows = tracker()
    for noun in ("cube", "cube", "cylinder", "cube"):
        follows.update(seen((CUBE[0], noun, "red")), moment())
        assert names(follows.seen()) == [("cube", "red")]


def test_a_noun_that_is_read_past_the_arm_does_not_count():
    follows = tracker()
    follows.update(seen(CUBE), moment())
    follows.update(seen(CUBE), moment())
    over_the_cube = [[0.0, 0.0, 0.3], [0.3, 0.1, 0.4], [0.4, 0.1, 0.08]]
    for _ in range(15):
        follows.update(seen((CUBE[0], "sphere", "red")), moment(over_the_cube))
        assert names(follows.seen()) == [("cube", "red")]


def test_what_the_arm_hides_stays_and_what_is_gone_is_dropped():
    follows = tracker()
    follows.update(seen(CUBE, BALL), moment())
    over_the_cube = [[0.0, 0.0, 0.3], [0.3, 0.1, 0.4], [0.4, 0.1, 0.08]]
    for _ in range(3 * STATE.patience):
        follows.update(seen(BALL), moment(over_the_cube))
    assert names(follows.seen()) == [("cube", "red"), ("sphere", "blue")]
    for _ in range(STATE.patience):
        assert len(follows.seen().ids) == 2
        follows.update(seen(BALL), moment())
    assert names(follows.seen()) == [("sphere", "blue")]


def test_what_appears_late_is_observed_once_it_was_seen_again():
    follows = tracker()
    follows.update(seen(CUBE), moment())
    follows.update(seen(CUBE, BALL), moment())
    assert len(follows.seen().ids) == 1
    follows.update(seen(CUBE, BALL), moment())
    assert len(follows.seen().ids) == 2


def test_what_one_picture_invents_is_not_observed():
    follows = tracker()
    for extra in ([], [BALL], [], [], [BALL], []):
        follows.update(seen(CUBE, *extra), moment())
        assert names(follows.seen()) == [("cube", "red")]


def test_what_is_held_moves_with_the_gripper_unseen():
    follows = tracker()
    at_the_cube = np.array([[0.0, 0.0, 0.3], [0.3, 0.1, 0.4], [0.4, 0.1, 0.05]])
    follows.update(seen(CUBE, BALL), moment(at_the_cube))
    follows.update(seen(CUBE, BALL), moment(at_the_cube, holds=True))
    assert follows.seen().held == 0
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    follows.update(seen(BALL), moment(at_the_cube + [0.1, 0.0, 0.2], holds=True, rotation=turn))
    found = follows.seen()
    np.testing.assert_allclose(found.positions[0], [0.5, 0.1, 0.225], atol=1e-6)
    np.testing.assert_allclose(np.abs(found.quaternions[0]), [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-6)
    follows.update(seen(BALL), moment(at_the_cube + [0.1, 0.0, 0.2], rotation=turn))
    assert follows.seen().held == NOTHING


def test_a_thing_that_is_moved_by_hand_is_followed_but_not_to_a_single_stray_picture():
    follows = tracker()
    moved = (0.3, -0.05, 0.025), "cube", "red"
    for each in (CUBE, CUBE, moved, CUBE):
        follows.update(seen(each), moment())
        np.testing.assert_allclose(follows.seen().positions, [CUBE[0]], atol=1e-3)
    for _ in range(2):
        follows.update(seen(moved), moment())
    np.testing.assert_allclose(follows.seen().positions, [moved[0]], atol=1e-3)


def test_an_object_on_its_target_leaves_the_target_where_it_is():
    follows = tracker()
    target = CUBE[0], "cube", "green", {"target": 0.98}
    follows.update(seen(target, BALL), moment())
    ball_nearer = (0.45, 0.0, 0.025), "sphere", "blue"
    ball_there = CUBE[0], "sphere", "blue"
    for each in [ball_nearer] * 2 + [ball_there] * 2 * STATE.patience:
        follows.update(seen(*([each] if each is ball_there else [target, each])), moment())
    assert names(follows.seen()) == [("cube", "green"), ("sphere", "blue")]
    assert follows.seen().targets.tolist() == [True, False]


def test_of_as_many_things_as_there_always_are_the_likeliest_are_see_through():
    purple = (0.3, 0.2, 0.025), "cube", "purple", {"target": 0.2}  # from one side it looks like a solid pink one
    follows = tracker(roles=(3, 1))
    for _ in range(12):
        follows.update(seen(CUBE, purple, BALL), moment())
    assert follows.seen().targets.tolist() == [False, True, False]
    follows = tracker(roles=(3, 1))
    follows.update(seen(CUBE, purple), moment())  # the third is hidden, and may be the see-through one
    assert not follows.seen().targets.any()


def test_nouns_and_targets_that_a_task_lacks_are_not_observed():
    follows = tracker(nouns=np.isin(list(NOUNS), ["cube"]), targets=False)
    ghost = CUBE[0], "cube", "red", {"target": 0.9}
    follows.update(seen(ghost, BALL, ((0.3, -0.3, 0.1), "palm", "pink")), moment())
    assert names(follows.seen()) == [("cube", "red"), ("cube", "blue")]
    assert not follows.seen().targets.any()


@pytest.mark.parametrize(("noun", "share"), [("button", 0.0), ("lever", 0.0), ("lever", 1.0)])
def test_the_handle_of_a_device_follows_from_where_it_stands(noun, share):
    device, yaw = DEVICES[noun], 0.7
    grip = device.grip(WIDTH, float(device.value(share)))
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    place = np.array([0.45, 0.05, 0.0]) + turn @ grip
    follows = tracker()
    for _ in range(2):
        follows.update(seen((place, noun, "red", {"yaw": yaw, "share": share})), moment())
    found = follows.seen()
    np.testing.assert_allclose(found.positions, [place], atol=5e-4)
    assert abs(found.yaws[0] - yaw) < 1e-6
    assert found.sizes[0] == WIDTH


def test_a_fitting_is_observed_on_its_joint_even_before_it_is_seen():
    number = list(NOUNS).index("fridge")
    nouns = np.isin(list(NOUNS), [*SHAPES, *FITTINGS])
    follows = tracker(nouns=nouns, fittings={number: FRIDGE})
    follows.update(seen(), moment())
    np.testing.assert_allclose(follows.seen().positions, [FRIDGE.handle_at(0.0)], atol=1e-9)
    open_ = FRIDGE.handle_at(FRIDGE.value(0.6))
    for _ in range(3):
        follows.update(seen((open_ + [0.0, 0.01, 0.0], "fridge", "cyan")), moment())
    found = follows.seen()
    np.testing.assert_allclose(found.positions, [open_], atol=2e-3)
    assert names(found) == [("fridge", "cyan")]


def test_more_things_than_can_be_observed_are_left_out():
    follows = tracker(most=3)
    row = [((0.35 + 0.08 * k, 0.0, 0.025), "cube", "red") for k in range(5)]
    follows.update(seen(*row), moment())
    assert len(follows.seen().ids) == 3


def test_detections_out_of_the_workspace_or_without_presence_are_ignored():
    follows = tracker()
    weak = BALL[0], "sphere", "blue", {"presence": 0.3}
    follows.update(seen(((2.0, 0.0, 0.0), "cube", "red"), weak), moment())
    assert len(follows.seen().ids) == 0


def test_the_assignment_is_the_cheapest():
    rng = np.random.default_rng(0)
    for _ in range(60):
        costs = np.minimum(20 * rng.random((rng.integers(1, 5), rng.integers(1, 6))), 16.0)
        rows, columns = assignment(costs)
        few, many = sorted(costs.shape)
        table = costs if costs.shape[0] == few else costs.T
        least = min(sum(table[k, j] for k, j in enumerate(order)) for order in permutations(range(many), few))
        assert len(rows) == few == len(set(columns.tolist())) == len(set(rows.tolist()))
        assert costs[rows, columns].sum() == pytest.approx(least)


def test_the_mark_of_a_wheel_tells_how_it_was_placed():
    grip, way = DEVICES["wheel"].grip(WIDTH, 0.0), DEVICES["wheel"].way
    placed, rng = 0.4, np.random.default_rng(0)

    def wheel(share):
        angle = placed + way * (2 * share - 1)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        told = share + rng.normal(0.0, 0.05)
        return [0.45, 0.0, 0.0] + turn @ grip, "wheel", "red", {"yaw": angle, "share": told}

    follows = tracker()
    for share in (*[0.5] * 10, 0.6, 0.7, 0.8, 0.9):
        peg = wheel(share)[0]
        follows.update(seen(wheel(share)), moment([[0.0, 0.0, 0.4], peg - [0.1, 0.1, -0.2], peg - [0.0, 0.03, 0.0]]))
    found = follows.seen()
    assert found.yaws[0] == pytest.approx(placed, abs=0.1)
    assert heading(found.quaternions[0]) == pytest.approx(placed + 0.8 * way, abs=0.1)


def test_a_lever_that_is_switched_keeps_the_way_it_faces():
    device, yaw = DEVICES["lever"], 0.7
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])

    def lever(share):
        place = np.array([0.45, 0.05, 0.0]) + turn @ device.grip(WIDTH, float(device.value(share)))
        return place, "lever", "red", {"yaw": yaw, "share": share}

    follows = tracker()
    for share in (*[0.0] * 20, 0.2, 0.4, *[0.9] * 3):
        place = lever(share)[0]
        follows.update(
            seen(lever(share)), moment([[0.0, 0.0, 0.4], place + [-0.1, 0.0, 0.2], place + [0.0, 0.08, 0.02]])
        )
    found = follows.seen()
    assert abs(found.yaws[0] - yaw) < 0.05
    np.testing.assert_allclose(found.positions[0], lever(0.9)[0], atol=0.004)


@pytest.mark.parametrize("tips", [0.0, 0.008])
def test_a_button_is_as_far_down_as_the_gripper_that_hides_it(tips):
    button, place = DEVICES["button"], np.array([0.45, 0.0, 0.0])
    top = place + button.grip(WIDTH)
    follows = tracker(tips=tips)
    for _ in range(3):
        follows.update(seen((top, "button", "red", {"share": 0.3})), moment())
    assert follows.seen().positions[0, 2] == pytest.approx(top[2])
    for depth in (0.0, 0.5, 0.9):
        gripper = top + [0.004, 0.0, tips - depth * button.way * WIDTH]
        follows.update(seen(), moment([[0.0, 0.0, 0.4], gripper + [-0.1, 0.0, 0.3], gripper]))
        assert top[2] - follows.seen().positions[0, 2] == pytest.approx(depth * button.way * WIDTH, abs=1e-6)
    follows.update(seen(), moment())
    assert follows.seen().positions[0, 2] == pytest.approx(top[2])


@pytest.mark.parametrize("noun", ["button", "lever", "wheel"])
def test_no_loose_thing_is_believed_within_a_device(noun):
    stand = np.array([0.45, 0.0, 0.0])
    device = stand + DEVICES[noun].grip(WIDTH), noun, "red"
    follows = tracker()
    for _ in range(3):
        follows.update(seen(device), moment())
    phantom, real = stand + [0.0, 0.02, 0.025], stand + [0.0, 0.1, 0.025]
    for _ in range(4):
        follows.update(seen(device, (phantom, "cube", "red"), (real, "cube", "blue")), moment())
    found = follows.seen()
    assert sorted(found.colors.tolist()) == sorted(list(COLORS).index(color) for color in ("red", "blue"))


@pytest.mark.parametrize("noun", ["lever", "wheel"])
def test_a_handle_that_the_gripper_hides_goes_where_it_is_pushed(noun):
    device, stand = DEVICES[noun], np.array([0.45, 0.0, 0.0])
    start, end = stand + device.grip(WIDTH), stand + device.grip(WIDTH, device.start + 0.5 * device.way)
    share = (device.start - device.low) / (device.high - device.low)
    follows = tracker()
    for _ in range(3):
        follows.update(seen((start, noun, "red", {"share": share})), moment())
    touch = 0.02 + 0.14 * WIDTH
    for part in np.linspace(0.0, 1.0, 12):
        handle = stand + device.grip(WIDTH, device.start + 0.5 * part * device.way)
        ahead = stand + device.grip(WIDTH, device.start + 0.5 * part * device.way + 0.01) - handle
        ahead /= np.linalg.norm(ahead[:2])
        gripper = handle - touch * ahead
        gripper[2] = handle[2]
        follows.update(seen(), moment([[0.0, 0.0, 0.4], gripper + [-0.1, 0.0, 0.3], gripper]))
    assert np.linalg.norm(follows.seen().positions[0] - end) < 0.007


def test_a_wheel_below_the_gripper_keeps_its_turn_until_the_gripper_is_low_enough_to_turn_it():
    peg = np.array([0.45, 0.0, 0.0]) + DEVICES["wheel"].grip(WIDTH)
    follows = tracker()

    def wheel(yaw):
        return seen((peg, "wheel", "red", {"yaw": yaw, "share": 0.5}))

    for _ in range(20):
        follows.update(wheel(0.0), moment())
    above = moment([[0.0, 0.0, 0.4], peg + [-0.1, 0.0, 0.3], peg + [0.0, 0.03, 0.08]])
    for yaw in (0.6, -0.4, 0.8, 0.5):
        follows.update(wheel(yaw), above)
    assert abs(heading(follows.seen().quaternions[0])) < 0.1


def test_a_wheel_that_is_pushed_stops_at_its_ends():
    wheel, stand = DEVICES["wheel"], np.array([0.45, 0.0, 0.0])
    follows = tracker()
    for _ in range(3):
        follows.update(seen((stand + wheel.grip(WIDTH), "wheel", "red", {"share": 0.5})), moment())
    for angle in np.linspace(-0.9, 0.7, 25):  # around its middle, behind the peg
        gripper = stand + wheel.grip(WIDTH, angle)
        follows.update(seen(), moment([[0.0, 0.0, 0.4], gripper + [-0.1, 0.0, 0.3], gripper]))
    assert heading(follows.seen().quaternions[0]) == pytest.approx(wheel.way, abs=0.03)


def test_what_is_in_a_drawer_moves_with_it_and_stays_in_it():
    drawer = config_of("workspace=room").workspace.fittings["drawer"]
    number = list(NOUNS).index("drawer")
    nouns = known().nouns.copy()
    nouns[number] = True
    follows = tracker(nouns=nouns, fittings={number: drawer})
    low, high = drawer.inside_at(np.array(0.8))
    inside = np.array([*((low + high) / 2)[:2], low[2] + SIZE / 2])

    def handle(share):
        return drawer.handle_at(drawer.value(share)), "drawer", "red"

    for _ in range(3):
        follows.update(seen((inside, "cube", "blue"), handle(0.8)), moment())
    for share in (0.8, 0.6, 0.4, 0.2):
        place = drawer.handle_at(drawer.value(share))
        arm = moment([[0.0, 0.0, 0.4], place + [-0.1, 0.0, 0.3], place + [0.0, 0.0, 0.03]])
        follows.update(seen((place + [0.0, 0.0, 0.06], "cube", "blue"), handle(share)), arm)
    found = follows.seen()
    cube = found.positions[found.nouns == list(NOUNS).index("cube")]
    way = drawer.handle_at(drawer.value(0.2)) - drawer.handle_at(drawer.value(0.8))
    np.testing.assert_allclose(cube, [inside + way], atol=0.01)


def test_what_is_held_stays_in_the_gripper_whatever_is_seen_of_it():
    follows = tracker()
    at_the_cube = np.array([[0.0, 0.0, 0.3], [0.3, 0.1, 0.4], [0.4, 0.1, 0.05]])
    follows.update(seen(CUBE), moment(at_the_cube))
    for _ in range(5):
        follows.update(seen(CUBE), moment(at_the_cube, holds=True))
    for way in (0.02, 0.04, 0.06):
        there = CUBE[0] + np.array([0.0, 0.0, way])
        seen_there = there + [0.05, 0.0, -0.04], "cube", "red"
        follows.update(seen(seen_there), moment(at_the_cube + [0.0, 0.0, way], holds=True))
        np.testing.assert_allclose(follows.seen().positions, [there], atol=1e-3)


def test_a_handle_that_is_held_goes_where_the_gripper_takes_it_whatever_pictures_show_of_it():
    number = list(NOUNS).index("fridge")
    follows = tracker(nouns=np.isin(list(NOUNS), [*SHAPES, *FITTINGS]), fittings={number: FRIDGE})

    def handle(share):
        return FRIDGE.handle_at(FRIDGE.value(share))

    def at(share, holds):
        return moment([[0.0, 0.0, 0.4], handle(share) + [-0.1, 0.0, 0.3], handle(share)], holds=holds)

    for _ in range(10):
        follows.update(seen((handle(0.6), "fridge", "cyan")), at(0.6, holds=False))
    follows.update(seen((handle(0.6), "fridge", "cyan")), at(0.6, holds=True))
    for share in np.arange(0.55, 0.14, -0.05):
        follows.update(seen((handle(max(share - 0.1, 0.0)), "fridge", "cyan")), at(share, holds=True))
        np.testing.assert_allclose(follows.seen().positions, [handle(share)], atol=4e-3)


def test_nothing_new_is_believed_that_the_arm_hides_in_part():
    follows = tracker()
    follows.update(seen(CUBE), moment())
    before_it = np.array([[0.0, 0.0, 0.3], [0.3, 0.1, 0.4], [0.58, -0.02, 0.13]])
    for _ in range(4):
        follows.update(seen(CUBE, BALL), moment(before_it))
    assert names(follows.seen()) == [("cube", "red")]
    for _ in range(2):
        follows.update(seen(CUBE, BALL), moment())
    assert len(follows.seen().ids) == 2

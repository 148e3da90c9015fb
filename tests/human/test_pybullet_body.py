"""The pointing arm and its body: accuracy, limits, motions and determinism."""

from __future__ import annotations

import numpy as np
import pybullet as bullet
import pytest

from human.arms import STYLES, Unreachable
from human.body import Body, read_arm
from tests.helpers.human_cases import angles, config, off, standing, step, table

CUBE, OTHER = (0.45, 0.0, 0.025), (0.5, 0.28, 0.025)


@pytest.fixture(scope="module")
def body():
    with standing() as body:
        yield body


def solved(body: Body, style: str, places: np.ndarray) -> list[np.ndarray | None]:
    found: list[np.ndarray | None] = []
    for place in places:
        try:
            found.append(body.solve(place, style))
        except Unreachable:
            found.append(None)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES)
def test_the_line_points_within_half_a_degree_all_over_the_table(body, style):
    places = table(20)
    errors = []
    for place, joints in zip(places, solved(body, style, places), strict=True):
        if joints is not None:
            body.pose(joints)
            errors.append(off(body, place, style))
    assert len(errors) >= 0.97 * len(places)
    assert np.median(errors) <= 0.1
    assert np.percentile(errors, 99) <= 0.5


@pytest.mark.parametrize("style", STYLES)
def test_every_object_place_is_reachable_within_the_joint_limits(body, style):
    places = table(20)
    near = places[(places[:, 0] > 0.2) & (places[:, 0] < 0.7) & (np.abs(places[:, 1]) < 0.45)]
    for joints in solved(body, style, near):
        assert joints is not None
        assert (joints >= body.low).all()
        assert (joints <= body.high).all()


def test_styles_run_through_different_points(body):
    body.point_at(CUBE, style="eye")
    assert off(body, CUBE, "eye") < 0.1
    assert off(body, CUBE, "finger") > 1
    tip, direction = body.ray("eye")
    np.testing.assert_allclose(direction, (tip - body.eyes) / np.linalg.norm(tip - body.eyes), atol=1e-9)
    with pytest.raises(ValueError, match="did you mean 'eye'"):
        body.ray("eyes")


def test_unreachable_targets_are_refused_and_nothing_moves(body):
    body.point_at(CUBE)
    before = angles(body), body.target
    with pytest.raises(Unreachable, match=r"\(1.400, 0.040, 0.640\) m"):
        body.point_at((1.4, 0.04, 0.64))  # their own shoulder
    with pytest.raises(Unreachable, match="style=eye"):
        body.point_at((2.5, -0.15, 0.3), style="eye")  # behind their back
    assert angles(body) == before[0]
    assert (body.target == before[1]).all()
    with pytest.raises(ValueError, match="finite"):
        body.solve((0.4, np.nan, 0.0))


def test_relative_targets_count_from_the_last_one(body):
    body.point_at(CUBE)
    body.point_at((0.05, 0.2, 0.0), relative=True)
    np.testing.assert_allclose(body.target, (0.5, 0.2, 0.025))
    assert off(body, (0.5, 0.2, 0.025)) < 0.1


def test_solve_does_not_depend_on_earlier_targets(body):
    first = body.solve(CUBE)
    body.point_at(OTHER, style="wrist")
    before = angles(body)
    assert (body.solve(CUBE) == first).all()
    assert angles(body) == before


def test_a_motion_passes_through_intermediate_postures_and_ends_exactly(body):
    body.point_at(CUBE)
    goal = body.solve(OTHER)
    body.point_at(OTHER, frames=16)
    errors = []
    while body.moving:
        step(body, 1)
        errors.append(off(body, OTHER))
        np.testing.assert_allclose(body.drawn(), body.ray(), atol=1e-4)
    assert len(errors) == 16
    assert errors[0] > errors[5] > errors[10] > errors[14] > errors[-1]
    assert (body.angles == goal).all()


def test_a_resting_body_does_not_drift(body):
    body.point_at(CUBE)
    assert not body.moving
    step(body, 5)  # until Bullet has it asleep
    posed = angles(body)
    step(body, 1000)
    assert angles(body) == posed
    np.testing.assert_allclose(np.array(posed)[body.joints], body.solve(CUBE), atol=1e-5)


@pytest.mark.parametrize("style", STYLES)
def test_the_drawn_links_agree_with_the_ray(body, style):
    for place in table(4):
        body.point_at(place, style=style)
        np.testing.assert_allclose(body.drawn(style), body.ray(style), atol=1e-5)


def test_an_arm_without_a_body_equals_the_body(body):
    arm = read_arm(config())
    for place, frames in ((CUBE, 0), (OTHER, 9)):
        for each in (arm, body):
            each.point_at(place, frames=frames)
        for _ in range(frames):
            arm.advance()
            body.advance()
            np.testing.assert_array_equal(arm.ray(), body.ray())
    np.testing.assert_array_equal(arm.eyes, body.eyes)


def test_the_relaxed_arm_hangs(body):
    body.relax()
    tip = body.ray()[0]
    assert tip[2] < -0.05
    assert abs(tip[0] - 1.35) < 0.1


def episode(body: Body) -> list[list[float]]:
    body.relax()
    body.point_at(CUBE)
    body.point_at(OTHER, frames=12)
    seen = []
    for _ in range(30):
        step(body, 1)
        seen.append([*body.angles.tolist(), *angles(body)])
    return seen


def test_the_same_targets_give_the_same_bits_after_other_episodes():
    with standing() as fresh, standing() as used:
        used.point_at((0.3, -0.3, 0.1), frames=20, style="eye")
        step(used, 7)  # cut off in mid-move
        assert episode(used) == episode(fresh) == episode(used)


def test_bodies_pass_through_the_person_without_moving_them(body):
    body.point_at(CUBE)
    step(body, 5)
    posed, tip = angles(body), body.ray()[0]
    ball = bullet.createMultiBody(
        1.0, bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.05, physicsClientId=body.client),
        -1, tip + (-0.06, 0, 0.03), physicsClientId=body.client,
    )  # fmt: skip
    bullet.resetBaseVelocity(ball, (2, 0, 0), physicsClientId=body.client)
    step(body, 60)
    assert angles(body) == posed
    assert bullet.getBasePositionAndOrientation(ball, body.client)[0][0] > tip[0] + 0.3

"""The object that a ray singles out, alone and with words: distances, angles, likelihoods, impossible referents."""

import numpy as np
import pytest

from human import (
    NothingPointedAt,
    add_aiming_noise,
    fuse,
    pointed_object,
    posterior,
    ray_offsets,
    referring_phrase,
    visibility,
)
from human.pointing import HIDDEN_PRIOR, MAX_ANGLE
from language import LanguageError, NotUnderstood, Object, ObjectPhrase, Scene

SCENE = Scene(Object(noun, color, (0.4, 0.0, 0.0)) for noun, color in (("cube", "red"), ("cube", "blue")))
ORIGIN = np.array([0.8, 0.1, 0.3])


def rays(rng, *batch):
    direction = rng.normal(size=(*batch, 3))
    return rng.normal(size=(*batch, 3)), direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def test_offsets_are_those_of_the_right_triangle_between_ray_and_object():
    rng = np.random.default_rng(0)
    origin, direction = rays(rng, 50)
    positions = rng.normal(size=(50, 4, 3))
    lies = ray_offsets(origin, direction, positions)
    offset = positions - origin[:, None]
    cross = np.linalg.norm(np.cross(offset, direction[:, None]), axis=-1)
    np.testing.assert_allclose(lies.distance, cross, atol=1e-12)
    np.testing.assert_allclose(lies.along**2 + lies.distance**2, (offset**2).sum(-1), atol=1e-12)
    np.testing.assert_allclose(np.cos(lies.angle), lies.along / np.linalg.norm(offset, axis=-1), atol=1e-12)


def test_an_object_on_the_ray_has_offset_zero_at_any_distance():
    """The original took the norm of the projection: it would prefer the object nearest to the hand."""
    direction = np.array([-0.6, 0.0, -0.8])
    near_but_aside = ORIGIN + 0.1 * direction + [0.0, 0.05, 0.0]
    far_but_on_it = ORIGIN + 0.5 * direction
    assert pointed_object(ORIGIN, direction, [near_but_aside, far_but_on_it]) == 1


def test_the_index_has_the_batch_shape_and_agrees_with_single_rays():
    rng = np.random.default_rng(1)
    origin, direction = rays(rng, 5, 3)
    steps = rng.uniform(0.2, 1.0, size=(5, 3, 6, 1))
    positions = origin[..., None, :] + steps * direction[..., None, :] + 0.05 * rng.normal(size=(5, 3, 6, 3))
    found = pointed_object(origin, direction, positions)
    assert found.shape == (5, 3)
    for index in np.ndindex(5, 3):
        assert found[index] == pointed_object(origin[index], direction[index], positions[index])


def test_objects_behind_the_hand_are_never_selected():
    direction = np.array([-1.0, 0.0, 0.0])
    behind, before = ORIGIN + [0.05, 0.0, 0.0], ORIGIN + [-0.3, 0.1, 0.0]
    assert pointed_object(ORIGIN, direction, [behind, before]) == 1
    assert posterior(ORIGIN, direction, [behind, before], 10.0).tolist() == [0.0, 1.0]


def test_absent_objects_are_never_selected():
    direction = np.array([-1.0, 0.0, 0.0])
    positions = [ORIGIN + [-0.3, 0.0, 0.0], ORIGIN + [-0.3, 0.1, 0.0]]
    assert pointed_object(ORIGIN, direction, positions, shown=[False, True]) == 1
    assert posterior(ORIGIN, direction, positions, 2.0, shown=[False, True]).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("judge", [pointed_object, lambda *ray: posterior(*ray, 2.0)])
def test_a_ray_without_objects_raises_with_the_nearest_angle(judge):
    aside = ORIGIN + [-0.1, 0.3, 0.0]
    with pytest.raises(NothingPointedAt, match=r"72 degrees beside it, and less than 45"):
        judge(ORIGIN, np.array([-1.0, 0.0, 0.0]), [aside])
    with pytest.raises(NothingPointedAt, match="there is no object"):
        judge(ORIGIN, np.array([-1.0, 0.0, 0.0]), np.zeros((0, 3)))


@pytest.mark.parametrize("direction", [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])
def test_a_direction_of_length_zero_is_refused(direction):
    with pytest.raises(ValueError, match="not all 0"):
        pointed_object(ORIGIN, direction, [[0.0, 0.0, 0.0]])


def test_the_length_of_a_direction_has_no_effect():
    positions = [ORIGIN + [-0.3, 0.02, 0.0], ORIGIN + [-0.5, 0.1, 0.0]]
    one, other = (posterior(ORIGIN, np.array([-1.0, 0.05, 0.0]) * scale, positions, 3.0) for scale in (1, 7))
    np.testing.assert_allclose(one, other)


def test_the_posterior_is_calibrated():
    """Calibration: of the objects that get probability p, a share p are the referent."""
    rng = np.random.default_rng(2)
    count, noise = 20_000, 5.0
    positions = ORIGIN + [-0.5, 0.0, -0.2] + rng.uniform(-0.08, 0.08, (count, 4, 3))
    meant = rng.integers(4, size=count)
    direction = add_aiming_noise(positions[np.arange(count), meant] - ORIGIN, noise, rng)
    said = posterior(np.broadcast_to(ORIGIN, (count, 3)), direction, positions, noise)
    np.testing.assert_allclose(said.sum(-1), 1.0)
    for low in np.arange(0.0, 1.0, 0.2):
        chosen = (said >= low) & (said < low + 0.2)
        right = (np.arange(4) == meant[:, None])[chosen]
        assert abs(said[chosen].mean() - right.mean()) < 0.02


def test_without_noise_the_nearest_object_has_all_the_probability():
    positions = [ORIGIN + [-0.3, 0.02, 0.0], ORIGIN + [-0.5, 0.01, 0.0]]
    assert posterior(ORIGIN, np.array([-1.0, 0.0, 0.0]), positions, 0.0).tolist() == [0.0, 1.0]


def test_aiming_noise_has_the_given_deviation_in_both_directions():
    rng = np.random.default_rng(3)
    direction = np.array([0.0, 0.6, -0.8])
    turned = add_aiming_noise(np.broadcast_to(direction, (50_000, 3)), 4.0, rng)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=-1), 1.0)
    across = np.stack(([1.0, 0.0, 0.0], np.cross(direction, [1.0, 0.0, 0.0])))
    spread = np.rad2deg(np.std(turned @ across.T, axis=0))
    np.testing.assert_allclose(spread, 4.0, rtol=0.02)
    np.testing.assert_array_equal(add_aiming_noise(direction, 0.0, rng), direction)


def test_a_hidden_object_has_a_smaller_prior():
    eyes = np.array([1.5, 0.0, 0.9])
    sight = np.array([0.5, 0.0, 0.0]) - eyes
    hidden, hider, plain = eyes + sight, eyes + 0.9 * sight, eyes + sight + [0.0, 0.2, 0.0]
    assert visibility(eyes, [hidden, hider, plain], size=0.05).tolist() == [HIDDEN_PRIOR, 1.0, 1.0]
    prior = visibility(eyes, [hidden, plain, hider], size=0.05)
    between = (hidden + plain) / 2 - ORIGIN
    evenly, knowing = (posterior(ORIGIN, between, [hidden, plain, hider], 5.0, each) for each in (None, prior))
    assert knowing[0] < 0.3 * evenly[0]


def test_objects_at_the_maximum_angle_or_beyond_are_excluded():
    for angle, meant in ((MAX_ANGLE - 0.01, True), (MAX_ANGLE + 0.01, False)):
        place = ORIGIN + 0.3 * np.array([-np.cos(angle), np.sin(angle), 0.0])
        if meant:
            assert pointed_object(ORIGIN, [-1.0, 0.0, 0.0], [place]) == 0
        else:
            with pytest.raises(NothingPointedAt):
                pointed_object(ORIGIN, [-1.0, 0.0, 0.0], [place])


def test_the_phrase_of_the_last_step_is_returned():
    assert referring_phrase("reach that red one") == ObjectPhrase(color="red", determiner="that")
    assert referring_phrase("lift the cube, then reach the ball") == ObjectPhrase(noun="sphere")


def test_a_correction_is_refused_with_an_error_for_the_user():
    with pytest.raises(LanguageError, match="'no, the blue one' is a correction"):
        referring_phrase("no, the blue one")


def test_a_sentence_outside_the_grammar_is_refused():
    with pytest.raises(NotUnderstood):
        referring_phrase("paint the cube")


def test_probabilities_are_those_of_the_ray_where_the_words_fit():
    np.testing.assert_allclose(
        fuse(ObjectPhrase(noun="cube", determiner="that"), SCENE, np.array([0.2, 0.6])), [0.25, 0.75]
    )
    np.testing.assert_allclose(fuse(ObjectPhrase(color="red"), SCENE, np.array([0.1, 0.9])), [1, 0])


def test_words_that_fit_no_object_the_ray_allows_are_refused():
    with pytest.raises(NothingPointedAt, match="nothing that fits 'the red object'"):
        fuse(ObjectPhrase(color="red"), SCENE, np.array([0.0, 1.0]))

"""Pointing with the keyboard."""

from __future__ import annotations

import numpy as np
import pytest

from human import (
    Body,
    KeyboardPointer,
    NothingPointedAt,
    choose_object,
    pointed_object,
)
from tests.helpers.human_cases import step
from tests.helpers.keys import RecordingDisplay, ScriptedKeys

MIDDLE = (0.45, 0.0, 0.02)
BOUNDS = (-1.0, 2.0, -1.0, 1.0, -0.1, 1.0)
PLACES = np.array([[0.45, 0.0, 0.02], [0.45, 0.2, 0.02]])


class PersonOverTwoObjects:
    """A person who points over two objects. rays: the finger's direction after each physics step."""

    def __init__(self, body: Body, frames: int = 10) -> None:
        self.body, self.frames = body, frames
        self.rays: list[np.ndarray] = []

    def point(self, target):
        self.body.point_at(target, frames=self.frames)
        while self.body.moving:
            step(self.body, 1)
            self.rays.append(self.body.ray()[1])
        return self.body.ray()[0]

    def nearest(self):
        return int(pointed_object(*self.body.ray(), PLACES))

    meant = nearest

    def name(self, index):
        return ("the red cube", "the blue sphere")[index]


@pytest.fixture
def arm(standing_body):
    return PersonOverTwoObjects(standing_body)


@pytest.fixture(scope="module")
def standing_body():
    from tests.helpers.human_cases import standing

    with standing() as body:
        yield body


def moved(arm, *keys, yaw=0.0):
    """How far the target goes, metres."""
    hand = KeyboardPointer(arm, RecordingDisplay(yaw), MIDDLE, BOUNDS)
    for key in keys:
        hand.press(key)
    return (hand.target - MIDDLE).round(6).tolist()


@pytest.mark.parametrize(
    ("yaw", "right", "away"),
    [(0, (1, 0), (0, 1)), (14, (1, 0), (0, 1)), (90, (0, 1), (-1, 0)), (-80, (0, -1), (1, 0)), (180, (-1, 0), (0, -1))],
)
def test_arrows_move_in_the_viewers_directions(arm, yaw, right, away):
    for key, (x, y), sign in (("right", right, 1), ("left", right, -1), ("up", away, 1), ("down", away, -1)):
        assert moved(arm, key, yaw=yaw) == pytest.approx([0.05 * sign * x, 0.05 * sign * y, 0])


def test_page_keys_move_up_and_down(arm):
    assert moved(arm, "pageup") == [0, 0, 0.05]
    assert moved(arm, "3", "pageup", "pagedown", "pageup") == [0, 0, 0.03]


@pytest.mark.parametrize(("digit", "metres"), [(str(cm), cm / 100) for cm in range(1, 10)] + [("0", 0.1)])
def test_digits_set_the_step_to_1_to_10_cm(arm, digit, metres):
    assert moved(arm, digit, "left") == [-metres, 0, 0]


def test_moves_accumulate(arm):
    assert moved(arm, "2", "left", "left", "up", "7", "up") == pytest.approx([-0.04, 0.09, 0])


def test_other_keys_have_no_effect(arm):
    assert moved(arm, "w", "f1", "") == [0, 0, 0]


def test_the_arm_moves_through_intermediate_postures(arm):
    hand = KeyboardPointer(arm, RecordingDisplay(), MIDDLE, BOUNDS)
    arm.rays.clear()
    before = arm.body.ray()[1]
    hand.press("0")
    hand.press("up")
    after = arm.body.ray()[1]
    assert len(arm.rays) >= arm.frames
    turned = np.array([np.arccos(np.clip(ray @ before, -1, 1)) for ray in arm.rays])
    whole = np.arccos(before @ after)
    assert whole > np.radians(3)
    assert ((turned > 0.1 * whole) & (turned < 0.9 * whole)).sum() >= 4  # on the way, not at an end
    sight = hand.target - arm.body.ray()[0]
    assert after @ sight / np.linalg.norm(sight) > np.cos(np.radians(0.1))


def test_an_unreachable_place_is_refused_and_the_finger_stays(arm):
    beside = (1.05, 0.04, 0.64)
    hand = KeyboardPointer(arm, RecordingDisplay(), beside, BOUNDS)
    before = arm.body.ray()
    hand.press("right")
    assert hand.note.startswith("the finger stays: target=(1.100, 0.040, 0.640) m")
    assert hand.target.tolist() == list(beside)
    np.testing.assert_array_equal(arm.body.ray(), before)
    hand.press("left")
    assert hand.note == ""


def test_the_finger_stays_within_the_workspace(arm):
    hand = KeyboardPointer(arm, RecordingDisplay(), MIDDLE, (0.4, 0.5, -0.3, 0.3, 0.0, 0.3))
    hand.press("left")
    hand.press("left")
    assert hand.note == "the finger stays: that is too far away from the table"
    assert hand.target[0] == pytest.approx(0.4)


def test_enter_chooses_the_object_pointed_at_and_shows_its_name(arm):
    view = RecordingDisplay()
    assert (
        choose_object(
            KeyboardPointer(arm, view, MIDDLE, BOUNDS), ScriptedKeys(["0", "up", "up", "enter"]), view, ["title"]
        )
        == 1
    )
    said = [[line for line in page if line.startswith("pointing at")] for page in view.pages]
    assert said[0] == ["pointing at the red cube"]
    assert said[-1] == ["pointing at the blue sphere"]
    assert all(page[0] == "title" and any("page up" in line for line in page) for page in view.pages)
    np.testing.assert_allclose(view.beam[1], (0.45, 0.2, 0.02))


def test_enter_on_nothing_shows_the_reason_and_continues(arm):
    view = RecordingDisplay()
    high = [*["0", "pageup"], *["pageup"] * 7]
    assert choose_object(KeyboardPointer(arm, view, MIDDLE, BOUNDS), ScriptedKeys([*high, "enter"]), view) is None
    with pytest.raises(NothingPointedAt) as refused:
        arm.nearest()
    assert str(refused.value) in view.pages[-1]
    assert "pointing at nothing" in view.pages[-1]
    back = ["0", *["pagedown"] * 8]
    assert (
        choose_object(KeyboardPointer(arm, view, MIDDLE, BOUNDS), ScriptedKeys([*high, "enter", *back, "enter"]), view)
        == 0
    )


def test_escape_returns_none(arm):
    view = RecordingDisplay()
    keys = ScriptedKeys(["left", "escape", "enter"])
    assert choose_object(KeyboardPointer(arm, view, MIDDLE, BOUNDS), keys, view) is None
    assert keys.poll() == ["enter"]

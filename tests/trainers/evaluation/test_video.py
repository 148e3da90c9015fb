"""Videos of episodes and their captions."""

from __future__ import annotations

import numpy as np
import torch
from PIL import ImageFont
from tensordict import TensorDict

from tests.helpers.fake_env import make_env
from tests.helpers.fake_expert import EXPERT
from trainers.evaluation.video import add_caption, outcome_of, record_video, wrap_text


def test_a_video_has_a_caption_and_even_sides(tmp_path):
    outcomes = record_video(make_env(1, 0), EXPERT, tmp_path / "video.mp4", episodes=2)
    assert len(outcomes) == 2
    assert (tmp_path / "video.mp4").stat().st_size > 1000
    frame = make_env(1, 0).film()
    written, blank = add_caption(frame, "touch the red"), add_caption(frame, " ")
    assert (written != blank).any()
    assert not any(side % 2 for side in written.shape[:2])


def test_letters_grow_with_the_frame():
    small, large = np.zeros((360, 480, 3), np.uint8), np.zeros((540, 720, 3), np.uint8)
    heights = [add_caption(frame, "touch the red", note="the robot's").shape[0] for frame in (small, large)]
    assert heights == [360 + 80, 540 + 120]


def test_a_long_sentence_is_wrapped_into_two_lines(tmp_path):
    frame = make_env(1, 0).film()
    words = "put it there " * (frame.shape[1] // 60)
    assert ImageFont.load_default(size=14).getlength(words) > frame.shape[1]
    height = frame.shape[0]
    lines = np.split(add_caption(frame, words)[height : height + 60], 3)
    assert [bool(line.any()) for line in lines] == [True, True, False]


def test_the_outcome_names_the_first_flag_that_is_set():
    state = {name: torch.tensor([name == "wrong_object"]) for name in ("success", "wrong_object", "truncated")}
    assert outcome_of(TensorDict(state, [1])) == "wrong object"
    late = {name: torch.tensor([name == "truncated"]) for name in state}
    assert outcome_of(TensorDict(late, [1])) == "out of time"
    assert outcome_of(TensorDict({name: torch.tensor([False]) for name in state}, [1])) == "failed"


def test_a_word_longer_than_the_width_gets_a_line_of_its_own():
    font = ImageFont.load_default(size=14)
    assert wrap_text("a " + "m" * 40 + " b", 50, font) == ["a", "m" * 40, "b"]

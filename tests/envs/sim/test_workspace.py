"""The camera of videos."""

import numpy as np
import pytest

from core.cameras import CameraFrame, project
from core.overrides import compose
from envs.config import read_env

LEFT = {"robot": 1.0, "human": -1.0}  # along y


@pytest.mark.parametrize("viewpoint", LEFT)
@pytest.mark.parametrize("task", ["nl_reach", "nl_reach_gesture", "nl_open", "nl_put_in", "anything", "rearrange"])
def test_what_is_left_for_those_who_are_meant_is_left_in_a_video(task, viewpoint):
    workspace = read_env(compose([f"task={task}"])).workspace
    camera = workspace.film_from(viewpoint)
    places = np.array([[0.45, 0.1 * side * LEFT[viewpoint], 0.05] for side in (1, -1)])
    (left, right), depths = project(camera, CameraFrame.of(camera), places)
    assert 0 < left[0] < right[0] < camera.width
    assert (depths > 0).all()
    assert (camera.width, camera.height) == (720, 540)

import numpy as np
import pytest
import torch

from core.cameras import CameraFrame
from core.errors import ConfigError
from envs.perception.detections import View
from envs.perception.network import SightNetwork
from envs.perception_training.__main__ import main
from envs.perception_training.fitting import disturb, fit, losses
from envs.perception_training.scenes import (
    LABEL,
    PLAIN,
    SEEN,
    SIDE,
    LabelledView,
    LookVariation,
    draw_pictures,
    faced,
)
from envs.sim.devices import DEVICES
from language import NOUNS
from tests.helpers.env_cases import config_of

SETUP = (("task=nl_reach", "task.num_objects=4"),)


@pytest.fixture(scope="module")
def pictures():
    return draw_pictures(24, 0, setups=SETUP, shares=None)


def test_a_seed_gives_the_same_pictures(pictures):
    again = draw_pictures(24, 0, setups=SETUP, shares=None)
    assert np.array_equal(pictures.pictures, again.pictures)
    assert np.array_equal(pictures.labels, again.labels)


def test_what_is_seen_has_its_colour_in_the_picture():
    plain = draw_pictures(16, 1, setups=SETUP, shares=None, looks=PLAIN, disturbed=False)
    colors = {0: (255, 0, 0), 2: (0, 0, 255)}  # red and blue
    checked = 0
    for picture, labels in zip(plain.pictures, plain.labels, strict=True):
        for label in labels[labels[:, LABEL.index("state")] == SEEN]:
            wanted = colors.get(int(label[LABEL.index("color")]))
            if wanted is not None:
                u, v = label[:2].astype(int)
                assert picture[v, u].argmax() == np.argmax(wanted)
                checked += 1
    assert checked > 5


def test_a_window_moves_the_labels_with_the_picture():
    picture = np.arange(192 * 192 * 3, dtype=np.uint32).reshape(192, 192, 3) % 251
    labels = np.zeros((16, len(LABEL)))
    labels[0, :2], labels[0, -1] = (96.0, 100.0), SEEN
    camera = config_of("task=nl_reach").workspace.cameras["front"]
    view = View(picture.astype(np.uint8), camera, CameraFrame.of(camera))
    drawn = LabelledView(view, labels, np.zeros((1, 3)))
    part, moved, told = drawn.window(np.random.default_rng(3))
    assert part.shape == (SIDE, SIDE, 3)
    u, v = told[0, :2].astype(int)
    assert np.array_equal(part[v, u], picture[100, 96])
    assert np.array_equal(moved[13:] - drawn.numbers[13:], told[0, :2] - [96.0, 100.0])


def test_looks_vary_more_than_plain_ones():
    plain, varied = (
        draw_pictures(8, 2, setups=SETUP, shares=None, looks=looks).pictures[:, 100:].astype(float)
        for looks in (PLAIN, LookVariation(recolor=1.0, light=1.0))
    )
    assert varied.std(0).mean() > plain.std(0).mean()


def test_disturbed_pictures_stay_pictures(pictures):
    inputs = torch.from_numpy(pictures.pictures).permute(0, 3, 1, 2).float() / 255
    out = disturb(inputs, torch.from_numpy(pictures.labels), torch.Generator().manual_seed(0))
    assert out.shape == inputs.shape
    assert 0 <= out.min() < out.max() <= 1
    assert not torch.equal(out, inputs)


def test_a_few_steps_lower_the_loss(pictures):
    def loss(network):
        inputs = torch.from_numpy(pictures.pictures).permute(0, 3, 1, 2).float() / 255
        with torch.no_grad():
            terms = losses(network(inputs, torch.from_numpy(pictures.cameras)), torch.from_numpy(pictures.labels))
        return float(sum(terms.values()))

    torch.manual_seed(0)
    before = loss(SightNetwork().eval())
    assert loss(fit(pictures, steps=16, batch=2, learning_rate=6e-3)) < before - 2


def test_bad_arguments_are_told_in_one_sentence(tmp_path):
    for words, message in (
        (["trane"], "did you mean"),
        (["train", "picture=3"], "did you mean"),
        (["train", "steps=0"], "steps=0"),
        (["train", f"init={tmp_path}/none"], "cannot be read"),
        (["evaluate", "scenes=many"], "scenes=many"),
    ):
        with pytest.raises(ConfigError, match=message):
            main(words)


def test_a_wheel_faces_where_its_handle_is_and_a_button_nowhere():
    nouns = np.array([list(NOUNS).index(noun) for noun in ("lever", "wheel", "wheel", "button", "cube")])
    yaws = faced(nouns, np.full(5, 0.3), np.array([0.9, 0.5, 1.0, 0.7, 0.0]))
    np.testing.assert_allclose(yaws, [0.3, 0.3, 0.3 + DEVICES["wheel"].way, 0.0, 0.3])

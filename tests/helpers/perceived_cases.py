"""Environments with perception=camera whose detections are the simulator's truth with errors, without any network."""

import numpy as np

from core.cameras import CameraFrame
from envs.mdp.object_rows import OBJECT_WIDTH
from envs.perception.detections import COLOR_NAMES, NOUN_NAMES, Detections, UnusablePicture
from envs.perception.poses import heading
from envs.sim.devices import DEVICES, facing
from envs.workspace_env import WorkspaceEnv
from language import COLORS, color_name
from tests.helpers.env_cases import config_of


def unsure(numbers, count, sure):
    """(M, count) probabilities: `sure` for these numbers (M,), the rest in equal parts."""
    table = np.full((len(numbers), count), (1 - sure) / (count - 1))
    table[np.arange(len(numbers)), numbers] = sure
    return table


def share_of(noun, place, quaternion, width):
    """How far a device is moved, of its joint's range, by the true pose of its handle."""
    device = DEVICES[noun]
    if noun == "button":
        value = (device.handle[2] - place[2] / width) / 1.0
    elif noun == "lever":
        x, y, z, w = quaternion
        value = device.start + np.arctan2(2 * (y * w - x * z), 1 - 2 * (x * x + y * y))
    else:
        return 0.5  # how a wheel was placed does not show
    return float(np.clip((value - device.low) / (device.high - device.low), 0.0, 1.0))


class TrueReader:
    """Tells what is there, with errors that a test sets.

    noise: metres, standard deviation of places. sure: probability of the right noun and colour. missing: slots that
    are overlooked. invented: detections (position, noun, colour) of what is not there. blind: why nothing is seen.
    backwards: the detections come in another order.
    """

    def __init__(self, env, noise=0.0, sure=0.98):
        self._env, self.noise, self.sure = env, noise, sure
        self.missing, self.invented, self.blind, self.backwards = set(), [], None, False
        self._rngs = [np.random.default_rng((7, i)) for i in range(env.batch_size[0])]
        self.reads = 0

    def angles(self, world):
        return None

    def places(self, gripper):
        workspace, perception = self._env.config.workspace, self._env.config.perception
        cameras = [workspace.cameras[name] for name in perception.cameras]
        return np.array([CameraFrame.of(camera, gripper).place for camera in cameras])

    def read(self, world, gripper):
        self.reads += 1
        if self.blind:
            raise UnusablePicture(self.blind)
        env, state, rows = self._env, self._env.state, self._env._arrays.rows[world]
        slots = [slot for slot in np.flatnonzero(state.shown[world]).tolist() if slot not in self.missing]
        places, turns, nouns = rows[slots, :3].copy(), rows[slots, 3:7], state.nouns[world, slots]
        names = [NOUN_NAMES[noun] for noun in nouns]
        colors = [list(COLORS).index(color_name(color)) for color in rows[slots, 7:11]]
        ahead = facing(turns)
        faces = np.arctan2(ahead[:, 1], ahead[:, 0])
        yaws = [
            faces[k] if name in DEVICES else heading(turns)[k] if name == "cube" else 0.0
            for k, name in enumerate(names)
        ]
        width = env.task.device_width
        shares = [share_of(n, places[k], turns[k], width) if n in DEVICES else 0.0 for k, n in enumerate(names)]
        targets = np.where(rows[slots, OBJECT_WIDTH - 1] > 0.5, 0.98, 0.02)
        for place, noun, color in self.invented:
            places = np.concatenate((places, [place]))
            nouns, colors = np.append(nouns, NOUN_NAMES.index(noun)), [*colors, COLOR_NAMES.index(color)]
            yaws, shares, targets = [*yaws, 0.0], [*shares, 0.0], np.append(targets, 0.02)
        count = len(places)
        places = places + self.noise * self._rngs[world].standard_normal(places.shape)
        std = max(self.noise, 0.001)
        seen = Detections(
            positions=places,
            covariances=np.tile(std**2 * np.eye(3), (count, 1, 1)),
            nouns=unsure(nouns.astype(int), len(NOUN_NAMES), self.sure),
            colors=unsure(np.array(colors, int), len(COLOR_NAMES), self.sure),
            sizes=np.full(count, env.config.task.object_size),
            yaws=np.array(yaws, float),
            shares=np.array(shares, float),
            targets=targets,
            presence=np.full(count, 0.99),
        )
        return seen[::-1] if self.backwards else seen


class TrulySeeingEnv(WorkspaceEnv):
    """Sees what is there: `reader` is a `TrueReader`."""

    def _make_reader(self, config):
        self.reader = TrueReader(self)
        return self.reader


def seeing(*overrides, worlds=1, seed=0, **errors):
    """An environment with perception=camera, whose detections have these errors."""
    env = TrulySeeingEnv(config_of("perception=camera", *overrides), worlds, seed)
    for name, value in errors.items():
        setattr(env.reader, name, value)
    return env

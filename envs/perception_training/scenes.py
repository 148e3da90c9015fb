"""Pictures to learn to see from: drawn scenes of all workspaces, without physics, and what is in them.

Each scene is one that a task draws, with the arm anywhere, now and then an object in the air or on another one, and
random looks: colours, light, textures, unknown things, camera poses.
"""

from __future__ import annotations

import io
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image

from core.cameras import Camera, CameraFrame, Light, camera_at, project
from core.overrides import compose
from envs.config import read_env
from envs.mdp.object_rows import OBJECT_WIDTH
from envs.mdp.randomization import InitialStates
from envs.perception.detections import View
from envs.perception.network import camera_numbers
from envs.sim.appearance import Appearance
from envs.sim.devices import DEVICES
from envs.sim.rendering import Photo, link_number
from envs.workspace_env import WorkspaceEnv
from language import FITTINGS, HAND, NOUNS, SHAPES, color_table

Array = NDArray[np.float64]
SIDE = 128  # pixels across the pictures that are learned from
CHUNK = 2000  # pictures that a process draws at once
THINGS = 16  # most things in a picture
NOUN_NAMES = tuple(NOUNS)
LABEL = ("u", "v", "height", "size", "noun", "color", "target", "turn", "share", "state")
SEEN, IGNORED = 1.0, -1.0  # of `state`; 0: there is nothing
ENOUGH, HARDLY = 0.3, 0.06  # visible shares of a thing from which it is seen, and below which it isn't
STRIP = 20  # visible pixels of the moving part of a fitting from which it is seen
FITTING_NUMBERS = [NOUN_NAMES.index(noun) for noun in FITTINGS]
SETUPS: tuple[tuple[str, ...], ...] = (
    ("task=nl_reach", "task.num_objects=6"),
    ("task=nl_reach", "task.num_objects=4", "task.object_size=0.04", "robot=panda"),
    ("task=nl_pick_and_place", "task.num_objects=4", "task.nouns=[cube,sphere,cylinder]"),
    ("task=nl_pick_and_place", "robot=panda", "gripper=fingers"),
    ("task=nl_pick_and_place", "task.num_objects=3", "robot=jaco"),
    ("task=nl_reach_gesture", "gesture=ray"),
    ("task=nl_reach_large", "task.object_size=0.06"),
    ("task=nl_stack", "robot=ur5"),
    ("task=nl_reach", "task.num_objects=5", "robot=xarm7"),
    ("task=anything",),
    ("task=anything", "robot=panda"),
    ("task=nl_put_in",),
)
SHARES = (0.1, 0.05, 0.12, 0.08, 0.03, 0.1, 0.05, 0.04, 0.03, 0.22, 0.12, 0.06)  # of pictures by setup


@dataclass(frozen=True)
class Pictures:
    """M labelled pictures.

    pictures: (M, H, W, 3) uint8. cameras: (M, 15) of `camera_numbers`. labels: (M, THINGS, len(LABEL)): pixels, metres,
    indices of noun and colour, role, radians relative to the line of sight, share, and whether it is SEEN or IGNORED.
    positions: (M, THINGS, 3) metres in the workspace.
    """

    pictures: NDArray[np.uint8]
    cameras: NDArray[np.float32]
    labels: NDArray[np.float32]
    positions: NDArray[np.float32]

    @classmethod
    def join(cls, parts: Sequence[Pictures]) -> Pictures:
        """Return the pictures of all parts."""
        names = "pictures", "cameras", "labels", "positions"
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class LabelledView:
    """A view, the labels (THINGS, len(LABEL)) of what is in it, and the positions (K, 3) of K things, metres."""

    view: View
    labels: Array
    positions: Array

    @property
    def numbers(self) -> NDArray[np.float32]:
        """(15,) `camera_numbers`."""
        return camera_numbers(self.view.camera, self.view.frame)

    def window(self, rng: Generator) -> tuple[NDArray[np.uint8], NDArray[np.float32], Array]:
        """Return a random window of SIDE x SIDE pixels, `camera_numbers` there, and its labels."""
        v, u = (int(rng.integers(0, most - SIDE + 1)) for most in self.view.picture.shape[:2])
        numbers, labels = self.numbers, self.labels.copy()
        numbers[13:] -= u, v
        labels[:, :2] -= u, v
        edge = np.abs(labels[:, :2] - SIDE / 2).max(1)
        labels[(edge > SIDE / 2 - 1) & (labels[:, -1] > 0), -1] = IGNORED  # at the border it may be seen or not
        labels[edge > SIDE / 2 + 6, -1] = 0.0
        return self.view.picture[v : v + SIDE, u : u + SIDE], numbers, labels


@dataclass(frozen=True, kw_only=True)
class LookVariation:
    """How much looks vary: the standard deviations and shares from which scenes draw.

    shift: metres, turn: degrees, zoom: share of the field of view, of the cameras. recolor, light, texture, unknown,
    shadow, jpeg: shares of scenes with other colours, another light, a texture on the furniture, unknown things,
    shadows, and of pictures that were compressed.
    """

    shift: float = 0.025
    turn: float = 2.5
    zoom: float = 0.03
    recolor: float = 0.6
    light: float = 0.7
    texture: float = 0.4
    unknown: float = 0.3
    shadow: float = 0.15
    jpeg: float = 0.25


PLAIN = LookVariation(
    shift=0.0, turn=0.0, zoom=0.0, recolor=0.0, light=0.0, texture=0.0, unknown=0.0, shadow=0.0, jpeg=0.0
)


class SceneSource:
    """Draws scenes of one setup and photographs them with its cameras.

    rng: what all that is random is drawn from.

    Args:
        overrides: of the environment.
        cameras: names of workspace cameras.
        seed: of all that is random.
        looks: how much looks vary.
        disturbed: whether the arm is anywhere and objects are in the air; else scenes are as episodes begin.
    """

    def __init__(
        self,
        overrides: Sequence[str],
        cameras: Sequence[str],
        seed: int,
        *,
        looks: LookVariation,
        disturbed: bool = True,
    ) -> None:
        config = read_env(compose([*overrides])).without_curriculum()
        self.rng = np.random.default_rng(seed)
        self._env = WorkspaceEnv(config, 1, seed, render=True)
        self._world = self._env._worlds[0]
        self._cameras = [config.workspace.cameras[name] for name in cameras]
        self._looks, self._disturbed = looks, disturbed
        self._box = np.reshape(config.workspace.gripper_box, (3, 2)).T
        self._postures = InitialStates(self._env.kinematics, 0.0, self._box)
        self._appearance = Appearance(self._world)
        self._area = config.workspace.object_area

    def draw(self) -> Iterator[LabelledView]:
        """Draw a scene, and photograph it with one camera after another."""
        rng, looks = self.rng, self._looks
        episode = self._env.task.draw(rng)
        if episode.shares is not None and rng.random() < 0.5:
            episode = replace(
                episode, shares=np.where(self._inside(episode), episode.shares, rng.random(len(episode.shares)))
            )
        self._env.start([episode], int(rng.integers(2**31)))
        things = self._things(episode)
        if self._disturbed:
            self._disturb(things)
        self._look(things)
        light = sample_light(rng, looks.shadow) if rng.random() < looks.light else Light()
        pose = self._env.kinematics.forward(self._joints[None])
        texture = Texture(rng) if rng.random() < looks.texture else None
        for camera in self._cameras:
            moved, frame = moved_camera(camera, looks, rng)
            photo = self._world.photograph(moved, (pose.position[0], pose.rotation[0]), light)
            if rng.random() < looks.recolor:
                photo.colors[photo.links < 0] = rng.integers(0, 256, 3)
            if texture is not None:
                texture.paint(photo, moved, frame, self._appearance.furniture)
            if rng.random() < looks.jpeg:
                photo = replace(photo, colors=compressed(photo.colors, int(rng.integers(35, 95))))
            labels = self._labels(things, photo, moved, frame)
            yield LabelledView(View(photo.colors, moved, frame), labels, things.positions)

    def close(self) -> None:
        self._env.close()

    # ---- things

    def _inside(self, episode) -> NDArray[np.bool_]:
        """(K,) whether to leave a fitting as it is, since something may lie in it."""
        names = [NOUN_NAMES[noun] for noun in episode.scene.nouns]
        places = zip(episode.scene.positions, names, strict=True)
        beside = any(abs(place[1]) > 0.24 for place, name in places if name in SHAPES)
        return np.array([name in FITTINGS and beside for name in names])

    def _things(self, episode) -> _Things:
        state, rows = self._env._state, self._env._arrays.rows[0]
        slots = np.flatnonzero(state.shown[0])
        self._joints = self._env._arrays.angles[0].copy()
        order = self._env._arrays.slots[0]
        shares = np.zeros(len(rows))
        if episode.shares is not None:
            shares[order] = episode.shares
        yaws = faced(state.nouns[0, slots], state.yaw[0, slots], shares[slots])
        colors = color_table()[:, :3]
        nearest = ((rows[slots, None, 7:10] - colors) ** 2).sum(-1).argmin(1)
        return _Things(
            nouns=state.nouns[0, slots].copy(),
            colors=nearest,
            sizes=rows[slots, OBJECT_WIDTH - 2].copy(),
            targets=rows[slots, OBJECT_WIDTH - 1].copy(),
            yaws=yaws,
            shares=shares[slots],
            positions=np.array([position for position, _ in self._world.object_poses()]),
        )

    def _disturb(self, things: _Things) -> None:
        """Move the arm anywhere, turn loose objects, and lift or stack some."""
        rng, world = self.rng, self._world
        if rng.random() < 0.8:
            place = rng.uniform(*self._box)
            real = np.flatnonzero(things.targets < 0.5)
            if rng.random() < 0.5 and len(real):  # near a thing, as in most steps of an episode
                number = rng.choice(real)
                beside, above = (0.05, 0.07) if things.loose[number] else (0.03, 0.02)
                place = things.positions[number] + rng.normal(0.0, beside, 3) + [0.0, 0.0, above]
                place = np.clip(place, *self._box)
            joints = self._postures.joints(place)
            self._joints = joints + rng.normal(0.0, 0.05, len(joints))
            world.robot.place(self._joints.tolist(), float(rng.uniform(0.0, 0.04)))
        loose = np.flatnonzero(things.loose)
        free = loose[things.targets[loose] < 0.5]
        things.yaws[loose] = rng.uniform(-np.pi, np.pi, len(loose)) * (rng.random(len(loose)) < 0.6)
        chance = rng.random()
        if chance < 0.3 and len(free):
            gripper = self._env.kinematics.forward(self._joints[None]).position[0]
            number = rng.choice(free)
            things.positions[number] = gripper - [0.0, 0.0, things.sizes[number] * rng.uniform(0.0, 0.6)]
        elif chance < 0.4 and len(free) > 1:
            top, below = rng.choice(free, 2, replace=False)
            things.positions[top] = things.positions[below] + [*rng.normal(0, 0.006, 2), things.sizes[top]]
        elif chance < 0.5 and len(free) and len(free) < len(loose):
            goal = things.positions[rng.choice(loose[things.targets[loose] > 0.5])]  # as it is brought to a target
            things.positions[rng.choice(free)] = goal + np.abs(rng.normal(0.0, 1.0, 3)) * [0.02, 0.02, 0.03]
        elif chance < 0.62 and len(free):
            things.positions[rng.choice(free)] = rng.uniform(*self._box)
        half = things.yaws[loose] / 2
        poses = [
            (things.positions[k].tolist(), (0.0, 0.0, float(np.sin(a)), float(np.cos(a))))
            for k, a in zip(loose, half, strict=True)
        ]
        world.pool.put(poses)

    def _look(self, things: _Things) -> None:
        rng, looks = self.rng, self._looks
        if looks.recolor and rng.random() < looks.recolor:
            self._appearance.recolor(rng)
        count = rng.integers(1, 5) if rng.random() < looks.unknown else 0
        self._appearance.scatter(spare_places(self._area, things.positions, int(count), rng), rng)
        if looks.recolor:
            self._world.fade(float(rng.uniform(0.35, 0.7)))

    # ---- labels

    def _labels(self, things: _Things, photo: Photo, camera: Camera, frame: CameraFrame) -> Array:
        pixels, depths = project(camera, frame, things.positions)
        rays = things.positions - frame.place
        labels = np.zeros((THINGS, len(LABEL)))
        for k in range(len(things.nouns)):
            turn = things.yaws[k] - np.arctan2(rays[k, 1], rays[k, 0])
            labels[k] = (
                *pixels[k],
                things.positions[k, 2],
                things.sizes[k],
                things.nouns[k],
                things.colors[k],
                things.targets[k],
                turn,
                things.shares[k],
                self._visible(things, k, photo=photo, camera=camera, pixel=pixels[k], depth=depths[k]),
            )
        return labels

    def _visible(self, things: _Things, k: int, *, photo: Photo, camera: Camera, pixel: Array, depth: float) -> float:
        """Return SEEN, IGNORED or 0."""
        u, v = int(np.floor(pixel[0])), int(np.floor(pixel[1]))
        if not (1 <= u < camera.width - 1 and 1 <= v < camera.height - 1):
            return IGNORED if -6 <= u < camera.width + 6 and -6 <= v < camera.height + 6 else 0.0
        if things.loose[k]:
            body = self._world._shown.holdable[k].body
            count = float((photo.links == body).sum())
            share = count / (camera.focal * things.sizes[k] / depth) ** 2
            return SEEN if share > ENOUGH else IGNORED if share > HARDLY else 0.0
        if things.nouns[k] in FITTING_NUMBERS:
            part = self._world._shown.holdable[k]
            # A drawer is known by its front where a hand hides the handle.
            if (photo.links == link_number(part.body, part.link)).sum() > STRIP:
                return SEEN
        near = photo.depths[v - 1 : v + 2, u - 1 : u + 2]
        free = (near > depth - (0.1 if NOUN_NAMES[things.nouns[k]] == HAND else 0.05)).sum()
        return SEEN if free >= 5 else IGNORED if free else 0.0


@dataclass(kw_only=True)
class _Things:
    nouns: NDArray[np.int64]
    colors: NDArray[np.int64]
    sizes: Array
    targets: Array
    yaws: Array
    shares: Array
    positions: Array

    @property
    def loose(self) -> NDArray[np.bool_]:
        return np.array([NOUN_NAMES[noun] in SHAPES for noun in self.nouns])


def spare_places(area: Sequence[float], taken: Array, count: int, rng: Generator) -> list[list[float]]:
    """Return up to `count` places (x, y) about an area (x0, x1, y0, y1), 11 cm or more from those taken (K, 3)."""
    x0, x1, y0, y1 = area
    places = rng.uniform([x0 - 0.1, y0 - 0.1], [x1 + 0.15, y1 + 0.1], (count, 2))
    apart = np.linalg.norm(places[:, None] - taken[None, :, :2], axis=-1).min(1)
    free: list[list[float]] = places[apart > 0.11].tolist()
    return free


def faced(nouns: NDArray[np.int64], yaws: Array, shares: Array) -> Array:
    """(K,) radians: where things face as a picture shows it, given yaws and shares of their joints (K,).

    A wheel faces where its handle is. Buttons look the same from all sides.
    """
    wheel, button = ((nouns == NOUN_NAMES.index(noun)) for noun in ("wheel", "button"))
    return np.where(button, 0.0, yaws + np.where(wheel, DEVICES["wheel"].value(shares), 0.0))


def moved_camera(camera: Camera, looks: LookVariation, rng: Generator) -> tuple[Camera, CameraFrame]:
    """Return a camera that stands, looks and zooms a little differently, and its frame."""
    shift, turn = rng.normal(0.0, 1.0, 3) * looks.shift, np.deg2rad(rng.normal(0.0, 1.0, 3) * looks.turn)
    frame = CameraFrame.of(camera)
    angle = float(np.linalg.norm(turn))
    if angle == 0.0 and not shift.any() and not looks.zoom:
        return camera, frame
    axis = turn / max(angle, 1e-12)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    fov = camera.fov * float(1 + rng.normal(0.0, 1.0) * looks.zoom)
    moved = camera_at(CameraFrame(frame.place + shift, frame.axes @ rotation.T), replace(camera, fov=fov))
    return moved, CameraFrame.of(moved)


def sample_light(rng: Generator, shadow: float) -> Light:
    """Return a light from above, of random direction, colour temperature and brightness."""
    x, y = rng.uniform(-1.5, 1.5, 2).tolist()
    red, green, blue = rng.uniform(0.85, 1.1, 3).tolist()
    ambient = rng.uniform(0.4, 0.7)
    diffuse = rng.uniform(0.15, 1.05 - ambient)
    return Light(
        direction=(x, y, rng.uniform(0.4, 1.5)),
        color=(red, green, blue),
        ambient=ambient,
        diffuse=diffuse,
        specular=rng.uniform(0.0, 0.2),
        shadow=bool(rng.random() < shadow),
    )


def compressed(picture: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return a picture (H, W, 3) as JPEG of this quality, in [1, 95], shows it."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=quality)
    return np.asarray(Image.open(file))


class Texture:
    """A random pattern over the furniture: waves, checks or stripes in two directions, which shade its colours."""

    def __init__(self, rng: Generator) -> None:
        self._waves = rng.normal(0.0, 1.0, (3, 2)) * rng.choice([15.0, 40.0, 90.0], (3, 1))
        self._phases, self._hard = rng.uniform(0, 2 * np.pi, 3), rng.random() < 0.4
        self._strength = rng.uniform(0.05, 0.35) * rng.choice([-1.0, 1.0], 3) * rng.uniform(0.6, 1.0, 3)

    def paint(self, photo: Photo, camera: Camera, frame: CameraFrame, bodies: Sequence[int]) -> None:
        """Paint it where the photo shows these bodies."""
        mask = np.isin(photo.links, bodies)
        v, u = np.nonzero(mask)
        if not len(u):
            return
        across = (np.stack((u, v), 1) + 0.5 - camera.middle) / camera.focal
        rays = np.concatenate((across, np.ones((len(u), 1))), 1) @ frame.axes
        points = frame.place + photo.depths[v, u][:, None] * rays
        pattern = np.sin(points[:, :2] @ self._waves.T + self._phases).mean(1)
        pattern = np.sign(pattern) * 0.6 if self._hard else pattern
        gain = 1.0 + self._strength * pattern[:, None]
        photo.colors[v, u] = np.clip(photo.colors[v, u] * gain, 0, 255).astype(np.uint8)


def draw_pictures(
    count: int,
    seed: int,
    *,
    cameras: Sequence[str] = ("front", "side"),
    looks: LookVariation = LookVariation(),
    setups: Sequence[Sequence[str]] = SETUPS,
    shares: Sequence[float] | None = SHARES,
    disturbed: bool = True,
) -> Pictures:
    """Return about `count` labelled pictures, windows of SIDE x SIDE pixels: setup after setup, scene after scene."""
    weights = np.ones(len(setups)) / len(setups) if shares is None else np.array(shares) / np.sum(shares)
    scenes = np.maximum(np.round(weights * count / len(cameras)), 0).astype(int)
    parts = []
    for number, (overrides, amount) in enumerate(zip(setups, scenes, strict=True)):
        if not amount:
            continue
        source = SceneSource(overrides, cameras, seed * 1000 + number, looks=looks, disturbed=disturbed)
        try:
            # A window is drawn before the next camera looks, from the numbers that the scene is drawn from.
            views = [(*view.window(source.rng), view.positions) for _ in range(amount) for view in source.draw()]
        finally:
            source.close()
        parts.append(_pictures(views))
    return Pictures.join(parts)


def draw_in_processes(
    count: int, seed: int, processes: int, *, setups: Sequence[Sequence[str]] = SETUPS, shares: Sequence[float] = SHARES
) -> Pictures:
    """Return about `count` pictures that several processes draw; how many processes changes nothing."""
    chunks = max(1, round(count / CHUNK))
    jobs = [(count // chunks, seed * 10_000 + i, setups, shares) for i in range(chunks)]
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        return Pictures.join(list(pool.map(_drawn, jobs)))


def _drawn(job: tuple[int, int, Sequence[Sequence[str]], Sequence[float]]) -> Pictures:
    torch.set_num_threads(1)
    count, seed, setups, shares = job
    return draw_pictures(count, seed, setups=setups, shares=shares)


def _pictures(views: Sequence[tuple]) -> Pictures:
    positions = np.zeros((len(views), THINGS, 3), np.float32)
    for row, view in zip(positions, views, strict=True):
        row[: len(view[3])] = view[3]
    pictures, numbers, labels = (np.stack([view[i] for view in views]) for i in range(3))
    return Pictures(pictures, numbers, labels.astype(np.float32), positions)

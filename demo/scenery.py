"""What the page shows around the simulation: light, a floor, soft shadows, and a fridge that looks like one.

Only the page shows it. The pictures of the workspace's cameras are of the simulation alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from demo.meshes import faded_disc, painted, polygons, soft_shadow
from demo.scene_view import SceneView, move
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.workspace import Box

Array = NDArray[np.float64]
FLOOR, FRIDGE, TOP = "floor", "fridge", "top"  # names of furniture and fittings in workspaces
FLOOR_COLOR, FLOOR_RADIUS, FLOOR_SOLID = (
    (196, 200, 206),
    3.2,
    0.15,
)  # RGB, metres, and the share that is not see-through
ABOVE = 0.0015  # metres of a shadow over what it is on
UNDER_TABLE, TABLE_BLUR = 0.5, 0.35  # opacity, metres
FURNITURE, FURNITURE_BLUR = 0.4, 0.03
OBJECT, OBJECT_BLUR = 0.55, 0.45  # opacity, sizes of an object
ARM, ARM_WIDTH, ARM_BLUR = 0.12, 0.06, 0.07  # opacity, metres, metres
ARM_SPACING, ARM_SHADOWS = 0.03, 28  # metres, and their number
NOWHERE = -5.0  # metres: height of what is not shown
HIGHEST = 0.6  # metres, from which on nothing casts a shadow
WALL, CORNER, PLINTH = 0.012, 0.018, 0.008  # metres: of a fridge
SHELL, LINER, DARK, SNOW, GLOW = (244, 246, 248), (214, 234, 250), (58, 64, 72), (255, 255, 255), (40, 140, 255)


class Scenery:
    """The surroundings in a view. show_env: to be called after the view's own."""

    def __init__(self, view: SceneView) -> None:
        self._view, self._scene = view, view.scene
        self._objects: list[Any] = []  # shadows
        self._arm: Any = None

    def show_env(self, env: InteractiveEnv) -> None:
        """Show what is around an environment that the view shows."""
        self._env = env
        self._objects = []
        self._size = env.config.task.object_size
        self._light()
        furniture = env.config.workspace.furniture
        if FLOOR in furniture and TOP in furniture:
            self._lay_floor(furniture[FLOOR], furniture[TOP])
        self._ground(list(furniture.values()))
        self._arm = self._scene.add_batched_meshes_trimesh(
            "/scenery/arm",
            soft_shadow(ARM_WIDTH, ARM_WIDTH, ARM_BLUR, ARM),
            np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (ARM_SHADOWS, 1)),
            np.full((ARM_SHADOWS, 3), NOWHERE, np.float32),
            cast_shadow=False,
            receive_shadow=False,
        )
        if FRIDGE in env.furniture.bodies:
            self._dress_fridge(env.furniture.bodies[FRIDGE])

    def _light(self) -> None:
        self._scene.add_light_ambient("/light", intensity=0.45)  # in place of the view's own
        self._scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(196, 186, 176), intensity=1.1)

    # ---- Floor and standing shadows

    def _lay_floor(self, floor: Box, table: Box) -> None:
        self._view.hide([body for body, box in self._env.furniture.boxes.items() if box == floor])
        height = floor.position[2] + floor.size[2] / 2
        self._add("floor", faded_disc(FLOOR_RADIUS, FLOOR_SOLID, FLOOR_COLOR), (*table.position[:2], height))
        shadow = soft_shadow(table.size[0], table.size[1], TABLE_BLUR, UNDER_TABLE)
        self._add("floor/shadow", shadow, (*table.position[:2], height + ABOVE))

    def _ground(self, boxes: list[Box]) -> None:
        """Show where furniture that stands on the table does so."""
        for number, box in enumerate(boxes):
            bottom = box.position[2] - box.size[2] / 2
            if abs(bottom) < 0.01 and box.contact:
                shadow = soft_shadow(box.size[0], box.size[1], FURNITURE_BLUR, FURNITURE)
                self._add(f"ground/{number}", shadow, (*box.position[:2], ABOVE))

    def _add(self, name: str, mesh: trimesh.Trimesh, place: tuple[float, ...], **look: Any) -> Any:
        return self._scene.add_mesh_trimesh(
            f"/scenery/{name}", mesh, position=place, cast_shadow=False, receive_shadow=False, **look
        )

    # ---- Shadows of what moves

    def show_shadows(self, places: Array) -> None:
        """Draw a soft shadow on the table below each place (N, 3), metres; none below negative heights."""
        while len(self._objects) < len(places):
            shadow = soft_shadow(0.9 * self._size, 0.9 * self._size, OBJECT_BLUR * self._size, OBJECT)
            self._objects.append(self._add(f"object/{len(self._objects)}", shadow, (0.0, 0.0, 0.0), visible=False))
        for index, shadow in enumerate(self._objects):
            low = index < len(places) and 0 <= places[index, 2] < HIGHEST
            move(shadow, np.array([*places[index, :2], 2 * ABOVE]) if low else None)
        self._arm.batched_positions = self._below_arm()

    def _below_arm(self) -> NDArray[np.float32]:
        """(ARM_SHADOWS, 3) metres: places on the table, evenly spaced, below the low part of the arm."""
        joints = self._view.places(self._env.robot.body)
        lengths = np.concatenate(([0.0], np.linalg.norm(np.diff(joints[:, :2], axis=0), axis=1).cumsum()))
        along = ARM_SPACING * np.arange(ARM_SHADOWS)
        places = np.stack([np.interp(along, lengths, joints[:, axis]) for axis in range(3)], 1)
        places[along > lengths[-1], 2] = np.inf
        places[:, 2] = np.where(places[:, 2] < HIGHEST, 2 * ABOVE, NOWHERE)
        return places.astype(np.float32)

    # ---- The fridge

    def _dress_fridge(self, body: int) -> None:
        """Show a chest with round corners in place of the boxes under a lid, and a snowflake on the lid."""
        lid = max(
            (shape for shape in self._view.shapes if shape.body == body), key=lambda each: each.size[0] * each.size[1]
        )
        low, high = _bounds(self._env.config.workspace.fittings[FRIDGE].parts["lid"])
        boxes = self._env.furniture.boxes
        under = {each: box for each, box in boxes.items() if _lies_under(box, low, high)}
        if not under:
            return
        self._view.hide(list(under))
        inner = max(box.position[2] + box.size[2] / 2 for box in under.values() if box.size[2] < 0.04)
        top = max(box.position[2] + box.size[2] / 2 for box in under.values())
        middle, half = (low[:2] + high[:2]) / 2, (high[:2] - low[:2]) / 2
        for name, mesh in chest(half, PLINTH, inner, top).items():
            self._add(f"fridge/{name}", mesh, (*middle, 0.0))
        x, y, z = lid.position
        frame = f"/{lid.body}/{lid.link + 1}"
        for name, mesh, height in (("snow", snowflake(0.32 * min(lid.size[:2])), 0.5), ("liner", _liner(half), -0.5)):
            place = (x, y, z + height * (lid.size[2] + 0.002))
            self._scene.add_mesh_trimesh(f"{frame}/{name}", mesh, position=place, cast_shadow=False)


def chest(half: Array, bottom: float, inner: float, top: float) -> dict[str, trimesh.Trimesh]:
    """Return the parts of an open chest about the origin, which stands on a plinth.

    Args:
        half: (2,) half sides, metres.
        bottom, inner, top: heights of the plinth, of the floor inside and of the rim, metres.
    """
    outside, inside = _rim(half, CORNER), _rim(half - WALL, CORNER - WALL / 2)
    shell = [*_wall(outside, bottom, top), *_between(outside, inside, top)]
    liner = [*_wall(inside[::-1], inner, top), [np.array([*point, inner]) for point in inside]]
    foot = _wall(_rim(half - 0.006, CORNER), 0.0, bottom)
    slots = [_slot(half[0], along, height) for along in (-0.03, 0.0, 0.03) for height in (0.02, 0.028, 0.036)]
    lamp = [_facing(half[0], 0.075, 0.06, 0.008, 0.004)]
    parts = {
        "shell": (shell, SHELL),
        "liner": (liner, LINER),
        "foot": (foot, DARK),
        "vent": (slots, DARK),
        "lamp": (lamp, GLOW),
    }
    return {name: painted(polygons(faces), color) for name, (faces, color) in parts.items()}


def _rim(half: Array, radius: float) -> Array:
    """(N, 2) the corners of a rectangle with round corners, anticlockwise, metres."""
    turns = np.linspace(0, np.pi / 2, 6)
    arc = radius * np.stack((np.cos(turns), np.sin(turns)), 1)
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    points = []
    for number, (x, y) in enumerate(signs):
        angle = number * np.pi / 2
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        points.append((half - radius) * (x, y) + arc @ turn.T)
    return np.concatenate(points)


def _wall(rim: Array, bottom: float, top: float) -> list[list[Array]]:
    """The faces of a wall along a rim, seen from the right of its way round."""
    return [
        [np.array([*here, bottom]), np.array([*after, bottom]), np.array([*after, top]), np.array([*here, top])]
        for here, after in zip(rim, np.roll(rim, -1, 0), strict=True)
    ]


def _between(outside: Array, inside: Array, height: float) -> list[list[Array]]:
    """The level faces between two rims of as many points."""
    corners = zip(outside, np.roll(outside, -1, 0), np.roll(inside, -1, 0), inside, strict=True)
    return [[np.array([*point, height]) for point in points] for points in corners]


def _slot(side: float, along: float, height: float) -> list[Array]:
    """A slot of the vent."""
    return _facing(side, along, height, 0.02, 0.003)


def _facing(side: float, along: float, height: float, width: float, depth: float) -> list[Array]:
    """A rectangle on the side towards +x, whose middle is at `along` and `height`, metres."""
    y, z = along + width * np.array([-0.5, 0.5, 0.5, -0.5]), height + depth * np.array([-0.5, -0.5, 0.5, 0.5])
    return [np.array([side + 0.0006, *place]) for place in zip(y, z, strict=True)]


def snowflake(radius: float) -> trimesh.Trimesh:
    """Return a flat snowflake about the origin, metres."""
    bars: list[Any] = []
    for number in range(6):
        turn = trimesh.transformations.rotation_matrix(number * np.pi / 3, [0, 0, 1])
        arms = [_bar(0.0, radius, 0.0)] + [_bar(0.58 * radius, 0.3 * radius, side * np.pi / 4) for side in (-1, 1)]
        bars += [arm.apply_transform(turn) for arm in arms]
    flake: Any = trimesh.util.concatenate(bars)
    return painted(flake, SNOW)


def _bar(start: float, length: float, angle: float) -> trimesh.Trimesh:
    """A bar from `start` on the x axis, metres, at an angle to it."""
    bar = trimesh.creation.box((length, 0.006, 0.0012))
    bar.apply_translation((length / 2, 0.0, 0.0))
    bar.apply_transform(trimesh.transformations.rotation_matrix(angle, [0, 0, 1]))
    return bar.apply_translation((start, 0.0, 0.0))


def _liner(half: Array) -> trimesh.Trimesh:
    """The inside of a lid."""
    return painted(trimesh.creation.box((*(2 * (half - WALL)), 0.003)), LINER)


def _bounds(box: Box) -> tuple[Array, Array]:
    """(3,) lowest and highest corner, metres."""
    middle, half = np.array(box.position), np.array(box.size) / 2
    return middle - half, middle + half


def _lies_under(box: Box, low: Array, high: Array) -> bool:
    """Whether a box lies under another one with these corners (3,), metres."""
    lowest, highest = _bounds(box)
    inside = (lowest[:2] > low[:2] - 0.01).all() and (highest[:2] < high[:2] + 0.01).all()
    return bool(inside and highest[2] < high[2] and lowest[2] > -0.01)

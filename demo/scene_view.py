"""The 3D view in the browser: a mesh for each visual shape, rings around highlighted objects, the finger's ray."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import viser
from numpy.typing import ArrayLike, NDArray

from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.rendering import VisualShape

Array = NDArray[np.float64]
HIDDEN_BELOW = -4.0  # metres: objects that are not in the scene are parked below this height
MIN_CHANGE = 1e-5  # metres, or of a quaternion's components: smaller changes of pose are not sent
GOLD, CYAN, WHITE = (255, 196, 0), (0, 200, 255), (255, 255, 255)
RAY_LENGTH = 1.2  # metres
CONE_HALF_ANGLE = np.deg2rad(4)
RAY_COLOR, CONE_COLOR = (255, 60, 60), (255, 230, 120)


class SceneView:
    """The 3D view of a server. Not thread-safe.

    on_click: called with the body that was clicked. on_drag: called with the body and the place that it was dragged to,
    (3,) metres.
    """

    def __init__(
        self, server: viser.ViserServer, on_click: Callable[[int], None], on_drag: Callable[[int, Array], None]
    ) -> None:
        self._scene: Any = server.scene
        self._on_click, self._on_drag = on_click, on_drag
        self._scene.set_up_direction("+z")
        self._env: InteractiveEnv | None = None

    def show_env(self, env: InteractiveEnv) -> None:
        """Replaces the content of the view by the meshes of this environment."""
        self._scene.reset()
        self._scene.configure_default_lights(cast_shadow=False)  # shadows are slow without a graphics card
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=1.2)
        self._env = env
        self._selectable = set(env.all_bodies)
        self._shapes = env.visual_shapes.shapes()
        self._links = sorted({(shape.body, shape.link) for shape in self._shapes})
        self._frames = [self._scene.add_frame(f"/{body}/{link + 1}", show_axes=False) for body, link in self._links]
        self._meshes: list[Any] = [self._add_mesh(number, shape) for number, shape in enumerate(self._shapes)]
        self._poses = np.full((len(self._links), 7), np.nan)
        self._rings = [self._add_ring(name, color) for name, color in (("referent", GOLD), ("target", CYAN))]
        self._pointed_ring = self._add_ring("pointed", WHITE)
        self._label = self._scene.add_label("/ring/label", "", visible=False)
        self._ray_nodes: tuple[Any, ...] = ()
        self._drawn_ray = np.zeros(0)
        self.update_colors()

    def update_colors(self) -> None:
        """Takes over the colours of objects and fittings, which differ from scene to scene."""
        assert self._env is not None
        shapes = self._env.visual_shapes.shapes()
        for mesh, before, shape in zip(self._meshes, self._shapes, shapes, strict=True):
            if mesh is not None and shape.rgba != before.rgba:
                mesh.color = _rgb(shape)
                mesh.opacity = _opacity(shape)
        self._shapes = shapes

    def update_poses(self) -> None:
        """Moves the meshes of all links that have moved."""
        assert self._env is not None
        poses = self._env.visual_shapes.poses(self._links)
        with np.errstate(invalid="ignore"):
            moved = ~(np.abs(poses - self._poses) < MIN_CHANGE).all(1)
        for index in np.flatnonzero(moved):
            frame, (x, y, z, qx, qy, qz, qw) = self._frames[index], poses[index].tolist()
            frame.visible = z > HIDDEN_BELOW
            frame.position, frame.wxyz = (x, y, z), (qw, qx, qy, qz)
        self._poses = poses

    def highlight(self, objects: tuple[int, ...], positions: Array) -> None:
        """Puts rings around referent and target: indices of objects at positions (K, 3), metres."""
        for ring, index in zip(self._rings, [*objects, None, None], strict=False):
            _place(ring, None if index is None or index >= len(positions) else positions[index])

    def show_pointing(self, ray: tuple[Array, Array] | None, probabilities: Array | None, positions: Array) -> None:
        """Draws the finger's ray with a cone, and marks the likeliest object of K with its probability."""
        self._label.visible = probabilities is not None and len(probabilities) == len(positions)
        if probabilities is not None and self._label.visible:
            index = int(probabilities.argmax())
            self._label.text = f"pointed at: {probabilities[index]:.0%}"
            self._label.position = tuple(positions[index] + [0.0, 0.0, 0.09])
            _place(self._pointed_ring, positions[index])
        else:
            _place(self._pointed_ring, None)
        new_ray = np.zeros(0) if ray is None else np.concatenate(ray)
        if not np.array_equal(new_ray, self._drawn_ray):
            self._drawn_ray = new_ray
            self._draw_ray(ray)

    def _draw_ray(self, ray: tuple[Array, Array] | None) -> None:
        for node in self._ray_nodes:
            node.remove()
        self._ray_nodes = ()
        if ray is None:
            return
        origin, direction = ray
        cone = trimesh.creation.cone(radius=RAY_LENGTH * np.tan(CONE_HALF_ANGLE), height=RAY_LENGTH, sections=24)
        cone.apply_translation([0, 0, -RAY_LENGTH])  # apex at the origin, opening towards -z
        cone.apply_transform(trimesh.geometry.align_vectors([0, 0, -1], direction))
        ends = np.array([[origin, origin + RAY_LENGTH * direction]])
        self._ray_nodes = (
            self._scene.add_line_segments("/ray/line", ends, colors=np.array(RAY_COLOR), line_width=2.0),
            self._scene.add_mesh_simple(
                "/ray/cone", cone.vertices, cone.faces, color=CONE_COLOR, opacity=0.18, position=origin
            ),
        )

    def _add_ring(self, name: str, color: tuple[int, int, int]) -> Any:
        ring = trimesh.creation.annulus(r_min=0.045, r_max=0.055, height=0.004, sections=48)
        return self._scene.add_mesh_simple(
            f"/ring/{name}", ring.vertices, ring.faces, color=color, visible=False, cast_shadow=False
        )

    def _add_mesh(self, number: int, shape: VisualShape) -> Any:
        name = f"/{shape.body}/{shape.link + 1}/{number}"
        x, y, z, w = shape.quaternion
        place = {"position": shape.position, "wxyz": (w, x, y, z)}
        if shape.rgba[3] == 0 and shape.mesh is None:  # the cone of a ray, which PyBullet's own renderer draws
            return None
        mesh = _mesh(shape.type, shape.size, shape.mesh)
        if shape.mesh is None or shape.rgba[:3] != (1.0, 1.0, 1.0):  # else the mesh file has colours
            look = {"color": _rgb(shape), "opacity": _opacity(shape)}
            handle = self._scene.add_mesh_simple(name, mesh.vertices, mesh.faces, **look, **place)
        else:
            handle = self._scene.add_mesh_trimesh(name, mesh, **place)
        if shape.body in self._selectable:
            self._listen(handle, shape.body)
        return handle

    def _listen(self, handle: Any, body: int) -> None:
        handle.on_click(lambda _: self._on_click(body))

        async def drag(event: Any) -> None:  # a coroutine: in a pool of threads, events could change their order
            place = _at_height(event.start_position[2], event.client.camera.position, event.end_position)
            if place is not None:
                self._on_drag(body, place)

        handle.on_drag("left")(drag)


def _at_height(height: float, eye: ArrayLike, through: ArrayLike) -> Array | None:
    """(3,) metres: where the line from an eye through a point reaches this height; None if it does not."""
    start = np.asarray(eye, np.float64)
    direction = np.asarray(through, np.float64) - start
    with np.errstate(over="ignore", invalid="ignore"):
        share = (height - start[2]) / direction[2] if direction[2] else -1.0
        place = start + share * direction
    return place if share > 0 and np.isfinite(place).all() else None


def _place(ring: Any, position: Array | None) -> None:
    """Puts a ring on the table around a position (3,), metres; hides it for None."""
    ring.visible = position is not None
    if position is not None:
        ring.position = (position[0], position[1], 0.003)


def _rgb(shape: VisualShape) -> tuple[int, int, int]:
    red, green, blue = (round(255 * share) for share in shape.rgba[:3])
    return red, green, blue


def _opacity(shape: VisualShape) -> float | None:
    return None if shape.rgba[3] >= 1 else max(shape.rgba[3], 0.05)


@lru_cache(maxsize=256)
def _mesh(kind: str, size: tuple[float, float, float], file: Path | None) -> trimesh.Trimesh:
    if file is not None:
        mesh: Any = trimesh.load(file, force="mesh")
        mesh.apply_scale(size)
        return mesh
    if kind == "box":
        return trimesh.creation.box(size)
    if kind == "sphere":
        return trimesh.creation.icosphere(subdivisions=3, radius=size[0])
    if kind == "cylinder":
        return trimesh.creation.cylinder(height=size[0], radius=size[1], sections=32)
    capsule = trimesh.creation.capsule(height=size[0], radius=size[1], count=[16, 16])
    capsule.apply_translation(-capsule.bounds.mean(0))
    return capsule

"""The world as the browser shows it: meshes that hang on the links that carry them, halos, the finger's ray."""

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
from envs.sim.visual_shapes import VisualShape

Array = NDArray[np.float64]
HIDDEN = -4.0  # metres: what lies deeper is parked, and not shown
STILL = 1e-5  # metres, or parts of a quaternion, below which nothing is sent
GOLD, CYAN, WHITE = (255, 196, 0), (0, 200, 255), (255, 255, 255)
RAY, CONE = 1.2, np.deg2rad(4)  # metres that the ray is drawn; half of the cone's opening
CONE_COLOR = (255, 230, 120)


class Drawing:
    """Everything in the 3D view of a server. Use from one thread.

    clicked, dragged: called with the body that was, dragged also with where to, (3,) metres.
    """

    def __init__(
        self, server: viser.ViserServer, clicked: Callable[[int], None], dragged: Callable[[int, Array], None]
    ) -> None:
        self._scene: Any = server.scene
        self._clicked, self._dragged = clicked, dragged
        self._scene.set_up_direction("+z")
        self._stage: InteractiveEnv | None = None

    def stand(self, stage: InteractiveEnv) -> None:
        """Show this world from now on."""
        self._scene.reset()
        self._scene.configure_default_lights(cast_shadow=False)  # without a graphics card they take most of the time
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=1.2)
        self._stage = stage
        self._touchable = set(stage.stock)
        self._shapes = stage.looks.shapes()
        self._links = sorted({(shape.body, shape.link) for shape in self._shapes})
        self._frames = [self._scene.add_frame(f"/{body}/{link + 1}", show_axes=False) for body, link in self._links]
        self._meshes: list[Any] = [self._add(number, shape) for number, shape in enumerate(self._shapes)]
        self._poses = np.full((len(self._links), 7), np.nan)
        self._halos = {name: self._halo(name, color) for name, color in (("meant", GOLD), ("goal", CYAN))}
        self._pointed, self._label = (
            self._halo("pointed", WHITE),
            self._scene.add_label("/halo/label", "", visible=False),
        )
        self._ray: tuple[Any, ...] = ()
        self._drawn = np.zeros(0)
        self.laid()

    def laid(self) -> None:
        """Other objects may lie there now: take on their colours."""
        assert self._stage is not None
        touchable = set(self._stage.bodies())
        for mesh, shape in zip(self._meshes, self._stage.looks.shapes(), strict=True):
            if mesh is not None and shape.body in touchable:
                mesh.color = _rgb(shape)
                mesh.opacity = _opacity(shape)

    def move(self) -> None:
        """Put everything where it is now."""
        assert self._stage is not None
        poses = self._stage.looks.poses(self._links)
        with np.errstate(invalid="ignore"):
            moved = ~(np.abs(poses - self._poses) < STILL).all(1)
        for index in np.flatnonzero(moved):
            frame, (x, y, z, qx, qy, qz, qw) = self._frames[index], poses[index].tolist()
            frame.visible = z > HIDDEN
            frame.position, frame.wxyz = (x, y, z), (qw, qx, qy, qz)
        self._poses = poses

    def glow(self, meant: tuple[int, ...], places: Array) -> None:
        """Halos about what is meant and where it goes; objects by their number, places (K, 3), metres."""
        for halo, index in zip(self._halos.values(), [*meant, None, None], strict=False):
            _put(halo, None if index is None or index >= len(places) else places[index])

    def shine(self, ray: tuple[Array, Array] | None, likely: Array | None, places: Array) -> None:
        """The finger's ray with its cone, and the object that it most likely shows, with the probability."""
        index = None if likely is None or len(likely) != len(places) else int(likely.argmax())
        _put(self._pointed, None if index is None else places[index])
        self._label.visible = index is not None
        if index is not None and likely is not None:
            self._label.text = f"pointed at: {likely[index]:.0%}"
            self._label.position = tuple(places[index] + [0.0, 0.0, 0.09])
        drawn = np.zeros(0) if ray is None else np.concatenate(ray)
        if not np.array_equal(drawn, self._drawn):
            self._drawn = drawn
            self._shine(ray)

    def _shine(self, ray: tuple[Array, Array] | None) -> None:
        for node in self._ray:
            node.remove()
        self._ray = ()
        if ray is None:
            return
        origin, direction = ray
        cone = trimesh.creation.cone(radius=RAY * np.tan(CONE), height=RAY, sections=24)
        cone.apply_translation([0, 0, -RAY])  # its tip at the origin, opening towards -z
        cone.apply_transform(trimesh.geometry.align_vectors([0, 0, -1], direction))
        ends = np.array([[origin, origin + RAY * direction]])
        self._ray = (
            self._scene.add_line_segments("/ray/line", ends, colors=np.array([255, 60, 60]), line_width=2.0),
            self._scene.add_mesh_simple(
                "/ray/cone", cone.vertices, cone.faces, color=CONE_COLOR, opacity=0.18, position=origin
            ),
        )

    def _halo(self, name: str, color: tuple[int, int, int]) -> Any:
        ring = trimesh.creation.annulus(r_min=0.045, r_max=0.055, height=0.004, sections=48)
        return self._scene.add_mesh_simple(
            f"/halo/{name}", ring.vertices, ring.faces, color=color, visible=False, cast_shadow=False
        )

    def _add(self, number: int, shape: VisualShape) -> Any:
        name = f"/{shape.body}/{shape.link + 1}/{number}"
        x, y, z, w = shape.quaternion
        place = {"position": shape.position, "wxyz": (w, x, y, z)}
        if shape.rgba[3] == 0 and shape.mesh is None:  # a cone that PyBullet's own pictures show
            return None
        made = _mesh(shape.kind, shape.size, shape.mesh)
        if shape.mesh is None or shape.rgba[:3] != (1.0, 1.0, 1.0):  # else the mesh has colours of its own
            look = {"color": _rgb(shape), "opacity": _opacity(shape)}
            handle = self._scene.add_mesh_simple(name, made.vertices, made.faces, **look, **place)
        else:
            handle = self._scene.add_mesh_trimesh(name, made, **place)
        if shape.body in self._touchable:  # the browser looks for what is under the mouse among these alone
            self._listen(handle, shape.body)
        return handle

    def _listen(self, handle: Any, body: int) -> None:
        handle.on_click(lambda _: self._clicked(body))

        async def drag(event: Any) -> None:  # not in a pool of threads: its phases must stay in order
            place = _at_height(event.start_position[2], event.client.camera.position, event.end_position)
            if place is not None:
                self._dragged(body, place)

        handle.on_drag("left")(drag)


def _at_height(height: float, eye: ArrayLike, through: ArrayLike) -> Array | None:
    """(3,) where the line of sight from an eye through a place comes down to this height; None where it never does."""
    start = np.asarray(eye, np.float64)
    way = np.asarray(through, np.float64) - start
    share = (height - start[2]) / way[2] if way[2] else -1.0
    return start + share * way if share > 0 else None


def _put(node: Any, place: Array | None) -> None:
    node.visible = place is not None
    if place is not None:
        node.position = (place[0], place[1], 0.003)


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

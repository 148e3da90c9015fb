"""The 3D view in the browser: a mesh for each visual shape, rings around highlighted objects, the finger's ray."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import trimesh
import viser
from numpy.typing import ArrayLike, NDArray

from demo.meshes import mesh_of, object_box, painted
from envs.interactive.interactive_env import InteractiveEnv
from envs.sim.rendering import VisualShape
from language import Scene

Array = NDArray[np.float64]
HIDDEN_BELOW = -4.0  # metres: objects that are not in the scene are parked below this height
MIN_CHANGE = 1e-5  # metres, or of a quaternion's components: smaller changes of pose are not sent
GOLD, CYAN, WHITE = (255, 196, 0), (0, 200, 255), (255, 255, 255)
RAY_LENGTH = 1.2  # metres
RAY_END = 0.06  # metres above the table
CONE_HALF_ANGLE = np.deg2rad(4)
LABEL_HEIGHT = 0.09  # metres above the centre of what is named
OUTLINE = 1.3  # of the referent, in sizes of an object
PATH_COLOR = (90, 120, 220)
PATH_POINTS, PATH_HEIGHT = 12, 0.08  # dashes from stop to stop, and metres by which the way rises between them
DASH = np.array([0.0, 0.0, 0.006])  # metres
MIN_PATH_CHANGE = 0.01  # metres
MOVE_COLORS = {"policy": ((28, 109, 208), 0.006), "expert": ((217, 72, 15), 0.003)}  # RGB, and radius in metres
MOVE_SCALE = 4.0  # length of an arrow, in moves of a control step
HOVER_SIZE, HANDLE_REACH = 0.9, 0.12  # in sizes of an object, and in metres: how near a mouse is
MIN_SHARE, GLOW = 0.05, 0.8  # of the policy's attention that is shown, and the opacity of all of it
RAY_COLOR, CONE_COLOR = (255, 60, 60), (255, 230, 120)


class SceneView:
    """The 3D view of a server. Not thread-safe.

    on_click: called with the body that was clicked. on_drag: called with the body and the place that it was dragged to,
    (3,) metres. scene: of viser. shapes: what is shown. shows_names: of all objects. glows: objects, as much as the
    policy attends to them.
    """

    def __init__(
        self, server: viser.ViserServer, on_click: Callable[[int], None], on_drag: Callable[[int, Array], None]
    ) -> None:
        self.scene: Any = server.scene
        self._on_click, self._on_drag = on_click, on_drag
        self.scene.set_up_direction("+z")
        # Shadows of viser's own are slow without a graphics card, and have stripes; `Scenery` draws soft ones.
        self.scene.configure_default_lights(cast_shadow=False)
        self.scene.configure_environment_map(None)
        self._env: InteractiveEnv | None = None
        self.shows_names, self.glows = False, False
        self._labels: list[Any] = []  # of the objects
        self._discs: list[Any] = []
        self._hover_labels: dict[int, Any] = {}  # by viser's number of the tab
        self._finger: Any = None
        self._path: Any = None
        self._arrows: dict[str, Any] = {}

    def show_env(self, env: InteractiveEnv) -> None:
        """Replaces the content of the view by the meshes of this environment."""
        self.scene.reset()
        self.scene.add_light_ambient("/light", intensity=1.2)
        self._env = env
        self._selectable = set(env.all_bodies)
        self.shapes = env.visual_shapes.shapes()
        self._links = sorted({(shape.body, shape.link) for shape in self.shapes})
        self._frames = [self.scene.add_frame(f"/{body}/{link + 1}", show_axes=False) for body, link in self._links]
        self._meshes: list[Any] = [self._add_mesh(number, shape) for number, shape in enumerate(self.shapes)]
        self._poses = np.full((len(self._links), 7), np.nan)
        self._rings = [self._add_ring(name, color) for name, color in (("referent", GOLD), ("target", CYAN))]
        self._pointed_ring = self._add_ring("pointed", WHITE)
        self._outline = self._add_outline(OUTLINE * env.config.task.object_size)
        self._label = self.scene.add_label("/ring/label", "", visible=False)
        self._ray_nodes: tuple[Any, ...] = ()
        self._drawn_ray = np.zeros(0)
        self._finger = self._path = None
        self._arrows = {}
        self._labels, self._discs = [], []
        self.update_colors()

    def update_colors(self) -> None:
        """Takes over the colours of objects and fittings, which differ from scene to scene."""
        assert self._env is not None
        shapes = self._env.visual_shapes.shapes()
        for mesh, before, shape in zip(self._meshes, self.shapes, shapes, strict=True):
            if mesh is not None and shape.rgba != before.rgba:
                mesh.color = _rgb(shape)
                mesh.opacity = _opacity(shape)
        self.shapes = shapes

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

    def places(self, body: int) -> Array:
        """(N, 3) where the links of a body are, metres."""
        return self._poses[[index for index, link in enumerate(self._links) if link[0] == body], :3]

    def hide(self, bodies: Sequence[int]) -> None:
        """Show these bodies no longer, which never move."""
        for mesh, shape in zip(self._meshes, self.shapes, strict=True):
            if mesh is not None and shape.body in bodies:
                mesh.visible = False

    def add_finger(self, aim: Array) -> Any:
        """Return new handles at (3,) metres, where a person points. They are seen while a mouse is near them."""
        self._finger = self.scene.add_transform_controls(
            "/finger", scale=0.12, disable_rotations=True, position=tuple(aim), depth_test=False, visible=False
        )
        return self._finger

    def highlight(self, objects: tuple[int, ...], positions: Array, gripper: Array, busy: bool) -> None:
        """Puts rings around referent and target, and draws the way ahead.

        Args:
            objects: indices of the referent, and of the target if there is one.
            positions: (K, 3) of the objects, metres.
            gripper: (3,) metres.
            busy: whether the gripper is on its way.
        """
        places = [positions[index] for index in objects if index < len(positions)]
        for ring, place in zip(self._rings, [*places, None, None], strict=False):
            _place(ring, place)
        move(self._outline, places[0] if places else None)
        self._draw_path([gripper, *places] if busy and places else [])

    def _draw_path(self, stops: list[Array]) -> None:
        """Draws the way from stop to stop, (3,) metres each, over what stands between them."""
        if len(stops) < 2:
            if self._path is not None and self._path.visible:
                self._path.visible = False
            return
        points = np.concatenate([_arc(start, end) for start, end in pairwise(stops)])
        if self._path is not None and len(points) == len(self._path.points):
            if not self._path.visible or np.abs(points - self._path.points[:, 0]).max() > MIN_PATH_CHANGE:
                self._path.points = np.stack((points, points + DASH), 1).astype(np.float32)
                self._path.visible = True
            return
        self._path = self.scene.add_line_segments(
            "/path", np.stack((points, points + DASH), 1), colors=np.array(PATH_COLOR), line_width=3.0
        )

    def show_moves(self, gripper: Array, moves: Mapping[str, Array]) -> None:
        """Draw arrows from the gripper (3,), metres, along moves (3,) by name, metres in a control step, lengthened."""
        for name in MOVE_COLORS:
            move_by = moves.get(name)
            arrow = self._arrows.get(name)
            if move_by is None:
                if arrow is not None and arrow.visible:
                    arrow.visible = False
                continue
            points = np.array([[gripper, gripper + MOVE_SCALE * move_by]], np.float32)
            if arrow is None:
                self._arrows[name] = self._add_arrow(name, points)
            else:
                arrow.points, arrow.visible = points, True

    def _add_arrow(self, name: str, points: NDArray[np.float32]) -> Any:
        color, radius = MOVE_COLORS[name]
        head = {"head_radius": 2.2 * radius, "head_length": 5 * radius}
        return self.scene.add_arrows(f"/move/{name}", points, np.array(color), shaft_radius=radius, **head)

    def show_shares(self, shares: Array | None, names: Sequence[str], positions: Array) -> None:
        """Shows names, and how much the policy attends to each of K objects, if that is wanted.

        Args:
            shares: (K,) in [0, 1]; None: there is no policy that attends.
            names: of the objects.
            positions: (K, 3), metres.
        """
        for index in range(max(len(self._labels), len(names) if self.shows_names else 0)):
            if index == len(self._labels):
                self._labels.append(self.scene.add_label(f"/name/{index}", "", visible=False))
            shown = self.shows_names and index < len(names)
            self._show_label(self._labels[index], names[index] if shown else "", positions[index] if shown else None)
        wanted = shares if self.glows and shares is not None and len(shares) == len(positions) else np.zeros(0)
        for index in range(max(len(self._discs), len(wanted))):
            if index == len(self._discs):
                self._discs.append(self._add_disc(index))
            disc, share = self._discs[index], float(wanted[index]) if index < len(wanted) else 0.0
            _place(disc, positions[index] if share >= MIN_SHARE else None)
            if share >= MIN_SHARE and abs(disc.opacity - GLOW * share) > 0.05:
                disc.opacity = GLOW * share

    @staticmethod
    def _show_label(label: Any, text: str, position: Array | None) -> None:
        """Shows a text above a place (3,), metres; hides it for None. Nothing is sent that is as before."""
        if position is not None and label.text != text:
            label.text = text
        move(label, None if position is None else position + [0.0, 0.0, LABEL_HEIGHT])

    def hover(self, client: Any, at: tuple[float, float] | None, scene: Scene, names: Sequence[str]) -> None:
        """Shows a tab the name of what its mouse is at, and the finger's handles if they are near.

        Args:
            client: of the tab.
            at: where the mouse is, in shares of the width and height of its picture; None: elsewhere.
            scene: K objects.
            names: of the objects.
        """
        label = self._hover_labels.get(client.client_id)
        if label is None:
            label = client.scene.add_label("/hover", "", visible=False)
            self._hover_labels = {**self._hover_labels, client.client_id: label}
        ray = None if at is None else _ray_of(client.camera, at)
        index = None if ray is None else _hit(ray, scene.positions, HOVER_SIZE * scene.sizes)
        shown = index is not None and names[index]
        self._show_label(label, shown or "", scene.positions[index] if shown else None)
        if self._finger is not None:
            near = ray is not None and _hit(ray, np.asarray(self._finger.position)[None], np.array([HANDLE_REACH])) == 0
            if self._finger.visible != near:
                self._finger.visible = near

    def show_pointing(self, ray: tuple[Array, Array] | None, probabilities: Array | None, positions: Array) -> None:
        """Draws the finger's ray with a cone, and marks the likeliest object of K with its probability."""
        self._label.visible = probabilities is not None and len(probabilities) == len(positions)
        if probabilities is not None and self._label.visible:
            index = int(probabilities.argmax())
            self._label.text = f"pointed at: {probabilities[index]:.0%}"
            self._label.position = tuple(positions[index] + [0.0, 0.0, LABEL_HEIGHT])
            _place(self._pointed_ring, positions[index])
        else:
            _place(self._pointed_ring, None)
        new_ray = np.zeros(0) if ray is None else np.concatenate(ray)
        if not np.array_equal(new_ray, self._drawn_ray):
            self._drawn_ray = new_ray
            self._draw_ray(ray)

    def _draw_ray(self, ray: tuple[Array, Array] | None) -> None:
        """Draws a ray, origin and direction (3,) each, that ends above the table: it hides nothing there."""
        for node in self._ray_nodes:
            node.remove()
        self._ray_nodes = ()
        if ray is None:
            return
        origin, direction = ray
        down = -float(direction[2])
        length = min(RAY_LENGTH, max((float(origin[2]) - RAY_END) / down, 0.1)) if down > 1e-6 else RAY_LENGTH
        cone = trimesh.creation.cone(radius=length * np.tan(CONE_HALF_ANGLE), height=length, sections=24)
        cone.apply_translation([0, 0, -length])  # apex at the origin, opening towards -z
        cone.apply_transform(trimesh.geometry.align_vectors([0, 0, -1], direction))
        ends = np.array([[origin, origin + length * direction]])
        self._ray_nodes = (
            self.scene.add_line_segments("/ray/line", ends, colors=np.array(RAY_COLOR), line_width=2.0),
            self.scene.add_mesh_simple(
                "/ray/cone", cone.vertices, cone.faces, color=CONE_COLOR, opacity=0.18, position=origin
            ),
        )

    def _add_disc(self, index: int) -> Any:
        disc = trimesh.creation.cylinder(radius=0.07, height=0.001, sections=32)
        return self.scene.add_mesh_simple(
            f"/glow/{index}", disc.vertices, disc.faces, color=GOLD, opacity=0.0, visible=False, cast_shadow=False
        )

    def _add_outline(self, size: float) -> Any:
        """The edges of a cube around the referent, metres."""
        corners = size * (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5)
        edges = [(a, b) for a in corners for b in corners if (a <= b).all() and (a < b).sum() == 1]
        return self.scene.add_line_segments(
            "/outline", np.array(edges), colors=np.array(GOLD), line_width=3.0, visible=False
        )

    def _add_ring(self, name: str, color: tuple[int, int, int]) -> Any:
        ring = trimesh.creation.annulus(r_min=0.045, r_max=0.055, height=0.004, sections=48)
        return self.scene.add_mesh_simple(
            f"/ring/{name}", ring.vertices, ring.faces, color=color, visible=False, cast_shadow=False
        )

    def _add_mesh(self, number: int, shape: VisualShape) -> Any:
        name = f"/{shape.body}/{shape.link + 1}/{number}"
        x, y, z, w = shape.quaternion
        place = {"position": shape.position, "wxyz": (w, x, y, z)}
        if shape.rgba[3] == 0 and shape.mesh is None:  # the cone of a ray, which PyBullet's own renderer draws
            return None
        movable = shape.body in self._selectable
        mesh = (
            object_box(shape.size) if movable and shape.type == "box" else mesh_of(shape.type, shape.size, shape.mesh)
        )
        if shape.mesh is None or movable or shape.rgba[3] < 1:
            flat = shape.type in ("box", "mesh")
            look = {"color": _rgb(shape), "opacity": _opacity(shape), "flat_shading": flat}
            handle = self.scene.add_mesh_simple(name, mesh.vertices, mesh.faces, **look, **place)
        else:  # a white mesh has the colours of its file
            mesh = mesh if shape.rgba[:3] == (1.0, 1.0, 1.0) else painted(mesh, _rgb(shape))
            handle = self.scene.add_mesh_trimesh(name, mesh, **place)
        if movable:
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


def move(node: Any, position: Array | None) -> None:
    """Puts a node at (3,) metres; hides it for None. Nothing is sent that is as before."""
    visible = position is not None
    if node.visible != visible:
        node.visible = visible
    if position is not None and np.abs(np.asarray(node.position) - position).max() > MIN_CHANGE:
        node.position = tuple(position)


def _place(ring: Any, position: Array | None) -> None:
    """Puts a ring around a position (3,), metres, at the bottom of a small object there; hides it for None."""
    bottom = None if position is None else np.array([*position[:2], max(position[2] - 0.02, 0.003)])
    move(ring, bottom)


def _arc(start: Array, end: Array) -> Array:
    """(PATH_POINTS, 3) metres: points of a way that rises between its ends."""
    share = np.linspace(0.05, 1.0, PATH_POINTS)[:, None]
    rise = PATH_HEIGHT * 4 * share * (1 - share) * np.array([0.0, 0.0, 1.0])
    return start + share * (end - start) + rise


def _ray_of(camera: Any, at: tuple[float, float]) -> tuple[Array, Array]:
    """Origin and direction, (3,) each, from a camera through a point of its picture, in shares of width and height."""
    w, x, y, z = camera.wxyz
    half = np.tan(camera.fov / 2)
    ahead = np.array([(2 * at[0] - 1) * half * camera.aspect, (2 * at[1] - 1) * half, 1.0])
    axis = np.array([x, y, z])
    turned = ahead + 2 * np.cross(axis, np.cross(axis, ahead) + w * ahead)
    return np.asarray(camera.position, np.float64), turned / np.linalg.norm(turned)


def _hit(ray: tuple[Array, Array], positions: Array, reach: Array) -> int | None:
    """The nearest of some places (K, 3) that a ray passes within `reach` (K,), metres; None: it passes none."""
    origin, direction = ray
    depth = (positions - origin) @ direction
    away = np.linalg.norm(positions - origin - depth[:, None] * direction, axis=1)
    near = np.flatnonzero((away < reach) & (depth > 0))
    return int(near[depth[near].argmin()]) if len(near) else None


def _rgb(shape: VisualShape) -> tuple[int, int, int]:
    red, green, blue = (round(255 * share) for share in shape.rgba[:3])
    return red, green, blue


def _opacity(shape: VisualShape) -> float | None:
    return None if shape.rgba[3] >= 1 else max(shape.rgba[3], 0.05)

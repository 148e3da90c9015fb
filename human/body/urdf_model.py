"""The URDF of a person made of simple shapes, and its meshes, for given proportions.

The URDF's origin lies between the feet on the floor; x is where the person faces, y their left, z up; metres. At zero
angles both arms hang down, thumbs to the front. The right hand's index finger is stretched, its other fingers are
curled.

Links that other modules use by name: `r_hand` (frame at the wrist), `r_index1`, `r_index2`, `r_index3_endeffector`
(frame at the fingertip), `eyes` (frame between them) and `cone` (drawn along the finger).

The collision shapes serve programs that load the URDF elsewhere; here the person does not collide
(`human/body/pybullet_body.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

Ring = tuple[float, float, float, float]  # height, semi-axis along x, semi-axis along y, x of the centre; metres
Point = tuple[float, float, float]
SEGMENTS = 20  # vertices of a ring
EFFORT = 100  # N m, of every joint: URDF requires a value, but no motor of the person is used
CONE_LENGTH, CONE_RADIUS = 0.35, 0.04  # metres, of the cone that is drawn along the finger
SIDES = {"r": -1, "l": 1}  # sign of an arm's y coordinate
EYES = (0.086, 0.0, 0.14)  # in the head's frame
HEAD_PITCH = 0.4  # radians; the person looks down at the table

# Joint, axis of the right arm, range in degrees. The ranges are those of healthy adults in "Joint Motion: Method of
# Measuring and Recording", American Academy of Orthopaedic Surgeons, 1965, except for adduction, which is smaller so
# that the arm stays out of the chest.
ARM = (
    ("shoulder_flexion", (0, -1, 0), (-60, 180)),  # forward is positive
    ("shoulder_abduction", (-1, 0, 0), (-45, 180)),  # away from the body
    ("shoulder_rotation", (0, 0, 1), (-90, 70)),  # inward
    ("elbow_flexion", (0, -1, 0), (0, 150)),
    ("forearm_pronation", (0, 0, 1), (-80, 80)),  # the thumb inward
    ("wrist_flexion", (1, 0, 0), (-70, 80)),  # towards the palm
    ("wrist_deviation", (0, -1, 0), (-30, 20)),  # towards the thumb
)
KNUCKLE, MIDDLE_JOINT = (-45, 90), (0, 100)  # of the index finger, in degrees towards the palm; same source

# Meshes of a person 1.75 m tall, as rings. Heights of the torso and the legs are measured from the floor, those of the
# head from its joint.
RINGS: dict[str, list[Ring]] = {
    "shirt": [
        (0.9, 0.1, 0.158, 0), (0.91, 0.112, 0.166, 0), (1.0, 0.106, 0.152, 0),
        (1.1, 0.104, 0.148, 0), (1.22, 0.115, 0.165, 0), (1.32, 0.118, 0.178, 0),
        (1.39, 0.104, 0.186, -0.005), (1.43, 0.09, 0.183, -0.01), (1.452, 0.076, 0.155, -0.014),
        (1.475, 0.066, 0.105, -0.015), (1.492, 0.06, 0.066, -0.012),
    ],
    "pelvis": [
        (0.76, 0.03, 0.05, 0), (0.79, 0.085, 0.12, 0), (0.84, 0.104, 0.158, 0),
        (0.9, 0.104, 0.16, 0), (0.95, 0.1, 0.15, 0),
    ],
    "leg": [
        (0.05, 0.048, 0.048, -0.01), (0.06, 0.054, 0.052, -0.01), (0.3, 0.064, 0.06, -0.012),
        (0.47, 0.062, 0.06, 0.004), (0.7, 0.082, 0.078, 0), (0.85, 0.092, 0.082, 0),
    ],
    "shoe": [
        (0, 0.125, 0.042, 0.055), (0.01, 0.138, 0.05, 0.055), (0.035, 0.132, 0.048, 0.055),
        (0.06, 0.1, 0.044, 0.028), (0.09, 0.06, 0.042, -0.008), (0.1, 0.05, 0.038, -0.01),
    ],
    "neck": [(1.42, 0.06, 0.062, -0.012), (1.49, 0.054, 0.054, -0.004), (1.57, 0.052, 0.052, 0.004)],
    "face": [
        (0.012, 0.02, 0.018, 0.052), (0.02, 0.034, 0.032, 0.048), (0.045, 0.062, 0.05, 0.026),
        (0.085, 0.084, 0.066, 0.01), (0.14, 0.095, 0.074, 0), (0.19, 0.093, 0.073, -0.002),
        (0.225, 0.074, 0.06, -0.004), (0.245, 0.04, 0.034, -0.004),
    ],
    "hair": [
        (0.05, 0.05, 0.045, -0.045), (0.08, 0.074, 0.066, -0.03), (0.13, 0.087, 0.08, -0.022),
        (0.18, 0.096, 0.081, -0.012), (0.2, 0.103, 0.08, -0.001), (0.23, 0.086, 0.07, -0.002),
        (0.255, 0.055, 0.046, -0.004), (0.262, 0.02, 0.016, -0.004),
    ],
    "nose": [(0.095, 0.006, 0.012, 0.1), (0.1, 0.013, 0.014, 0.1), (0.145, 0.006, 0.007, 0.09)],
    "ear": [(0.095, 0.008, 0.006, 0), (0.11, 0.015, 0.01, -0.002), (0.14, 0.018, 0.011, -0.005),
            (0.155, 0.01, 0.007, -0.005)],
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Measures of a person.

    height: metres. Lengths and widths are shares of the height, from Drillis and Contini, "Body Segment Parameters",
    1966. girth: factor of the limbs' thickness. mass: kg. Colours are RGB in [0, 1].
    """

    height: float = 1.75
    shoulder_height: float = 0.806  # height and width are those of the joints, a little less than the bones' ends
    shoulder_width: float = 0.222
    upper_arm: float = 0.186
    forearm: float = 0.146
    hand: float = 0.108  # from the wrist to the fingertip
    torso_width: float = 0.195
    girth: float = 1.0
    mass: float = 70.0
    skin: tuple[float, float, float] = (0.87, 0.67, 0.54)
    shirt: tuple[float, float, float] = (0.25, 0.42, 0.62)
    trousers: tuple[float, float, float] = (0.2, 0.21, 0.26)
    shoes: tuple[float, float, float] = (0.12, 0.1, 0.09)
    hair: tuple[float, float, float] = (0.22, 0.14, 0.09)


@dataclass(frozen=True)
class BodyShape:
    """One shape of a link.

    geometry: its URDF element. color: RGB in [0, 1]; None: a collision shape, which is not drawn.
    place, angles: its pose in the link's frame, metres and radians (roll, pitch, yaw).
    """

    geometry: str
    color: tuple[float, float, float] | None
    place: Point = (0, 0, 0)
    angles: Point = (0, 0, 0)


@dataclass(frozen=True)
class Link:
    """A link and the joint that carries it.

    mass: kg. radius: metres, of a solid sphere with about the same inertia.
    parts: its shapes, in the link's frame.
    parent: the link that carries it through `joint`; None: the base.
    place, angles: pose of the joint in the parent's frame, metres and radians.
    axis: of a revolute joint; None: a fixed joint. limits: degrees.
    """

    name: str
    mass: float
    radius: float
    parts: tuple[BodyShape, ...] = ()
    parent: str | None = None
    place: Point = (0, 0, 0)
    angles: Point = (0, 0, 0)
    joint: str = ""
    axis: Point | None = None
    limits: tuple[float, float] = (0, 0)


def urdf(proportions: Proportions | None = None) -> str:
    """Return the URDF's text. It refers to meshes that `write` saves in the same folder."""
    links = _links(proportions or Proportions())
    rows = [row for link in links for row in (link_xml(link), joint_xml(link)) if row]
    return "\n".join(['<?xml version="1.0"?>', '<robot name="human">', *rows, "</robot>", ""])


def write(folder: Path, proportions: Proportions | None = None) -> Path:
    """Write human.urdf and its meshes into an existing folder; return the URDF's path."""
    proportions = proportions or Proportions()
    for name, rings in meshes(proportions).items():
        (folder / f"{name}.obj").write_text(loft(rings))
    path = folder / "human.urdf"
    path.write_text(urdf(proportions))
    return path


# ---- Links


def _links(p: Proportions) -> list[Link]:
    return [_trunk(p), *_head(p), *_arm(p, "l"), *_arm(p, "r"), *_index(p)]


def _trunk(p: Proportions) -> Link:
    s, hip = p.height / 1.75, 0.088 * p.height / 1.75
    parts = [mesh("shirt", p.shirt), mesh("pelvis", p.trousers), mesh("neck", p.skin)]
    for y in (-hip, hip):
        parts += [mesh("leg", p.trousers, (0, y, 0)), mesh("shoe", p.shoes, (0, y * 1.1, 0))]
        parts.append(rod((0, y, 0.08 * s), (0, y, 0.8 * s), 0.07 * s))
    width = p.torso_width * p.height
    parts.append(box((0.17 * s, 0.9 * width, 0.62 * s), (0, 0, 1.14 * s)))
    return Link("trunk", 0.8 * p.mass, 0.3, tuple(parts))


def _head(p: Proportions) -> list[Link]:
    s = p.height / 1.75
    dark, white, lips = (0.1, 0.07, 0.05), (0.95, 0.95, 0.95), (0.65, 0.35, 0.32)
    parts = [mesh("face", p.skin), mesh("hair", p.hair), mesh("nose", p.skin)]
    for y in (-0.031, 0.031):
        parts.append(ball(0.013 * s, (0.078 * s, y * s, EYES[2] * s), white))
        parts.append(ball(0.0075 * s, (0.0855 * s, y * s, EYES[2] * s), dark))
        parts.append(box((0.012 * s, 0.032 * s, 0.006 * s), (0.084 * s, y * s, 0.163 * s), p.hair))
        parts.append(mesh("ear", p.skin, (0, 2.35 * y * s, 0)))
    parts.append(box((0.01 * s, 0.042 * s, 0.008 * s), (0.084 * s, 0, 0.062 * s), lips))
    parts.append(ball(0.105 * s, (0, 0, 0.135 * s)))
    head = Link("head", 0.08 * p.mass, 0.1, tuple(parts), "trunk", (0.005, 0, 1.505 * s), (0, HEAD_PITCH, 0), "neck")
    eyes = (EYES[0] * s, EYES[1] * s, EYES[2] * s)
    return [head, Link("eyes", 0.01, 0.02, (), "head", eyes, joint="eyes_mount")]


def _arm(p: Proportions, side: str) -> list[Link]:
    """Return the links from shoulder to hand. Links that only carry a joint are small and have no shape."""
    sign = SIDES[side]
    upper, fore = p.upper_arm * p.height, p.forearm * p.height
    shoulder = (-0.005, sign * p.shoulder_width * p.height / 2, p.shoulder_height * p.height)
    shapes = {
        "upper_arm": (0.028 * p.mass, 0.12, _upper_arm(p, upper)),
        "elbow": (0.1, 0.05, ()),
        "forearm": (0.016 * p.mass, 0.1, _forearm(p, fore)),
        "hand": (0.006 * p.mass, 0.06, _hand(p, side)),
    }
    names = ("shoulder1", "shoulder2", "upper_arm", "elbow", "forearm", "wrist", "hand")
    places = (shoulder, (0, 0, 0), (0, 0, 0), (0, 0, -upper), (0, 0, 0), (0, 0, -fore), (0, 0, 0))
    links, parent = [], "trunk"
    for name, place, (joint, (x, y, z), limits) in zip(names, places, ARM, strict=True):
        mass, radius, parts = shapes.get(name, (0.1, 0.05, ()))
        axis = (-sign * x, y, -sign * z)  # mirrored for the left arm
        name, joint = f"{side}_{name}", f"{side}_{joint}"
        links.append(Link(name, mass, radius, parts, parent, place, (0, 0, 0), joint, axis, limits))
        parent = name
    return links


def _upper_arm(p: Proportions, length: float) -> tuple[BodyShape, ...]:
    bone = rod((0, 0, 0), (0, 0, -length), 0.046 * p.girth)
    return (mesh("sleeve", p.shirt), mesh("upper_arm", p.skin), bone)


def _forearm(p: Proportions, length: float) -> tuple[BodyShape, ...]:
    return (mesh("forearm", p.skin), rod((0, 0, 0), (0, 0, -length), 0.036 * p.girth))


def _hand(p: Proportions, side: str) -> tuple[BodyShape, ...]:
    """Return palm, thumb and fingers, x towards the thumb.

    The right hand lacks its index finger (`_index`), and its other fingers are curled.
    """
    h, palm = p.hand * p.height / 0.189, -SIDES[side]  # palm: the sign of y that it faces
    rows = [(x, _curled() if side == "r" else _relaxed(shortening)) for x, shortening in _knuckles(side)]
    paths = [([(x, y, z) for y, z in path], 0.0088) for x, path in rows]
    paths.append(([(0.024, 0.008, -0.02), (0.047, 0.02, -0.05), (0.047, 0.028, -0.085)], 0.0105))
    parts = [mesh("palm", p.skin), box((0.08 * h, 0.034 * h, 0.1 * h), (0, 0, -0.05 * h))]
    for path, radius in paths:
        points = [(h * x, h * palm * y, h * z) for x, y, z in path]
        parts += [rod(a, b, radius * h, p.skin) for a, b in pairwise(points)]
    return tuple(parts)


def _knuckles(side: str) -> list[tuple[float, float]]:
    """Return (x, shortening) of the middle, ring and small finger, and of the left index finger."""
    fingers = [(0.009, 0.0), (-0.013, 0.004), (-0.033, 0.017)]
    return fingers if side == "r" else [(0.031, 0.008), *fingers]


def _curled() -> list[tuple[float, float]]:
    """Return (offset towards the palm, z) of a curled finger's joints, from the knuckle on."""
    return [(0.002, -0.092), (0.04, -0.108), (0.046, -0.078), (0.024, -0.07)]


def _relaxed(shortening: float) -> list[tuple[float, float]]:
    """Return the same of a relaxed finger. shortening: metres, for a hand of standard size."""
    return [(0.0, -0.092), (0.01, -0.134 + shortening / 2), (0.026, -0.158 + shortening), (0.04, -0.172 + shortening)]


def _index(p: Proportions) -> list[Link]:
    """Return the right index finger along the hand's -z (two joints and the fingertip) and the cone along it."""
    h = p.hand * p.height / 0.189
    axis, thick = (1, 0, 0), 0.0092 * h
    knuckle, middle, tip = (0.03 * h, 0.002 * h, -0.092 * h), (0, 0, -0.046 * h), (0, 0, -0.051 * h)
    end = (0.0, 0.0, tip[2] + 0.9 * thick)
    near = (rod((0, 0, 0), middle, thick, p.skin), rod((0, 0, 0), middle, thick))
    far = (rod((0, 0, 0), end, 0.9 * thick, p.skin), rod((0, 0, 0), end, 0.9 * thick))
    white = (1.0, 1.0, 1.0)
    unrotated = (0, 0, 0)
    return [
        Link("r_index1", 0.03, 0.03, near, "r_hand", knuckle, unrotated, "r_index_knuckle", axis, KNUCKLE),
        Link("r_index2", 0.02, 0.03, far, "r_index1", middle, unrotated, "r_index_middle", axis, MIDDLE_JOINT),
        Link("r_index3_endeffector", 0.001, 0.02, (), "r_index2", tip, joint="r_index_tip"),
        Link("cone", 0.001, 0.02, (mesh("cone", white),), "r_index3_endeffector", joint="cone_mount"),
    ]


# ---- Meshes


def meshes(p: Proportions) -> dict[str, list[Ring]]:
    """Return the rings of every mesh, by the stem of its file name."""
    s, w = p.height / 1.75, p.torso_width / 0.2
    widths = {"shirt": w, "pelvis": w}
    scaled = {
        name: [(s * z, s * a, s * widths.get(name, 1) * b, s * x) for z, a, b, x in rings]
        for name, rings in RINGS.items()
    }
    cone: list[Ring] = [(-CONE_LENGTH, CONE_RADIUS, CONE_RADIUS, 0), (0, 0.001, 0.001, 0)]
    return scaled | _arm_meshes(p) | {"cone": cone}


def _arm_meshes(p: Proportions) -> dict[str, list[Ring]]:
    s, upper, fore = p.height / 1.75 * p.girth, p.height * p.upper_arm, p.height * p.forearm
    h = p.height * p.hand / 0.189
    return {
        "sleeve": [
            (-0.56 * upper, 0.05 * s, 0.049 * s, 0), (-0.54 * upper, 0.055 * s, 0.053 * s, 0),
            (-0.25 * upper, 0.059 * s, 0.056 * s, 0), (0, 0.062 * s, 0.057 * s, 0), (0.03 * s, 0.05 * s, 0.046 * s, 0),
            (0.045 * s, 0.03 * s, 0.026 * s, 0), (0.05 * s, 0.008 * s, 0.008 * s, 0),
        ],
        "upper_arm": [
            (-upper - 0.036 * s, 0.014 * s, 0.014 * s, 0), (-upper - 0.024 * s, 0.03 * s, 0.03 * s, 0),
            (-upper, 0.039 * s, 0.039 * s, 0), (-0.8 * upper, 0.041 * s, 0.041 * s, 0),
            (-0.5 * upper, 0.047 * s, 0.046 * s, 0),
        ],
        "forearm": [
            (-fore - 0.01, 0.022 * s, 0.018 * s, 0), (-fore, 0.027 * s, 0.021 * s, 0),
            (-0.8 * fore, 0.028 * s, 0.024 * s, 0), (-0.3 * fore, 0.043 * s, 0.041 * s, 0),
            (-0.08 * fore, 0.041 * s, 0.04 * s, 0), (0.02 * s, 0.033 * s, 0.033 * s, 0),
            (0.036 * s, 0.012 * s, 0.012 * s, 0),
        ],
        "palm": [
            (-0.103 * h, 0.03 * h, 0.008 * h, -0.002), (-0.095 * h, 0.041 * h, 0.013 * h, -0.002),
            (-0.06 * h, 0.042 * h, 0.015 * h, 0), (-0.025 * h, 0.034 * h, 0.017 * h, 0),
            (0, 0.026 * h, 0.019 * h, 0), (0.015 * h, 0.022 * h, 0.016 * h, 0),
        ],
    }  # fmt: skip


# ---- Shapes of links


def mesh(name: str, color: tuple[float, float, float], place: Point = (0, 0, 0)) -> BodyShape:
    """Return the mesh of the file `name`.obj."""
    return BodyShape(f'<mesh filename="{name}.obj"/>', color, place)


def ball(radius: float, place: Point, color: tuple[float, float, float] | None = None) -> BodyShape:
    """Return a sphere."""
    return BodyShape(f'<sphere radius="{radius:.5f}"/>', color, place)


def rod(start: Point, end: Point, radius: float, color: tuple[float, float, float] | None = None) -> BodyShape:
    """Return a capsule whose hemispheres are centred on start and end."""
    x, y, z = (b - a for a, b in zip(start, end, strict=True))
    middle = tuple((a + b) / 2 for a, b in zip(start, end, strict=True))
    angles = (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))
    geometry = f'<capsule radius="{radius:.5f}" length="{math.hypot(x, y, z):.5f}"/>'
    return BodyShape(geometry, color, middle, angles)  # type: ignore[arg-type]


def box(size: Point, place: Point, color: tuple[float, float, float] | None = None) -> BodyShape:
    """Return a box with these side lengths, centred on `place`."""
    return BodyShape('<box size="{:.5f} {:.5f} {:.5f}"/>'.format(*size), color, place)


# ---- OBJ and URDF text


def loft(rings: Sequence[Ring]) -> str:
    """Return the text of an OBJ file: the surface through elliptic rings, lowest first, closed at both ends."""
    turns = [2 * math.pi * k / SEGMENTS for k in range(SEGMENTS)]
    rows = [f"v {x + a * math.cos(t):.5f} {b * math.sin(t):.5f} {z:.5f}" for z, a, b, x in rings for t in turns]
    rows += [f"v {x:.5f} 0 {z:.5f}" for z, _, _, x in (rings[0], rings[-1])]
    for i, (_, a, b, _) in enumerate(rings):
        below, above = rings[max(i - 1, 0)], rings[min(i + 1, len(rings) - 1)]
        slope = (below[1] - above[1]) / max(above[0] - below[0], 1e-6)
        rows += [_normal(math.cos(t) / a, math.sin(t) / b, slope / max(a, b)) for t in turns]
    rows += ["vn 0 0 -1", "vn 0 0 1"]
    return "\n".join(rows + _faces(len(rings)) + [""])


def _normal(x: float, y: float, z: float) -> str:
    length = math.hypot(x, y, z)
    return f"vn {x / length:.4f} {y / length:.4f} {z / length:.4f}"


def _faces(rings: int) -> list[str]:
    """Return the triangles, numbered from 1: the sides, counter-clockwise seen from outside, then the two ends."""
    triangles = []
    last = rings * SEGMENTS
    for k in range(SEGMENTS):
        right = (k + 1) % SEGMENTS
        for base in range(0, last - SEGMENTS, SEGMENTS):
            a, b, c, d = base + k, base + right, base + SEGMENTS + k, base + SEGMENTS + right
            triangles += [(a, b, d), (a, d, c)]
        top = last - SEGMENTS
        triangles += [(right, k, last), (top + k, top + right, last + 1)]
    return ["f " + " ".join(f"{i + 1}//{i + 1}" for i in triangle) for triangle in triangles]


def link_xml(link: Link) -> str:
    """Return the <link> element. Parts with a colour are visual shapes; parts without are collision shapes."""
    inertia = 0.4 * link.mass * link.radius**2
    center = "0 0 1.0" if link.parent is None else "0 0 0"
    rows = [
        f'<link name="{link.name}">',
        f'  <inertial><origin xyz="{center}"/><mass value="{link.mass:g}"/>'
        f'<inertia ixx="{inertia:.3g}" iyy="{inertia:.3g}" izz="{inertia:.3g}" ixy="0" ixz="0" iyz="0"/></inertial>',
    ]
    for i, part in enumerate(link.parts):
        kind, material = "collision", ""
        if part.color is not None:
            opacity = 0.4 if link.name == "cone" else 1
            color = " ".join(f"{channel:g}" for channel in part.color)
            kind = "visual"
            material = f'<material name="{link.name}{i}"><color rgba="{color} {opacity}"/></material>'
        rows.append(
            f"  <{kind}>{_origin(part.place, part.angles)}<geometry>{part.geometry}</geometry>{material}</{kind}>"
        )
    return "\n".join([*rows, "</link>"])


def joint_xml(link: Link) -> str:
    """Return the <joint> element that carries the link; "" for the base."""
    if link.parent is None:
        return ""
    kind = "fixed" if link.axis is None else "revolute"
    inner = f'{_origin(link.place, link.angles)}<parent link="{link.parent}"/><child link="{link.name}"/>'
    if link.axis is not None:
        low, high = (math.radians(limit) for limit in link.limits)
        inner += '<axis xyz="{:g} {:g} {:g}"/>'.format(*link.axis)
        inner += f'<limit lower="{low:.5f}" upper="{high:.5f}" effort="{EFFORT}" velocity="20"/>'
    return f'<joint name="{link.joint}" type="{kind}">{inner}</joint>'


def _origin(place: Point, angles: Point) -> str:
    return '<origin xyz="{:.5f} {:.5f} {:.5f}" rpy="{:.5f} {:.5f} {:.5f}"/>'.format(*place, *angles)

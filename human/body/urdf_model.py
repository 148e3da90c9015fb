"""The URDF of a person made of simple shapes.

The URDF's origin lies between the feet on the floor; x is where the person faces, y their left, z up; metres. At zero
angles both arms hang down, thumbs to the front. The right hand's index finger is stretched, its other fingers are
curled.

Links that other modules use by name: `r_hand` (frame at the wrist), `r_index1`, `r_index2`, `r_index3_endeffector`
(frame at the fingertip), `eyes` (frame between them) and `cone` (drawn along the finger).

The collision shapes serve programs that load the URDF elsewhere; here the person does not collide
(`human/body/pybullet_body.py`).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from human.body.meshes import Proportions, meshes
from human.body.shapes import Part, ball, box, loft, mesh, rod
from human.body.urdf_xml import Link, joint_xml, link_xml

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


def urdf(proportions: Proportions | None = None) -> str:
    """Returns the URDF's text. It refers to meshes that `write` saves in the same folder."""
    links = _links(proportions or Proportions())
    rows = [row for link in links for row in (link_xml(link), joint_xml(link)) if row]
    return "\n".join(['<?xml version="1.0"?>', '<robot name="human">', *rows, "</robot>", ""])


def write(folder: Path, proportions: Proportions | None = None) -> Path:
    """Writes human.urdf and its meshes into an existing folder. Returns the URDF's path."""
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
    """Returns the links from shoulder to hand. Links that only carry a joint are small and have no shape."""
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


def _upper_arm(p: Proportions, length: float) -> tuple[Part, ...]:
    bone = rod((0, 0, 0), (0, 0, -length), 0.046 * p.girth)
    return (mesh("sleeve", p.shirt), mesh("upper_arm", p.skin), bone)


def _forearm(p: Proportions, length: float) -> tuple[Part, ...]:
    return (mesh("forearm", p.skin), rod((0, 0, 0), (0, 0, -length), 0.036 * p.girth))


def _hand(p: Proportions, side: str) -> tuple[Part, ...]:
    """Returns palm, thumb and fingers, x towards the thumb.

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
    """Returns (x, shortening) of the middle, ring and small finger, and of the left index finger."""
    fingers = [(0.009, 0.0), (-0.013, 0.004), (-0.033, 0.017)]
    return fingers if side == "r" else [(0.031, 0.008), *fingers]


def _curled() -> list[tuple[float, float]]:
    """Returns (offset towards the palm, z) of a curled finger's joints, from the knuckle on."""
    return [(0.002, -0.092), (0.04, -0.108), (0.046, -0.078), (0.024, -0.07)]


def _relaxed(shortening: float) -> list[tuple[float, float]]:
    """Returns the same of a relaxed finger. shortening: metres, for a hand of standard size."""
    return [(0.0, -0.092), (0.01, -0.134 + shortening / 2), (0.026, -0.158 + shortening), (0.04, -0.172 + shortening)]


def _index(p: Proportions) -> list[Link]:
    """Returns the right index finger along the hand's -z (two joints and the fingertip) and the cone along it."""
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

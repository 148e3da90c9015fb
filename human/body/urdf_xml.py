"""Links and joints as URDF elements."""

from __future__ import annotations

import math
from dataclasses import dataclass

from human.body.shapes import Part, Point

EFFORT = 100  # N m, of every joint: URDF requires a value, but no motor of the person is used


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
    parts: tuple[Part, ...] = ()
    parent: str | None = None
    place: Point = (0, 0, 0)
    angles: Point = (0, 0, 0)
    joint: str = ""
    axis: Point | None = None
    limits: tuple[float, float] = (0, 0)


def link_xml(link: Link) -> str:
    """Returns the <link> element. Parts with a colour are visual shapes; parts without are collision shapes."""
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
    """Returns the <joint> element that carries the link; "" for the base."""
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

"""URDFs of small arms, written here: six joints, links of boxes, and a hand that tests choose."""

from dataclasses import dataclass, replace

INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


@dataclass(frozen=True)
class Part:
    """A joint with the link that it moves: a box along z, metres."""

    joint: str
    link: str
    parent: str
    origin: str = "0 0 0"
    axis: str | None = "0 0 1"
    kind: str = "revolute"
    limit: str = 'lower="-2.8" upper="2.8" effort="150" velocity="2"'
    box: str = "0.06 0.06 0.1"
    at: str = "0 0 0.05"
    mass: float | None = 1.0
    shape: str | None = None  # XML of a geometry in place of the box
    more: str = ""  # XML within the joint

    def text(self):
        limit = f"<limit {self.limit}/>" if self.limit else ""
        axis = f'<axis xyz="{self.axis}"/>' if self.axis else ""
        joint = f'<joint name="{self.joint}" type="{self.kind}"><origin xyz="{self.origin}"/>{axis}{limit}{self.more}'
        return f'{joint}<parent link="{self.parent}"/><child link="{self.link}"/></joint>' + self.link_text()

    def link_text(self):
        mass = self.mass
        inertial = "" if mass is None else f'<inertial><mass value="{mass}"/>{INERTIA}</inertial>'
        geometry = f'<geometry><box size="{self.box}"/></geometry>' if self.shape is None else self.shape
        collision = f'<collision><origin xyz="{self.at}"/>{geometry}</collision>' if geometry else ""
        return f'<link name="{self.link}">{inertial}{collision}</link>'


ARM = (
    Part("turn", "column", "base", "0 0 0.05", box="0.1 0.1 0.15", at="0 0 0.1", mass=3.0),
    Part("lift", "upper", "column", "0 0 0.2", "0 1 0", box="0.06 0.06 0.36", at="0 0 0.18", mass=2.0),
    Part("bend", "lower", "upper", "0 0 0.36", "0 1 0", box="0.05 0.05 0.3", at="0 0 0.15"),
    Part("roll", "forearm", "lower", "0 0 0.3", "0 0 1", box="0.04 0.04 0.04", at="0 0 0.02", mass=0.5),
    Part("nod", "wrist", "forearm", "0 0 0.06", "0 1 0", box="0.04 0.04 0.04", at="0 0 0.02", mass=0.3),
    Part("twist", "flange", "wrist", "0 0 0.06", "0 0 1", box="0.05 0.05 0.02", at="0 0 0.01", mass=0.2),
)
LEFT = Part(
    "left",
    "pad_left",
    "flange",
    "0 0.005 0.02",
    "0 1 0",
    "prismatic",
    'lower="0" upper="0.04" effort="20" velocity="0.1"',
    box="0.02 0.01 0.06",
    at="0 0 0.03",
    mass=0.05,
)
RIGHT = replace(LEFT, joint="right", link="pad_right", origin="0 -0.005 0.02", axis="0 -1 0")
BASE = '<link name="base"><inertial><mass value="5"/>' + INERTIA + "</inertial></link>"


def urdf_of(parts=ARM, base=BASE, more=""):
    """The text of a URDF. more: XML at its end."""
    return f'<robot name="small">{base}{"".join(part.text() for part in parts)}{more}</robot>'


def changed(parts=ARM, **changes):
    """The parts with other fields in some of them: changed(turn={"kind": "continuous"})."""
    return tuple(replace(part, **changes.get(part.joint, {})) for part in parts)


def written(folder, text, name="small.urdf"):
    """A file with this text, or these bytes."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path

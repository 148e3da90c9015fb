"""What Bullet cannot use in a URDF, or takes for something else, and what is put in its place.

Each repair is told in a sentence. A URDF that has everything is not changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from envs.sim.robot_import.tree import SLIDING, Joint, URDFArm, URDFTree, unit
from envs.sim.urdf_file import URDFError, name_of

Array = NDArray[np.float64]
DENSITY = 400.0  # kg per cubic metre of the box around a link
LIGHTEST, HEAVIEST = 0.01, 30.0  # kg of a link whose mass is guessed
FRAME_MASS = 1e-3  # kg of a link without shapes
STRONG = 2.0  # by which a guessed effort is over the torque that holds the stretched arm
LEAST_EFFORT = 1.0  # N m
PAYLOAD = 0.5  # kg that the arm carries besides itself
FINGER_FORCE = 20.0  # N
GRAVITY, TIME_STEP = 9.81, 1 / 240
DAMPED = 0.5  # share of its speed that a joint may lose by damping in a physics step
MOST_TURN = 4 * math.pi  # radians: wider limits are those of a joint without limits
MOST_SLIDE = 2.0  # metres
ROOT = "deixis_root"  # the link that turns the robot towards the table
Points = Callable[[Sequence[str]], Array]  # links -> (P, 3) corners of their shapes in the root's frame


@dataclass(frozen=True, kw_only=True)
class Slide:
    """How a finger opens.

    Attributes:
        joint: that slides.
        way: 1 or -1, the direction along its axis in which it opens.
        shut: the joint's value where both fingers touch, metres.
        range: metres that it opens.
        crossed: whether its limits lead it through the other finger.
    """

    joint: Joint
    way: float
    shut: float
    range: float
    crossed: bool


class Repairs:
    """Mends the tree's elements in place, and notes in sentences what it did.

    Args:
        tree: of the URDF.
        arm: whose joints get what they need.
    """

    def __init__(self, tree: URDFTree, arm: URDFArm) -> None:
        self._tree, self._arm = tree, arm
        self.notes: list[str] = []

    def joints(self) -> None:
        """Give the arm's joints axes of length 1 and limits, and fix what is neither arm nor finger."""
        for joint in self._arm.joints:
            _set(joint, "axis", xyz=_text(unit(joint)))
            low, high = limits(joint)
            if not (joint.low == low and joint.high == high):
                self._limit(joint, low, high)
        odd = [each for each in self._tree.joints.values() if each.kind in ("floating", "planar")]
        for each in odd:
            each.element.set("type", "fixed")
            self.notes.append(f"joint {each.name} is {each.kind}: it was fixed, since the robot stands on the table.")
        followers = [joint.name for joint in self._arm.joints if joint.leader]
        for name in followers:
            self.notes.append(f"joint {name} mimics another one: it moves by a motor of its own here.")

    def _limit(self, joint: Joint, low: float, high: float) -> None:
        if joint.kind == SLIDING:
            raise URDFError(
                f"has joint {joint.name} that slides without limits low < high within {MOST_SLIDE:g} m: write them "
                "into its <limit>"
            )
        joint.element.set("type", "revolute")
        _set(joint, "limit", lower=repr(low), upper=repr(high))

    def hold(self, slides: Sequence[Joint]) -> None:
        """Fix joints that slide in the middle of their range."""
        for joint in slides:
            middle = (joint.low + joint.high) / 2
            joint.origin[:3, 3] += joint.origin[:3, :3] @ unit(joint) * middle
            _set_origin(joint.element, joint.origin[:3, 3])
            joint.element.set("type", "fixed")
            self.notes.append(
                f"{joint.name}, which slides at {joint.velocity:g} m/s, holds the arm back: it was fixed at "
                f"{middle:g} m; joints=[...] lets it move."
            )

    def turn_freely(self, rest: Mapping[str, float]) -> None:
        """Give joints without limits half a turn each way from where they are at rest, radians by name."""
        free = [joint for joint in self._arm.joints if is_free(joint)]
        for joint in free:
            self._limit(joint, round(rest[joint.name] - math.pi, 4), round(rest[joint.name] + math.pi, 4))
        if free:
            names = ", ".join(joint.name for joint in free)
            self.notes.append(f"joints without limits ({names}) got half a turn each way from the rest pose.")

    def shapes(self) -> None:
        """Take the visual shapes for collision shapes where the robot has none."""
        links = self._tree.links.values()
        if any(link.find("collision") is not None for link in links):
            return
        seen = [(link, visual) for link in links for visual in link.findall("visual")]
        for link, visual in seen:
            collision = SubElement(link, "collision")
            collision.extend([part for part in visual if part.tag in ("origin", "geometry")])
        if seen:
            self.notes.append("the URDF has no collision shapes: those that are seen were taken.")

    def masses(self, points: Points) -> None:
        """Give what the joints move, and has no mass, that of a box around it.

        Bullet gives 1 kg to every link without a mass: frames get next to nothing. Where the URDF has efforts, the
        guessed masses are not more than they hold.
        """
        moved, frames = set(self._tree.below(self._arm.joints[0].child)), self._tree.frames()
        guessed: list[str] = []
        for name in self._tree.below(self._tree.root):
            link = self._tree.links[name]
            if link.find("inertial") is not None and (name not in moved or mass_of(link) > 0):
                continue
            for old in link.findall("inertial"):
                link.remove(old)
            group = [each for each in self._tree.rigid_with(name) if mass_of(self._tree.links[each]) > FRAME_MASS]
            corners = points(self._tree.rigid(name)) if not group else np.zeros((0, 3))
            link.insert(0, _inertial(corners, frames[name]))
            guessed += [name] * (name in moved and len(corners) > 0)
        if guessed:
            self._lighten(guessed, points)
            total = sum(mass_of(self._tree.links[name]) for name in guessed)
            self.notes.append(
                f"{len(guessed)} links have no mass ({', '.join(guessed[:3])}{', ...' if len(guessed) > 3 else ''}): "
                f"they got {total:.1f} kg together, from their sizes."
            )

    def _lighten(self, guessed: Sequence[str], points: Points) -> None:
        """Make guessed masses so small that the efforts of the URDF hold them."""
        loads = [(joint, STRONG * self._load(joint, points)) for joint in self._arm.joints if joint.effort > 0]
        share = min((joint.effort / load for joint, load in loads if load > 0), default=1.0)
        if share >= 1.0:
            return
        for name in guessed:
            inertial = self._tree.links[name].find("inertial")
            assert inertial is not None
            for element in inertial.findall("mass") + inertial.findall("inertia"):
                for key, value in element.attrib.items():
                    element.set(key, repr(float(value) * share))

    def efforts(self, points: Points) -> None:
        """Give the arm's joints without effort a torque, N m, or a force, N, that holds the stretched arm."""
        weak = [joint for joint in self._arm.joints if not joint.effort > 0]
        values = []
        for joint in weak:
            value = max(LEAST_EFFORT, round(STRONG * self._load(joint, points), 1))
            _set(joint, "limit", effort=repr(value))
            values.append(value)
        if weak:
            listed = ", ".join(f"{joint.name} {value:g}" for joint, value in zip(weak, values, strict=True))
            self.notes.append(f"the URDF gives no efforts: they were guessed from the masses ({listed} N m).")

    def _load(self, joint: Joint, points: Points) -> float:
        """Return the torque, N m, of the weight that a joint carries, with the arm stretched; N if it slides."""
        frames, carried = self._tree.frames(), self._tree.below(joint.child)
        masses = {link: mass_of(self._tree.links[link]) for link in carried}
        masses[self._arm.hand[0]] += PAYLOAD
        if joint.kind == SLIDING:
            return GRAVITY * sum(masses.values())
        torque = 0.0
        for link, mass in masses.items():
            away, place = 0.0, frames[joint.child][:3, 3]
            for each in self._tree.path(link):
                if each.child in masses:
                    away += float(np.linalg.norm(frames[each.child][:3, 3] - place))
                    place = frames[each.child][:3, 3]
            corners = points([link])
            middle = corners.mean(0) if len(corners) else place
            torque += GRAVITY * mass * (away + float(np.linalg.norm(middle - place)))
        return torque

    def damping(self, fingers: Sequence[Joint], points: Points) -> None:
        """Leave out damping with which Bullet, which applies it once in a step, diverges on light links."""
        stiff = []
        for joint in (*self._arm.joints, *fingers):
            dynamics = joint.element.find("dynamics")
            given = 0.0 if dynamics is None else float(dynamics.get("damping", 0.0))
            if dynamics is not None and given * TIME_STEP > DAMPED * self._inertia(joint, points):
                dynamics.set("damping", "0.0")
                stiff.append(f"{joint.name} {given:g}")
        if stiff:
            self.notes.append(f"damping that is too great for Bullet was left out: {', '.join(stiff)}.")

    def _inertia(self, joint: Joint, points: Points) -> float:
        """Return the moment of inertia, kg m2, that a joint turns, all joints at 0; the mass, kg, that it slides."""
        frames, total = self._tree.frames(), 0.0
        axis, origin = frames[joint.child][:3, :3] @ unit(joint), frames[joint.child][:3, 3]
        for link in self._tree.below(joint.child):
            corners, mass = points([link]), mass_of(self._tree.links[link])
            away = (corners if len(corners) else frames[link][None, :3, 3]) - origin
            beside = away - (away @ axis)[:, None] * axis
            total += mass * (1.0 if joint.kind == SLIDING else float((beside * beside).sum(1).mean()))
        return total

    def fingers(self, pair: Sequence[Slide], opening: float) -> None:
        """Let two sliding joints open from 0, where they touch, to `opening`, metres."""
        same = True
        for slide in pair:
            joint, way, shut = slide.joint, slide.way, slide.shut
            axis = unit(joint)
            moved = joint.origin.copy()
            moved[:3, 3] += joint.origin[:3, :3] @ axis * shut
            same = same and way > 0 and abs(shut) < 1e-6 and joint.effort > 0
            same = same and abs(joint.low) < 1e-6 and joint.high >= opening - 1e-6
            if same:
                continue
            _set_origin(joint.element, moved[:3, 3])
            _set(joint, "axis", xyz=_text(way * axis))
            effort = joint.effort if joint.effort > 0 else FINGER_FORCE
            _set(joint, "limit", lower="0.0", upper=repr(opening), effort=repr(effort))
            for mimic in joint.element.findall("mimic"):
                joint.element.remove(mimic)
        if not same:
            names = " and ".join(slide.joint.name for slide in pair)
            if any(slide.crossed for slide in pair):
                self.notes.append(f"the limits of {names} lead them through each other: they were mirrored.")
            self.notes.append(f"{names} were made to open from 0 to {opening:g} m, each with a motor of its own.")

    def turn(self, yaw: float) -> None:
        """Turn the robot about the vertical, radians, by a link before its root."""
        if not yaw:
            return
        robot = self._tree.robot
        SubElement(robot, "link", name=ROOT)
        joint = SubElement(robot, "joint", name=f"{ROOT}_joint", type="fixed")
        SubElement(joint, "origin", xyz="0 0 0", rpy=f"0 0 {yaw!r}")
        SubElement(joint, "parent", link=ROOT)
        SubElement(joint, "child", link=self._tree.links[self._tree.root].get("name", ""))
        self.notes.append(f"its front does not look along x: it was turned by {math.degrees(yaw):.0f} degrees.")


def is_free(joint: Joint) -> bool:
    """Whether a joint turns without limits."""
    if joint.kind == "continuous":
        return True
    return joint.kind == "revolute" and not (joint.low < joint.high and joint.high - joint.low < MOST_TURN)


def limits(joint: Joint) -> tuple[float, float]:
    """Return the lowest and highest value of a joint: those of the URDF, or a turn each way for one without."""
    if is_free(joint):
        return -2 * math.pi, 2 * math.pi
    return joint.low, joint.high


def speed(joint: Joint, fastest: float, default: float) -> float:
    """Return the greatest speed of a joint, rad/s or m/s: the URDF's, if it is between 0.01 and `fastest`."""
    return round(min(joint.velocity, fastest), 3) if joint.velocity >= 0.01 else default


def mass_of(link: Element) -> float:
    """Return the mass of a link, kg; 0 where the URDF has none."""
    found = link.find("inertial/mass")
    value = 0.0 if found is None else float(found.get("value", 0.0))
    if value < 0:
        raise URDFError(f"has link {name_of(link)} with mass {value:g}; it must be at least 0")
    return value


def _inertial(corners: Array, frame: Array) -> Element:
    """Return the `inertial` element of a box around points (P, 3) of the root's frame."""
    element = Element("inertial")
    local = (corners - frame[:3, 3]) @ frame[:3, :3] if len(corners) else np.zeros((1, 3))
    low, high = local.min(0), local.max(0)
    size = np.maximum(high - low, 0.01)
    mass = float(np.clip(DENSITY * size.prod(), LIGHTEST, HEAVIEST)) if len(corners) else FRAME_MASS
    square = size**2 * mass / 12
    SubElement(element, "origin", xyz=_text((low + high) / 2), rpy="0 0 0")
    SubElement(element, "mass", value=repr(round(mass, 4)))
    moments = square.sum() - square
    values = {f"i{axis}{axis}": repr(float(each)) for axis, each in zip("xyz", moments, strict=True)}
    SubElement(element, "inertia", {**values, "ixy": "0", "ixz": "0", "iyz": "0"})
    return element


def _set(joint: Joint, tag: str, **values: str) -> None:
    """Set attributes of a child of a joint's element."""
    child = joint.element.find(tag)
    child = SubElement(joint.element, tag) if child is None else child
    for name, value in values.items():
        child.set(name, value)


def _set_origin(element: Element, position: Array) -> None:
    origin = element.find("origin")
    origin = SubElement(element, "origin", rpy="0 0 0") if origin is None else origin
    origin.set("xyz", _text(position))


def _text(values: Array) -> str:
    return " ".join(repr(round(float(value), 9) + 0.0) for value in values)

"""The YAML of a robot, guessed from its URDF: arm, gripper, where it stands and how it rests.

Every value can be given instead. What was guessed, and what of the URDF had to be mended, is told in sentences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import ConfigError
from envs.sim.robot_import.body import ImportedBody
from envs.sim.robot_import.meshes import Meshes
from envs.sim.robot_import.placing import JointChain, Placement, chain_of, place_arm, reach_of
from envs.sim.robot_import.repairs import Repairs, Slide, speed
from envs.sim.robot_import.tree import SLIDING, Joint, URDFArm, URDFTree, unit
from envs.sim.urdf_file import URDFError, read_urdf, urdf_bytes
from envs.sim.workspace import WorkspaceConfig

Array = NDArray[np.float64]
FASTEST, SLOW_SLIDE, SPEED = 3.14, 0.25, 1.5  # rad/s, m/s, and rad/s where the URDF gives no speed
GAIN = 0.3
LONG = 0.5  # metres: a shorter arm gets a small magnet
MAGNETS = ((0.01, 0.03), (0.02, 0.05))  # radius and length, metres, for a short and a long arm
NEAR_AXIS = 0.025  # metres beside the gripper's axis within which the magnet is mounted on a shape
TIPS_ABOVE = 0.008  # metres from the ends of fingers to the gripper centre
WIDE = 0.028  # metres that each finger opens at least, for objects of 5 cm
WIDEST = 0.2
BESIDE = 0.004  # metres beside the middle between two fingers at which a finger is on its side
CLEARANCE = 0.01
ROLLS = (0.3, 0.6)  # share of the hand along its joint's axis from which on it turns about itself: 5 joints or more, 4
SNAP = 0.94  # cosine from an axis of the tip's frame within which the gripper points along it
FEW, MANY_MORE = 0.6, 0.1  # share of places below which the gripper may tilt, and by how much that must raise it
OTHERS = 3  # arms that are named


@dataclass(frozen=True, kw_only=True)
class Given:
    """What the user says about a robot. Keys of `fields` are those of the robot's YAML; the rest is guessed.

    Attributes:
        name: of the robot.
        fields: values of the YAML, of the right types.
        packages: folders that hold the packages of package://.
        arm: which of several arms, counted from 0.
        still: fix the joints of the arm that slide in the middle of their range.
    """

    name: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    packages: tuple[Path, ...] = ()
    arm: int = 0
    still: bool = False


@dataclass(frozen=True, kw_only=True)
class Guess:
    """A robot that was guessed.

    Attributes:
        values: of its YAML, but `package` and `urdf`.
        notes: what was mended, and what had a choice, in sentences.
        urdf: the mended URDF; None: the given one can be used as it is.
        meshes: files by name, to be put in the folder `<name>_meshes` beside it.
        share: of the places over the table that the gripper reaches.
        touching: pairs of links that are in each other at rest.
        slides: joints of the arm that slide.
    """

    values: dict[str, Any]
    notes: tuple[str, ...]
    urdf: bytes | None
    meshes: dict[str, bytes]
    share: float
    touching: tuple[str, ...]
    slides: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Hand:
    """The gripper: the link that carries it, its centre and direction in that link's frame, and its fingers.

    Attributes:
        tip: link.
        offset: (3,) of the centre, metres.
        approach: (3,) unit vector.
        fingers: joints, or ().
        opening: of each finger, metres.
        magnet: radius and length, or ().
    """

    tip: str
    offset: Array
    approach: Array
    fingers: tuple[Joint, ...]
    opening: float
    magnet: tuple[float, ...]


class RobotGuess:
    """Guesses a robot from a URDF, in the steps of `make`.

    Args:
        urdf: the file.
        given: what the user says.
        folder: an empty folder for files that are made on the way.

    Raises:
        URDFError: the file cannot be a robot's; the text continues a sentence that begins with the file's name.
    """

    def __init__(self, urdf: Path, given: Given, folder: Path) -> None:
        self._urdf, self._given, self._folder = urdf, given, folder
        self._tree = URDFTree(read_urdf(urdf))
        self.arms = self._arms()
        self._loads = 0
        self._notes: list[str] = []

    def _arms(self) -> list[URDFArm]:
        joints = self._given.fields.get("joints")
        return [self._tree.arm_of(list(joints))] if joints else self._tree.arms()

    def tips(self, arm: int = 0) -> list[str]:
        """Return the links of an arm that can carry its gripper, the best first."""
        return self._tree.tips(self.arms[arm])

    def make(self, workspace: WorkspaceConfig, boxes: Sequence[Sequence[float]]) -> Guess:
        """Return the robot. Raises URDFError, and ConfigError for a value that was given.

        Args:
            workspace: the table that it stands at.
            boxes: gripper_box of each workspace.
        """
        arm = self.arms[self._given.arm]
        if len(self.arms) > 1:
            others = [(i, arm.joints) for i, arm in enumerate(self.arms) if i != self._given.arm][:OTHERS]
            named = "; ".join(f"arm={i}: {joints[0].name} to {joints[-1].name}" for i, joints in others)
            self._notes.append(f"it has {len(self.arms)} arms: the others are {named}.")
        meshes = Meshes(self._tree.robot, self._urdf, self._given.packages, f"{self._given.name}_meshes")
        self._write_meshes(meshes)
        slides = [joint for joint in arm.joints if joint.kind == SLIDING]
        if self._given.still:
            arm = replace(arm, joints=tuple(joint for joint in arm.joints if joint not in slides))
        repairs = Repairs(self._tree, arm)
        if self._given.still:
            repairs.hold(slides)
        repairs.shapes()
        repairs.joints()
        body = self._load()
        try:
            repairs.masses(body.points)
            repairs.efforts(body.points)
            hand = self._hand(arm, body, repairs)
        finally:
            body.close()
        chain, placement = self._place(arm, hand, workspace)
        repairs.turn_freely({joint.name: float(q) for joint, q in zip(arm.joints, placement.rest, strict=True)})
        repairs.turn(placement.yaw)
        notes = [*meshes.notes, *repairs.notes]
        mended = urdf_bytes(self._tree.robot) if notes else None
        values = self._values(arm, hand, chain, placement, workspace=workspace, boxes=boxes)
        return Guess(
            values=values,
            notes=(*self._notes, *notes),
            urdf=mended,
            meshes=dict(meshes.converted),
            share=placement.share,
            touching=placement.touching,
            slides=() if self._given.still else tuple(joint.name for joint in slides),
        )

    def _write_meshes(self, meshes: Meshes) -> None:
        place = self._folder / f"{self._given.name}_meshes"
        for name, content in meshes.converted.items():
            place.mkdir(exist_ok=True)
            (place / name).write_bytes(content)

    def _load(self) -> ImportedBody:
        """Return the tree as it is now in Bullet. Bullet keeps files by their names, so each has a new one."""
        self._loads += 1
        path = self._folder / f"{self._loads}.urdf"
        path.write_bytes(urdf_bytes(self._tree.robot))
        return ImportedBody(path)

    # ---- the gripper

    def _hand(self, arm: URDFArm, body: ImportedBody, repairs: Repairs) -> Hand:
        given = self._given.fields
        tip = str(given.get("tip") or self._tree.tips(arm)[0])
        if tip not in arm.hand:
            raise ConfigError(
                f"tip={tip} is not a link that {arm.joints[-1].name} moves; choose from {', '.join(arm.hand[:12])}"
            )
        slides, opening = self._fingers(arm, body)
        fingers = tuple(slide.joint for slide in slides)
        approach = self._approach(arm, body, fingers)
        frame = self._tree.frames()[tip]
        local = frame[:3, :3].T @ approach
        axis = np.eye(3)[int(np.abs(local).argmax())] * np.sign(local[np.abs(local).argmax()])
        local = axis if float(axis @ local) > SNAP else local
        if "approach" in given:
            local = np.array(given["approach"], float)
        if fingers:
            repairs.fingers(slides, opening)
            centre = self._between(fingers, body, frame[:3, :3] @ local)
            magnet: tuple[float, ...] = ()
        else:
            centre, magnet = self._magnet(arm, body, frame[:3, 3], frame[:3, :3] @ local)
        repairs.damping(fingers, body.points)
        offset = frame[:3, :3].T @ (centre - frame[:3, 3])
        offset = np.array(given.get("tip_offset", offset), float)
        cylinder = tuple(given.get("magnet", magnet))
        return Hand(tip=tip, offset=offset, approach=local, fingers=fingers, opening=opening, magnet=cylinder)

    def _fingers(self, arm: URDFArm, body: ImportedBody) -> tuple[tuple[Slide, ...], float]:
        """Return two sliding fingers, and how far each opens, metres; () and 0 where the hand has none."""
        given = self._given.fields
        if "fingers" in given or "fingers" not in given.get("grippers", ["fingers"]):
            named = [self._tree.joints[name] for name in given.get("fingers", []) if name in self._tree.joints]
            pairs = [(named[0], named[1])] if len(named) == 2 else []
        else:
            pairs = self._tree.opposed(arm)
        for pair in pairs:
            found = [slide for one, other in (pair, pair[::-1]) if (slide := self._slide(one, other, body))]
            if len(found) < len(pair):
                continue
            opening = round(min(*(slide.range for slide in found), WIDEST), 4)
            if opening >= WIDE:
                return tuple(found), float(given.get("finger_opening", opening))
            names = " and ".join(joint.name for joint in pair)
            self._notes.append(f"{names} open by {opening:g} m each, too little for objects of 5 cm: it has a magnet.")
        if arm.gripping and not pairs:
            names = ", ".join(joint.name for joint in arm.gripping[:4])
            jaw = " (a jaw that turns: docs/extending.md says how to add `hinge`)" if len(arm.gripping) == 1 else ""
            self._notes.append(f"its hand ({names}) has no two sliding fingers: it is fixed at 0, with a magnet{jaw}.")
        return (), 0.0

    def _slide(self, joint: Joint, other: Joint, body: ImportedBody) -> Slide | None:
        """Return how a finger opens; None where that cannot be seen."""
        way = self._tree.frames()[joint.child][:3, :3] @ unit(joint)
        mine, others = (body.points(self._tree.rigid(each.child)) for each in (joint, other))
        if not len(mine) or not len(others) or joint.kind != SLIDING or not joint.low < joint.high:
            return None
        side = float((mine.mean(0) - others.mean(0)) @ way) / 2  # from the middle between both, at 0
        low, high = side + joint.low, side + joint.high
        if low * high < 0 and min(abs(low), abs(high)) > BESIDE:  # it crosses the middle: its side is that at 0
            if abs(side) < BESIDE:
                return None
            side_of, widest = math.copysign(1.0, side), max(abs(joint.low), abs(joint.high))
            return Slide(joint=joint, way=side_of, shut=0.0, range=widest, crossed=True)
        opens = 1.0 if low + high > 0 else -1.0
        shut = joint.low if opens > 0 else joint.high
        return Slide(joint=joint, way=opens, shut=shut, range=joint.high - joint.low, crossed=False)

    def _approach(self, arm: URDFArm, body: ImportedBody, fingers: Sequence[Joint]) -> Array:
        """(3,) where the gripper points, in the frame of the root, all joints at 0."""
        frames, last = self._tree.frames(), arm.joints[-1]
        origin, axis = frames[last.child][:3, 3], frames[last.child][:3, :3] @ unit(last)
        if fingers:
            way = frames[fingers[0].child][:3, :3] @ unit(fingers[0])
            middle = np.mean([body.points(self._tree.rigid(each.child)).mean(0) for each in fingers], axis=0)
            return _unit((middle - origin) - ((middle - origin) @ way) * way, axis)
        away = self._outwards(arm, body, origin)
        along = float(away @ axis)
        rolls = abs(along) >= ROLLS[len(arm.joints) < 5] * float(np.linalg.norm(away))
        if last.kind != SLIDING and not rolls:
            return _unit(away - along * axis, axis)
        tip = frames[self._tree.tips(arm)[0]][:3, 3]
        wrist = float((tip - frames[arm.joints[-2].child][:3, 3]) @ axis)  # the flange is beyond the wrist's middle
        outwards = wrist if abs(wrist) > 0.01 else along
        return axis * (1.0 if outwards >= 0 else -1.0)

    def _outwards(self, arm: URDFArm, body: ImportedBody, origin: Array) -> Array:
        """(3,) from the last joint to the middle of what it carries, or to a link that carries a tool."""
        frames = self._tree.frames()
        links = [each for link in arm.hand for each in self._tree.below(link)]
        corners = body.points(links)
        ways = [(corners.min(0) + corners.max(0)) / 2 - origin] if len(corners) else []
        ways = [frames[self._tree.tips(arm)[0]][:3, 3] - origin, *ways]
        longest = max(ways, key=lambda way: float(np.linalg.norm(way)))
        if np.linalg.norm(longest) > 0.01 or len(arm.joints) < 2:
            return longest
        for before in reversed(arm.joints[:-1]):
            way = origin - frames[before.child][:3, 3]
            if np.linalg.norm(way) > 0.01:
                return way
        return longest

    def _between(self, fingers: Sequence[Joint], body: ImportedBody, way: Array) -> Array:
        """(3,) the middle between the ends of the fingers, in the frame of the root."""
        frames = self._tree.frames()
        corners = [body.points(self._tree.rigid(joint.child)) for joint in fingers]
        slide = frames[fingers[0].child][:3, :3] @ unit(fingers[0])
        ends = [each[each @ way > (each @ way).max() - 0.02] for each in corners]
        middle = np.mean([(each.min(0) + each.max(0)) / 2 for each in ends], axis=0)
        shut = 0.5 * sum(float(each.mean(0) @ slide) for each in corners)
        middle += (shut - middle @ slide) * slide
        end = min(float((each @ way).max()) for each in corners)
        return middle + (end - TIPS_ABOVE - float(middle @ way)) * way

    def _magnet(self, arm: URDFArm, body: ImportedBody, tip: Array, way: Array) -> tuple[Array, tuple[float, ...]]:
        """Return the middle of a magnet's face (3,), in the frame of the root, and its radius and length."""
        frames, last = self._tree.frames(), arm.joints[-1]
        length = sum(float(np.linalg.norm(joint.origin[:3, 3])) for joint in arm.joints[1:])
        radius, least = MAGNETS[length > LONG]
        start, axis = tip, frames[last.child][:3, :3] @ unit(last)
        if abs(float(axis @ way)) > SNAP:  # the hand turns about itself: the magnet is on its axis
            origin = frames[last.child][:3, 3]
            start = origin + float((tip - origin) @ way) * way
        links = [each for link in arm.hand for each in self._tree.below(link)]
        corners = body.points(links)
        beside = corners - start - ((corners - start) @ way)[:, None] * way
        along = (corners - start) @ way
        near = along[np.linalg.norm(beside, axis=1) < NEAR_AXIS]
        mounted, end = max([0.0, *near.tolist()]), max([0.0, *along.tolist()])
        face = end + least
        return start + face * way, (radius, round(float(np.clip(face - mounted, least, 0.5)), 3))

    # ---- where it stands

    def _place(self, arm: URDFArm, hand: Hand, workspace: WorkspaceConfig) -> tuple[JointChain, Placement]:
        chain = chain_of(self._tree, arm, hand.tip, tip_offset=hand.offset, approach=hand.approach)
        names = [joint.name for joint in arm.joints]
        moved = self._tree.below(arm.joints[0].child)
        given = self._given.fields
        if "rest" in given and len(given["rest"]) != len(names):
            raise ConfigError(f"rest={given['rest']} must be {len(names)} numbers, one for each of {', '.join(names)}")
        body = self._load()

        looks = _Looks(body, names, [link for link in moved if link not in arm.hand], moved)
        try:
            chain, placement = self._placed(chain, workspace, looks)
        finally:
            body.close()
        if placement is None:
            raise URDFError(
                f"has an arm ({names[0]} to {names[-1]}) whose gripper, on {hand.tip}, nowhere points down over the "
                f"middle of the table (approach={_rounded(hand.approach)}, {len(names)} joints): give another tip or "
                "approach, joints=[...], or base=[x,y,z] and rest=[...]"
            )
        return chain, placement

    def _placed(
        self, chain: JointChain, workspace: WorkspaceConfig, looks: _Looks
    ) -> tuple[JointChain, Placement | None]:
        """Return the chain and where it stands: one that may tilt its gripper, if that gets to many more places."""
        given = self._given.fields
        if "position_first" in given:
            chain = replace(chain, tilts=bool(given["position_first"]))
        best = place_arm(chain, workspace, looks, base=given.get("base"), rest=given.get("rest"))
        if chain.tilts or "position_first" in given or (best is not None and best.share >= FEW):
            return chain, best
        tilting = replace(chain, tilts=True)
        other = place_arm(tilting, workspace, looks, base=given.get("base"), rest=given.get("rest"))
        if other is None or (best is not None and other.share < best.share + MANY_MORE):
            return chain, best
        self._notes.append(
            "its wrist points down over few places: the gripper tilts where it must (position_first: true)."
        )
        return tilting, other

    def _values(
        self,
        arm: URDFArm,
        hand: Hand,
        chain: JointChain,
        placement: Placement,
        *,
        workspace: WorkspaceConfig,
        boxes: Sequence[Sequence[float]],
    ) -> dict[str, Any]:
        within = np.where(chain.free, np.inf, 0.0)
        rest = np.clip(placement.rest.round(4), chain.low + 1e-4 - within, chain.high - 1e-4 + within).round(5).tolist()
        kinematics = chain.kinematics(np.array(rest), placement.base, placement.yaw)
        reach = self._given.fields.get("reach")
        if reach is None:
            reach = reach_of(chain, kinematics, boxes, workspace.gripper_box)
        fastest = [
            speed(joint, SLOW_SLIDE, SLOW_SLIDE) if joint.kind == SLIDING else speed(joint, FASTEST, SPEED)
            for joint in arm.joints
        ]
        guessed = {
            "name": self._given.name,
            "base": [round(float(x), 3) for x in placement.base],
            "joints": [joint.name for joint in arm.joints],
            "max_speed": fastest,
            "rest": rest,
            "tip": hand.tip,
            "tip_offset": _rounded(hand.offset),
            "approach": _rounded(hand.approach, 6),
            "grippers": ["fingers", "magnet"] if hand.fingers else ["magnet"],
            "magnet": [float(value) for value in hand.magnet],
            "fingers": [joint.name for joint in hand.fingers],
            "finger_opening": hand.opening,
            "gain": GAIN,
            "reach": reach,
            "position_first": chain.tilts,
            "clearance": CLEARANCE,
        }
        return guessed | dict(self._given.fields)


@dataclass(frozen=True)
class _Looks:
    """Looks at the arm in Bullet. names: of its joints. links: that they move, but the hand. moved: all of them."""

    body: ImportedBody
    names: Sequence[str]
    links: Sequence[str]
    moved: Sequence[str]

    def touching(self, joints: Array) -> list[str]:
        self.body.place(dict(zip(self.names, joints.tolist(), strict=True)))
        return [f"{one} and {other}" for one, other in self.body.touching(self.moved)]

    def sunk(self, joints: Array, height: float, edge: float) -> bool:
        self.body.place(dict(zip(self.names, joints.tolist(), strict=True)))
        return self.body.sunk(self.links, height, edge)


def _unit(way: Array, otherwise: Array) -> Array:
    length = float(np.linalg.norm(way))
    return way / length if length > 1e-6 else otherwise


def _rounded(values: Array, digits: int = 4) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]

"""The links and joints of a URDF as a tree, and the arms that are in it.

Errors are sentences: what of the file is wrong, and what would be right.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from envs.sim.urdf_file import BYTES, URDFError, bad_number, decoded_name, name_of

Array = NDArray[np.float64]
MAX_LINKS = 1000
TURNING, SLIDING = ("revolute", "continuous"), "prismatic"
MOVING = (*TURNING, SLIDING)
KINDS = (*MOVING, "fixed", "floating", "planar")
FEWEST = 3  # joints of an arm
HAND_DEPTH = 2  # moving joints below a link with several branches, up to which they are taken to be fingers
FINGERS, WRIST = 3, 5  # branches that are a hand's wherever they are; joints after which all branches are fingers
GRIPPER = re.compile(r"grip|finger|jaw|claw|knuckle|thumb", re.IGNORECASE)  # joints of a hand, by their names
TIPS = (  # names of links that are made to carry a gripper, the best first
    r"grasp_?(target|frame|point|center|link)",
    r"tcp|tool_?center|(^|_)tool0$",
    r"end_?effector|(^|_)eef?($|_)|ee_link|gripper_frame|hand_tcp",
    r"tool|flange",
)


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of the URDF.

    Attributes:
        name, kind, parent, child: its name and type, and the links' names.
        origin: (4, 4) the joint's frame in that of the parent.
        axis: (3,) as it stands in the file, of any length.
        low, high: limits; NaN where the file has none.
        effort, velocity: of the limit element; 0 where the file has none.
        leader: the joint that this one mimics; None: it has a motor of its own.
        element: of the file.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    low: float
    high: float
    effort: float
    velocity: float
    leader: str | None
    element: Element

    @property
    def moves(self) -> bool:
        return self.kind in MOVING


@dataclass(frozen=True)
class URDFArm:
    """A chain of joints from the base on, and the links that the last of them moves without another joint's help.

    Attributes:
        joints: those with motors.
        hand: the link that the last one moves, and what is fixed to it.
        gripping: moving joints that the hand carries.
    """

    joints: tuple[Joint, ...]
    hand: tuple[str, ...]
    gripping: tuple[Joint, ...]


class URDFTree:
    """The tree of a `robot` element. Raises URDFError for one that is none.

    Attributes:
        robot: the element.
        links: by name.
        joints: by name.
        root: the link that no joint moves.
    """

    def __init__(self, robot: Element) -> None:
        self.robot = robot
        wrong = bad_number(robot)
        if wrong is not None:
            raise URDFError(f"cannot be read: {wrong}, which is not a finite number")
        self.links = _named(robot, "link")
        self.joints = {name: _joint(name, element, self.links) for name, element in _named(robot, "joint").items()}
        self._above: dict[str, Joint] = {}
        self._below: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in self.joints.values():
            if joint.child in self._above:
                one = self._above[joint.child].name
                raise URDFError(f"is no tree: link {joint.child} is moved by two joints, {one} and {joint.name}")
            self._above[joint.child] = joint
            self._below[joint.parent].append(joint)
        self.root = self._find_root()
        self._leaders = {joint.leader for joint in self.joints.values() if joint.leader}

    def _find_root(self) -> str:
        roots = [name for name in self.links if name not in self._above]
        if not roots:
            raise URDFError("is no tree: its joints form a circle, and no link is the base")
        if len(roots) > 1:
            raise URDFError(
                f"is no tree: {len(roots)} links are moved by no joint ({', '.join(roots[:4])}); give one of them, the "
                "base, and connect the others to it by fixed joints"
            )
        reached = set(self.below(roots[0]))
        lost = next((name for name in self.links if name not in reached), None)
        if lost is not None:
            raise URDFError(f"is no tree: link {lost} is in a circle of joints, apart from the base, {roots[0]}")
        return roots[0]

    def below(self, link: str, through: tuple[str, ...] = KINDS) -> list[str]:
        """Return the link and those that joints of these kinds connect below it."""
        found = [link]
        for each in found:  # it grows
            found += [joint.child for joint in self._below[each] if joint.kind in through]
        return found

    def rigid(self, link: str) -> list[str]:
        """Return the link and those that move with it: by fixed joints, and by kinds that are fixed here."""
        return self.below(link, tuple(kind for kind in KINDS if kind not in MOVING))

    def rigid_with(self, link: str) -> list[str]:
        """Return the links that move with this one, above it and below."""
        while link in self._above and not self._above[link].moves:
            link = self._above[link].parent
        return self.rigid(link)

    def path(self, link: str) -> list[Joint]:
        """Return all joints from the root to a link."""
        found: list[Joint] = []
        while link in self._above:
            found.insert(0, self._above[link])
            link = found[0].parent
        return found

    def carried(self, link: str) -> list[Joint]:
        """Return the moving joints directly after the link, or after what is fixed to it."""
        return [joint for each in self.rigid(link) for joint in self._below[each] if joint.moves]

    # ---- arms

    def arms(self) -> list[URDFArm]:
        """Return the arms with the most joints, in the order of the file. Raises URDFError where there is none."""
        found = [self._arm(chain) for chain in self._chains(self.root, ())]
        longest = max((len(arm.joints) for arm in found), default=0)
        if longest < FEWEST:
            names = ", ".join(joint.name for arm in found if len(arm.joints) == longest for joint in arm.joints)
            raise URDFError(
                f"has no arm: its longest chain has {longest} moving joints ({names or 'none'}), and an arm needs at "
                f"least {FEWEST}; joints named like those of a gripper do not count: give joints=[...] to "
                "name those of the arm"
            )
        return [arm for arm in found if len(arm.joints) == longest]

    def arm_of(self, names: list[str]) -> URDFArm:
        """Return the arm that has these joints. Raises URDFError for joints that are not in one chain."""
        for name in names:
            if name not in self.joints:
                raise URDFError(f"has no joint {name}, which joints=[...] names; it has {_some(self.movable())}")
            if not self.joints[name].moves:
                raise URDFError(f"has joint {name}, which is {self.joints[name].kind}: joints=[...] names moving ones")
        path = [joint.name for joint in self.path(self.joints[names[-1]].child)]
        wrong = next((name for name in names if name not in path), None)
        if wrong is not None or sorted(names, key=path.index) != names:
            order = f"{wrong} does not carry {names[-1]}" if wrong else f"the order is {sorted(names, key=path.index)}"
            raise URDFError(f"has no such arm: joints={names} must be in one chain, from the base on; {order}")
        return self._arm(tuple(self.joints[name] for name in names))

    def movable(self) -> list[str]:
        """Return the names of joints that move."""
        return [name for name, joint in self.joints.items() if joint.moves]

    def _arm(self, chain: tuple[Joint, ...]) -> URDFArm:
        hand = self.rigid(chain[-1].child)
        firsts = [joint.child for link in hand for joint in self._below[link] if joint.moves]
        below = [each for first in firsts for each in self.below(first)]
        gripping = [self._above[link] for link in below if self._above[link].moves]
        return URDFArm(chain, tuple(hand), tuple(gripping))

    def _chains(self, link: str, chain: tuple[Joint, ...]) -> Iterator[tuple[Joint, ...]]:
        """Yield the chains of arm joints that go on from a link at which `chain` has come."""
        carried = self.carried(link)
        onward = [joint for joint in carried if not self._grips(joint)]
        if len(chain) >= FEWEST and len(onward) < len(carried):  # what is beside a finger is one
            onward = []
        several = len(onward) > 1 and len(chain) >= FEWEST
        many = len(onward) >= FINGERS or len(chain) >= WRIST
        if not onward or (several and (many or max(map(self._depth, onward)) <= HAND_DEPTH)):
            if chain:
                yield chain
            return
        for joint in onward:
            yield from self._chains(joint.child, (*chain, joint))

    def _depth(self, joint: Joint) -> int:
        """Return the number of moving joints in the longest chain that begins with this one."""
        return 1 + max((self._depth(each) for each in self.carried(joint.child) if not self._grips(each)), default=0)

    def _grips(self, joint: Joint) -> bool:
        """Whether it is a joint of a gripper: by its name, or because it follows another or is followed."""
        return bool(GRIPPER.search(joint.name)) or joint.leader is not None or joint.name in self._leaders

    # ---- its parts

    def tips(self, arm: URDFArm) -> list[str]:
        """Return the links that can carry the gripper, the best first."""

        def rank(link: str) -> int:
            named = next((i for i, name in enumerate(TIPS) if re.search(name, link, re.IGNORECASE)), len(TIPS))
            return named + (named == len(TIPS) and bool(GRIPPER.search(link)))

        names = [link for link in arm.hand if not re.search(r"camera|optical|lens|laser|sensor", link)]
        return sorted(names or list(arm.hand), key=lambda link: (rank(link), -arm.hand.index(link)))

    def opposed(self, arm: URDFArm) -> list[tuple[Joint, Joint]]:
        """Return the pairs of sliding joints of the hand that slide along one line."""
        frames = self.frames()
        sliding = [joint for joint in arm.gripping if joint.kind == SLIDING and self._is_first(joint, arm)]
        ways = [frames[joint.child][:3, :3] @ unit(joint) for joint in sliding]
        pairs = itertools.combinations(range(len(sliding)), 2)
        return [(sliding[i], sliding[j]) for i, j in pairs if abs(float(ways[i] @ ways[j])) > 0.95]

    def _is_first(self, joint: Joint, arm: URDFArm) -> bool:
        return joint.parent in arm.hand

    def frames(self) -> dict[str, Array]:
        """(4, 4) the frame of each link in that of the root, all joints at 0."""
        frames = {self.root: np.eye(4)}
        for link in self.below(self.root)[1:]:
            joint = self._above[link]
            frames[link] = frames[joint.parent] @ joint.origin
        return frames


def unit(joint: Joint) -> Array:
    """(3,) the joint's axis with length 1. Raises URDFError for one of length 0."""
    length = float(np.linalg.norm(joint.axis))
    if not 1e-6 < length < math.inf:
        raise URDFError(f"has joint {joint.name} with an axis of length {length:g}: give the direction that it has")
    return joint.axis / length


def transform(element: Element | None) -> Array:
    """(4, 4) the transform of an `origin` element, the identity for None. Raises URDFError."""
    matrix = np.eye(4)
    if element is None:
        return matrix
    roll, pitch, yaw = _vector(element, "rpy", (0.0, 0.0, 0.0))
    (a, b, c), (d, e, f) = ((fn(roll), fn(pitch), fn(yaw)) for fn in (math.cos, math.sin))
    matrix[:3, :3] = [
        [c * b, c * e * d - f * a, c * e * a + f * d],
        [f * b, f * e * d + c * a, f * e * a - c * d],
        [-e, b * d, b * a],
    ]
    matrix[:3, 3] = _vector(element, "xyz", (0.0, 0.0, 0.0))
    return matrix


def _vector(element: Element, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
    words = element.get(name)
    numbers = default if words is None else tuple(map(float, words.split()))
    if len(numbers) != 3:
        raise URDFError(f'has {element.tag} {name}="{words}", which must be 3 numbers')
    return numbers


def _named(robot: Element, tag: str) -> dict[str, Element]:
    """Return the elements of a kind by their names. Raises URDFError."""
    found: dict[str, Element] = {}
    for element in robot.findall(tag):
        name = name_of(element)
        if not name.strip():
            raise URDFError(f"has a {tag} without a name")
        if any(ord(character) < 32 for character in name) or len(name) > 200:
            raise URDFError(f"has a {tag} named {name[:40]!r}: names have at most 200 characters, and no line breaks")
        if name in found:
            raise URDFError(f"has two {tag}s named {name}")
        found[name] = element
    if tag == "link" and not found:
        raise URDFError("has no links: it is empty, or no robot's")
    if len(found) > MAX_LINKS:
        raise URDFError(f"has {len(found)} {tag}s, and at most {MAX_LINKS} are read")
    return found


def _joint(name: str, element: Element, links: dict[str, Element]) -> Joint:
    kind = element.get("type", "")
    if kind not in KINDS:
        raise URDFError(f'has joint {name} of type "{kind}": it must be one of {", ".join(KINDS)}')
    ends = []
    for end in ("parent", "child"):
        found = element.find(end)
        link = "" if found is None else decoded_name(found.get("link", "").encode(BYTES))
        if link not in links:
            raise URDFError(f"has joint {name} with {end} {link or 'none'}: no link has this name")
        ends.append(link)
    axis, limit, mimic = (element.find(tag) for tag in ("axis", "limit", "mimic"))
    given = {} if limit is None else dict(limit.attrib)
    return Joint(
        name=name,
        kind=kind,
        parent=ends[0],
        child=ends[1],
        origin=transform(element.find("origin")),
        axis=np.array((1.0, 0.0, 0.0) if axis is None else _vector(axis, "xyz", (1.0, 0.0, 0.0))),
        low=float(given.get("lower", 0.0 if "upper" in given else math.nan)),
        high=float(given.get("upper", 0.0 if "lower" in given else math.nan)),
        effort=float(given.get("effort", 0.0)),
        velocity=_number(given.get("velocity")),
        leader=None if mimic is None else decoded_name(mimic.get("joint", "").encode(BYTES)) or "?",
        element=element,
    )


def _number(text: str | None) -> float:
    try:
        value = float(text or 0.0)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0


def _some(names: list[str]) -> str:
    return ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")

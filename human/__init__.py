"""The person: the body that points, its ray, and what the ray singles out.

Knows no robots. Positions are in metres in the workspace frame: origin on the table top where the robot is mounted,
x away from the robot, y to the robot's left, z up.
"""

from human.arm import Arm, Unreachable
from human.body import Body, read_arm
from human.by_hand import Hand, Keys, ScriptedKeys, View, Written, choose
from human.config import SOURCES, STYLES, Camera, GestureConfig, HumanConfig
from human.fusion import meant, named
from human.person import Gesture, Person
from human.pointing import (
    Beside,
    NothingPointedAt,
    beside,
    pointed_object,
    posterior,
    strayed,
    visibility,
)

__all__ = [
    "SOURCES",
    "STYLES",
    "Arm",
    "Beside",
    "Body",
    "Camera",
    "Gesture",
    "GestureConfig",
    "Hand",
    "HumanConfig",
    "Keys",
    "NothingPointedAt",
    "Person",
    "ScriptedKeys",
    "Unreachable",
    "View",
    "Written",
    "beside",
    "choose",
    "meant",
    "named",
    "pointed_object",
    "posterior",
    "read_arm",
    "strayed",
    "visibility",
]

"""The person: the arm that points, the ray of its finger, and which object that ray refers to.

The package does not depend on robots. Positions are in metres in the workspace frame: origin on the table top where the
robot is mounted, x away from the robot, y to the robot's left, z up.
"""

from human.arms import PointingArm, Unreachable
from human.body import Body, read_arm
from human.by_hand import Display, KeyboardPointer, KeySource, choose_object
from human.config import SOURCES, STYLES, Camera, GestureConfig, HumanConfig
from human.person import Person, PointingGesture
from human.pointing import (
    NothingPointedAt,
    RayOffsets,
    add_aiming_noise,
    fuse,
    pointed_object,
    posterior,
    ray_offsets,
    referring_phrase,
    visibility,
)

__all__ = [
    "SOURCES",
    "STYLES",
    "Body",
    "Camera",
    "Display",
    "GestureConfig",
    "HumanConfig",
    "KeySource",
    "KeyboardPointer",
    "NothingPointedAt",
    "Person",
    "PointingArm",
    "PointingGesture",
    "RayOffsets",
    "Unreachable",
    "add_aiming_noise",
    "choose_object",
    "fuse",
    "pointed_object",
    "posterior",
    "ray_offsets",
    "read_arm",
    "referring_phrase",
    "visibility",
]

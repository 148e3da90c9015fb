"""The person in PyBullet: body, URDF, camera and window. The only part of `human` that imports PyBullet."""

from core.system import suppress_stdout

with suppress_stdout():  # PyBullet prints its build time when it is first imported
    import pybullet  # noqa: F401

from human.body.pybullet_body import Body, read_arm

__all__ = ["Body", "read_arm"]

"""PyBullet: worlds, robots, grippers, furniture, devices. The only package of envs that imports PyBullet."""

from core.system import suppress_stdout

with suppress_stdout():  # PyBullet prints its build time when it is first imported
    import pybullet  # noqa: F401

"""PyBullet: worlds, robots, grippers, furniture, devices. The only package that imports PyBullet."""

"""From a URDF to a robot: finds the arm in it, mends what Bullet cannot use, and places it at the table."""

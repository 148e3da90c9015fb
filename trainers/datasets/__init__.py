"""Demonstrations as LeRobot and Minari datasets."""

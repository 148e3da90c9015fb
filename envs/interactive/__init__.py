"""Environments with a person in the loop: they choose the referent, point, and move objects."""

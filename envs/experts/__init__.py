"""Scripted experts: they show that a task can be done, and how well."""

from envs.experts.base import Expert
from envs.experts.oracle import Oracle
from envs.experts.place import PlaceExpert
from envs.experts.reach import ReachExpert
from envs.experts.registry import EXPERTS, expert

__all__ = ["EXPERTS", "Expert", "Oracle", "PlaceExpert", "ReachExpert", "expert"]

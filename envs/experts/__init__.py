"""Scripted experts, one for each task: they show that a task can be done, and how well.

Every module of this package is imported here, so that a new file registers its expert without an edit elsewhere.
"""

from importlib import import_module
from pkgutil import iter_modules

from envs.experts.base import EXPERTS, Expert, expert, register_expert
from envs.experts.oracle import Oracle

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)

__all__ = ["EXPERTS", "Expert", "Oracle", "expert", "register_expert"]

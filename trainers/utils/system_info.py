"""What a run was made on, for reports."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from trainers.config import cores

PACKAGES = ("torch", "torchrl", "tensordict", "pybullet", "numpy")


def machine() -> dict[str, str]:
    """Cores, processor, system and versions, as words."""
    known = {"cores": str(cores()), "cpu": _cpu(), "system": f"{platform.system()} {platform.machine()}"}
    known["python"] = platform.python_version()
    for package in PACKAGES:
        try:
            known[package] = version(package)
        except PackageNotFoundError:
            known[package] = "not installed"
    return known


def _cpu() -> str:
    """The processor's model, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or "unknown"

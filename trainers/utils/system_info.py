"""The machine and library versions that a run was made with, for reports."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from trainers.config import cores

PACKAGES = ("torch", "torchrl", "tensordict", "pybullet", "numpy")


def system_info() -> dict[str, str]:
    """Number of cores, processor, operating system, and versions of Python and of `PACKAGES`, as text."""
    info = {"cores": str(cores()), "cpu": _cpu_model(), "system": f"{platform.system()} {platform.machine()}"}
    info["python"] = platform.python_version()
    for package in PACKAGES:
        try:
            info[package] = version(package)
        except PackageNotFoundError:
            info[package] = "not installed"
    return info


def _cpu_model() -> str:
    """The model name from /proc/cpuinfo, or what `platform` reports on other systems."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or "unknown"

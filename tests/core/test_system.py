"""System information for reports."""

from __future__ import annotations

import platform

import torch

from core.system import PACKAGES, system_info


def test_it_names_the_cores_the_processor_and_the_versions():
    info = system_info()
    assert {"cores", "cpu", "system", "python", *PACKAGES} == set(info)
    assert int(info["cores"]) >= 1
    assert info["python"] == platform.python_version()
    assert info["torch"].partition("+")[0] == torch.__version__.partition("+")[0]
    assert info["pybullet"].startswith("3.2.")

"""docs/deployment.md: its adapter drives an arm of servos, and its tables name what there is."""

from __future__ import annotations

import re
from contextlib import closing
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from core.errors import ConfigError
from core.overrides import compose
from deployment.arm import ARMS, NEVER, ArmError
from deployment.franky_arm import FrankyConfig
from deployment.lerobot_arm import LeRobotConfig
from deployment.safe_arm import SafeArm
from deployment.safety import Limits, Safety, SafetyConfig
from deployment.twin import TwinConfig
from envs import read_env
from envs.sim.robot import read_kinematics

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "deployment.md").read_text(encoding="utf-8")


class Bus:
    """Servos that are at once where they are sent, in degrees."""

    def __init__(self, start):
        self.degrees = [*np.degrees(start), 100.0]

    def read(self):
        return list(self.degrees)

    def write(self, degrees):
        self.degrees = list(degrees)

    def close(self):
        self.degrees = None


@pytest.fixture
def written(monkeypatch):
    """What the page's example defines."""
    [code] = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    monkeypatch.setattr("deployment.arm.ARMS", dict(ARMS))
    names: dict = {"__name__": "my_arm"}
    exec(compile(code, "docs/deployment.md", "exec", dont_inherit=True), names)
    assert names["ARMS"].pop("bus") == "my_arm:BusArm"
    return names


def test_the_adapter_of_the_page_drives_servos(written):
    setup = read_env(compose(["robot=ur5"]))
    rest = read_kinematics(setup.robot).rest
    bus = Bus(rest)
    written["open_bus"] = lambda port: bus
    arm = written["BusArm"](written["BusConfig"](), setup)
    assert arm.on_hardware == NEVER
    rules = SafetyConfig(slow_start=0.0)
    limits = Limits(setup, read_kinematics(setup.robot), rules, magnet=True)
    safe = SafeArm(arm, Safety(rules, limits))
    with closing(safe):
        safe.connect()
        for _ in range(4):
            safe.step(rest + 0.02, 0.5, 0.02)
        np.testing.assert_allclose(bus.degrees, [*np.degrees(rest + 0.02), 50.0], atol=1e-6)
        safe.stop("somebody pressed stop")
        safe.step(rest, 0.5, 0.02)
        np.testing.assert_allclose(bus.degrees[:6], np.degrees(rest + 0.02), atol=1e-6)


def test_the_adapter_of_the_page_refuses_what_it_cannot_drive(written):
    with pytest.raises(ConfigError, match="arm=bus has 6 joints, robot=kuka has 7"):
        written["BusArm"](written["BusConfig"](), read_env(compose([])))

    def missing(port):
        raise OSError("no such port")

    written["open_bus"] = missing
    setup, rules = read_env(compose(["robot=ur5"])), SafetyConfig()
    arm = written["BusArm"](written["BusConfig"](), setup)
    limits = Limits(setup, read_kinematics(setup.robot), rules, magnet=True)
    with (
        pytest.raises(ArmError, match=r"arm\.port=/dev/ttyUSB0 cannot be opened: no such port"),
        closing(SafeArm(arm, Safety(rules, limits))) as safe,
    ):
        safe.connect()


def test_the_page_lists_every_arm_and_every_setting_with_its_default():
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE.split("## ")[0], re.MULTILINE)) == set(ARMS)
    arms = (TwinConfig(), LeRobotConfig(), FrankyConfig())
    for group, config in (("safety", SafetyConfig()), *(("arm", each) for each in arms)):
        told = dict(re.findall(rf"`{group}\.(\w+)=([\w.]+)`(?: |\)|,)", PAGE))
        for field in fields(config):
            default = getattr(config, field.name)
            shown = f"{default:g}" if isinstance(default, float) else str(default)
            shown = {"True": "true", "False": "false", "None": "null"}.get(shown, shown)
            assert f"`{group}.{field.name}={shown}`" in PAGE, (field.name, told)

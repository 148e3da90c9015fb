"""An arm that is at once where it is sent, with a time that passes when it is told to."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from core.schema import Checked
from deployment.arm import Arm, ArmError, ArmState
from tools.hostile_arms import FuzzClock


class ObedientArm(Arm):
    """dark: it is not seen. fails: its cable is loose. commands, holds: how many it got. opening: of its gripper."""

    settings: ClassVar[type[Checked]] = Checked
    dark = fails = False

    def __init__(self, setup, start):
        super().__init__(None, setup)
        self.clock, self.angles, self.opening = FuzzClock(), np.array(start), 1.0
        self.commands = self.holds = 0

    def connect(self):
        """Nothing is needed."""

    def disconnect(self):
        """Nothing is needed."""

    def observe(self):
        return None if self.dark else ArmState(self.clock.now(), self.angles, self.opening)

    def command(self, angles, opening):
        if self.fails:
            raise ArmError("the cable is loose")
        self.angles, self.opening, self.commands = angles, opening, self.commands + 1

    def hold(self):
        self.holds += 1

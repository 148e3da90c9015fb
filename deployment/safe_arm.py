"""An arm behind its rules: what is wanted of it is checked, sent and logged, and it is watched while time passes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from deployment.arm import Arm, ArmError, ArmState, Array
from deployment.command_log import CommandLog
from deployment.prediction import Prediction
from deployment.safety import Decision, Safety

Person = Callable[["SafeArm"], None]  # asked at each look at the arm: presses keys, stops it, releases it
SLICE = 0.02  # seconds at most between two looks at the arm


class SafeArm:
    """The only way in which this package commands an arm.

    Args:
        arm: connected by `connect`.
        safety: its rules.
        log: where each decision is written.
        predicts: whether `angles` are those that the arm will have, rather than those last measured.
        person: whoever can stop it; None: nobody.
    """

    def __init__(
        self,
        arm: Arm,
        safety: Safety,
        log: CommandLog | None = None,
        predicts: bool = True,
        person: Person | None = None,
    ) -> None:
        self.arm, self.safety, self.log, self._predicts = arm, safety, log or CommandLog(), predicts
        self._person = person
        self.prediction: Prediction | None = None
        self.clock = arm.clock
        self.refused: dict[str, int] = {}  # how often each measurement was not believed, by reason
        self.holding, self._connected = True, False

    def connect(self) -> None:
        """Connect, and wait until the arm is seen. Raises ArmError."""
        self.arm.connect()
        self._connected = True
        self.await_seen()

    def await_seen(self, seconds: float = 5.0) -> None:
        """Wait until a measurement is believed. Raises ArmError after this time."""
        end = self.clock.now() + seconds
        while self.safety.measured is None:
            if self.clock.now() > end:
                why = "; ".join(self.refused) or "it sends nothing"
                raise ArmError(f"the arm was not seen within {seconds:g} s: {why}")
            self.clock.sleep(SLICE)
            self.look()
        if self._predicts:
            self._predict()

    def _predict(self) -> None:
        """Begin to predict from where the arm rests now. What is known of its delay is kept."""
        if self.prediction is None:
            self.prediction = Prediction(self.measured.angles, self.clock.now())
        else:
            self.prediction.restart(self.measured.angles, self.clock.now())

    def relocate(self) -> None:
        """Forget where the arm was: a simulated one was put elsewhere, and goes on at its speed."""
        self.safety.relocate()
        self.holding = True
        self.await_seen()

    def step(self, wanted: Any, opening: Any, period: float) -> Decision:
        """Send the arm towards wanted angles for one control period, and watch it meanwhile.

        Args:
            wanted: (J,) angles, radians; anything else is refused.
            opening: of the gripper, in [0, 1].
            period: seconds.
        """
        self.look()  # the policy may have thought for long
        now = self.clock.now()
        decision = self.safety.decide(now, wanted, opening)
        self.log(now, self.safety.measured, wanted, decision)
        self._send(decision)
        count = math.ceil(period / SLICE - 1e-9)
        for i in range(1, count + 1):
            self.clock.sleep(now + period * i / count - self.clock.now())
            self.look()
            self._watch()
        return decision

    def look(self) -> None:
        """Ask the person, and take the measurement that has come."""
        if self._person is not None:
            self._person(self)
        try:
            state = self.arm.observe()
        except ArmError as error:
            self.safety.stop(str(error))
            return
        if state is None:
            return
        if reason := self.safety.observe(self.clock.now(), state):
            self.refused[reason] = self.refused.get(reason, 0) + 1
        elif self.prediction is not None:
            self.prediction.measured(self.measured.time, self.measured.angles)

    @property
    def measured(self) -> ArmState:
        """The newest measurement that is believed; there is one after `await_seen`."""
        assert self.safety.measured is not None
        return self.safety.measured

    @property
    def angles(self) -> Array:
        """(J,) radians: where the arm will be once it has done what it was sent, or where it was measured."""
        ahead = 0.0 if self.prediction is None else self.prediction.ahead(self.measured.time, self.clock.now())
        return self.measured.angles + ahead

    def _watch(self) -> None:
        """Hold at once where something is wrong: the next command may be long in coming."""
        now = self.clock.now()
        reason = "" if self.holding else self.safety.alarm(now)
        if reason:
            decision = self.safety.decide(now, None, None)
            self.log(now, self.safety.measured, None, decision)
            self._send(decision)

    def _send(self, decision: Decision) -> None:
        """Send a decision. An arm that fails is stopped."""
        self.holding = decision.angles is None
        try:
            if decision.angles is None:
                self.arm.hold()
                if self.prediction is not None and self.safety.measured is not None:
                    self._predict()
            elif not self.safety.config.dry_run:
                self.arm.command(decision.angles, decision.opening)
                if self.prediction is not None:
                    self.prediction.sent(self.clock.now(), decision.angles)
        except ArmError as error:
            self.safety.stop(str(error))

    def stop(self, reason: str) -> None:
        """Stop the arm at once, until `safety.release`."""
        self.safety.stop(reason)
        self._watch()

    def close(self) -> None:
        """Hold, disconnect, and close the log. Idempotent."""
        try:
            if self._connected:
                self.arm.hold()
        except ArmError:
            pass
        finally:
            self._connected = False
            self.arm.disconnect()
            self.log.close()
            self.safety.limits.close()

"""An arm behind its rules: what is wanted of it is checked, sent and logged, and it is watched while time passes."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from core.errors import ConfigError
from deployment.arm import Arm, ArmError, ArmState, Array
from deployment.command_log import CommandLog
from deployment.prediction import Prediction
from deployment.safety import Decision, Safety

Person = Callable[["SafeArm"], None]  # asked at each look at the arm: presses keys, stops it, releases it
SLICE = 0.02  # seconds at most between two looks at the arm
PAUSED = "paused: the arm holds"


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
        self.paused = False  # whether nobody drives the arm for now
        self._failure = ""  # of the last call of the adapter
        self._told = ""  # why the arm holds, as the log says

    def connect(self) -> None:
        """Connect, and wait until the arm is seen. Raises ArmError, or ConfigError as the adapter does."""
        try:
            self.arm.connect()
        except (ArmError, ConfigError):
            raise
        except Exception as error:
            raise ArmError(_sentence(error)) from error
        self._connected = True
        self.await_seen()

    def await_seen(self, seconds: float = 5.0) -> None:
        """Wait until a measurement is believed. Raises ArmError after this time, or if the adapter fails."""
        end = self.clock.now() + seconds
        while self.safety.measured is None:
            if self.clock.now() > end:
                why = "; ".join(self.refused) or "it sends nothing"
                raise ArmError(f"the arm was not seen within {seconds:g} s: {why}")
            self.clock.sleep(SLICE)
            self.look()
            if self._failure:
                raise ArmError(self._failure)
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
        self.paused = False
        now = self.clock.now()
        decision = self.safety.decide(now, wanted, opening)
        self.log(now, self.safety.measured, wanted, decision)
        self._send(decision)
        count = math.ceil(period / SLICE - 1e-9)
        for i in range(1, count + 1):
            self.clock.sleep(now + period * i / count - self.clock.now())
            self.watch()
        return decision

    def watch(self) -> None:
        """Look at the arm, and hold at once where something is wrong."""
        self.look()
        self._hold_where_wrong()

    def pause(self) -> None:
        """Hold until the next step, and look at the arm. To be called every `SLICE` meanwhile."""
        self.paused = True
        self.look()
        if not self.holding:
            self._hold(self.safety.alarm(self.clock.now()) or PAUSED)

    def look(self) -> None:
        """Ask the person and other threads, and take the measurement that has come."""
        if self._person is not None:
            self._person(self)
        self.safety.heed()
        state = self._call(self.arm.observe)
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

    def _hold_where_wrong(self) -> None:
        """Hold at once where something is wrong: the next command may be long in coming."""
        reason = "" if self.holding else self.safety.alarm(self.clock.now())
        if reason:
            self._hold(reason)

    def _hold(self, reason: str) -> None:
        """Hold between two commands. A hold that failed is tried again at each look, and logged once."""
        decision = self.safety.hold(reason)
        if reason != self._told:
            self.log(self.clock.now(), self.safety.measured, None, decision)
        self._told = reason
        self._send(decision)

    def _send(self, decision: Decision) -> None:
        """Send a decision; in a dry run, nothing. An arm that fails is stopped."""
        dry = self.safety.config.dry_run
        if decision.angles is None:
            if not dry:
                self._call(self.arm.hold)
            self.holding = dry or not self._failure
            if self.prediction is not None and self.safety.measured is not None:
                self._predict()
            return
        self.holding, self._told = False, ""
        if dry:
            return
        self._call(self.arm.command, decision.angles, decision.opening)
        if self.prediction is not None and not self._failure:
            self.prediction.sent(self.clock.now(), decision.angles)

    def _call(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Call the adapter. Whatever it raises stops the arm: it gives None then, and `_failure` is a sentence."""
        self._failure = ""
        try:
            return call(*arguments)
        except ArmError as error:
            self._failure = str(error)
        except Exception as error:
            self._failure = _sentence(error)
        self.safety.stop(self._failure)
        return None

    def stop(self, reason: str) -> None:
        """Stop the arm at once, until `safety.release`. Other threads call `safety.request_stop`."""
        self.safety.stop(reason)
        self._hold_where_wrong()

    def close(self) -> None:
        """Hold, disconnect, and close the log. Idempotent.

        An adapter that fails now is not told of: the reason for the end, which may be the same, would be hidden.
        """
        try:
            if self._connected and not self.safety.config.dry_run:
                with suppress(Exception):
                    self.arm.hold()
            with suppress(Exception):
                self.arm.disconnect()
        finally:
            self._connected = False
            self.log.close()
            self.safety.limits.close()


def _sentence(error: Exception) -> str:
    """Return one sentence about an error that the adapter did not foresee."""
    return f"the arm failed: {type(error).__name__}: {' '.join(str(error).split())}"

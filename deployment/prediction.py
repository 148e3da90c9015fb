"""Where an arm will be once it has done what it was sent: a Smith predictor whose delay is fitted while the arm moves.

Policies were trained where an arm reaches its target within a control period and is seen at once. A real one answers
late: commands travel, motors lag, measurements travel back. So the policy is shown where the arm will be:

    measured + (sent by now - what a model of the arm had done of it when it was measured)

The model is a delay and a first-order lag. An error that lasts, such as an arm that sags, stays in the sum.
Source: Smith, "Closer control of loops with dead time", 1957.
"""

from __future__ import annotations

import numpy as np

from deployment.arm import Array

TICK = 0.005  # seconds between two points of the model
LAGS = np.array([0.0, 0.015, 0.03, 0.06, 0.12])  # seconds: time constants that are tried
DELAYS = 2 * TICK * np.arange(40)  # seconds that are tried
WINDOW = 2.0  # seconds to which delay and lag are fitted
MOVED = 0.02  # radians by which the commands of that time must differ before they tell anything
FITTED = 40  # measurements at most
EVERY = 6  # measurements between two fits


class Prediction:
    """The model of one arm with J joints.

    delay: seconds, and lag: the time constant in seconds, as fitted last; both begin at 0.

    Args:
        angles: (J,) where the arm is, radians.
        time: now, seconds.
    """

    def __init__(self, angles: Array, time: float) -> None:
        self.delay = self.lag = 0.0
        self._lag: np.int64 | int = 0  # index into LAGS
        self._size = round((WINDOW + DELAYS[-1]) / TICK) + 2
        self._decay = np.exp(-TICK / np.maximum(LAGS, 1e-9))[:, None]
        self._measured: list[tuple[int, Array]] = []
        self.restart(angles, time)

    def restart(self, angles: Array, time: float) -> None:
        """Begin again with an arm that rests at angles (J,). What was fitted is kept."""
        self._origin, self._tick, self._seen, self._sent = time, 0, 0, np.array(angles)
        self._model = np.broadcast_to(self._sent, (self._size, len(LAGS), len(angles))).copy()  # by tick, modulo size
        self._measured.clear()

    def sent(self, time: float, angles: Array) -> None:
        """Note that angles (J,) were sent at this time; those before them were in force until then."""
        self._advance(time)
        self._sent = np.array(angles)

    def _advance(self, time: float) -> None:
        """Let the model follow the angles in force until this time."""
        tick = round((time - self._origin) / TICK)
        if tick - self._tick > self._size:
            self._tick = tick - self._size
        while self._tick < tick:
            before = self._model[self._tick % self._size]
            self._tick += 1
            self._model[self._tick % self._size] = self._sent + (before - self._sent) * self._decay

    def measured(self, time: float, angles: Array) -> None:
        """Note a measurement of angles (J,), and fit the model to those of the last seconds now and then."""
        tick = round((time - self._origin) / TICK)
        self._measured.append((tick, angles))
        oldest = self._tick - round(WINDOW / TICK)
        self._measured = [each for each in self._measured if each[0] > oldest]
        self._seen += 1
        if self._seen % EVERY == 0:
            self._fit(self._measured[:: -(-len(self._measured) // FITTED)])

    def _fit(self, measured: list[tuple[int, Array]]) -> None:
        """Choose the delay and the lag with which the model is nearest to these measurements."""
        angles = np.array([angles for _, angles in measured])
        if np.ptp(angles, axis=0).max(initial=0.0) < MOVED:
            return
        shifted = np.array([tick for tick, _ in measured])[:, None] - np.rint(DELAYS / TICK).astype(int)
        models = self._model[np.maximum(shifted, self._tick - self._size + 1) % self._size]  # (M, delays, lags, J)
        error = models - angles[:, None, None]
        error -= error.mean(0)  # an arm that sags is no later
        delay, self._lag = np.unravel_index((error * error).sum((0, 3)).argmin(), (len(DELAYS), len(LAGS)))
        self.delay, self.lag = float(DELAYS[delay]), float(LAGS[self._lag])

    def ahead(self, time: float, now: float) -> Array:
        """(J,) radians by which the arm will yet move from where it was measured at `time`."""
        self._advance(now)
        tick = max(round((time - self._origin - self.delay) / TICK), self._tick - self._size + 1)
        return self._sent - self._model[min(tick, self._tick) % self._size, self._lag]

"""Servos of an SO-101 behind a serial port, imitated byte by byte: Feetech's protocol for the STS series.

They are on the other side of a pseudo-terminal, so that LeRobot's follower, its bus, Feetech's library and pyserial run
as they are.
"""

from __future__ import annotations

import json
import os
import threading
import time
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

MOTORS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")  # ids 1 to 6
PING, READ, WRITE, SYNC_READ, SYNC_WRITE, EVERYONE = 1, 2, 3, 0x82, 0x83, 0xFE
MODEL, LOWEST, HIGHEST, OFFSET, TORQUE, GOAL, PRESENT = 3, 9, 11, 31, 40, 42, 56  # addresses of registers
STS3215 = 777  # its model number
TURN, SPEED = 4096, 3072  # ticks of a turn, and in a second: 45 rpm
MIDDLE = 2047


class Servo:
    """One servo: 128 bytes of registers, and a shaft that turns towards its goal while it has torque."""

    def __init__(self, position: int = MIDDLE) -> None:
        self.registers, self.position, self._since = bytearray(128), float(position), time.monotonic()
        for address, value in ((MODEL, STS3215), (LOWEST, 700), (HIGHEST, 3394), (GOAL, position)):
            self.put(address, value.to_bytes(2, "little"))

    def put(self, address: int, data: bytes) -> None:
        """Write registers."""
        self.turn()
        self.registers[address : address + len(data)] = data

    def get(self, address: int, length: int) -> bytes:
        """Read registers."""
        self.turn()
        self.registers[PRESENT : PRESENT + 2] = round(self.position).to_bytes(2, "little")
        return bytes(self.registers[address : address + length])

    def turn(self) -> None:
        """Turn the shaft for the time that has passed."""
        now = time.monotonic()
        farthest, self._since = SPEED * (now - self._since), now
        if self.registers[TORQUE]:
            apart = int.from_bytes(self.registers[GOAL : GOAL + 2], "little") - self.position
            self.position += max(-farthest, min(farthest, apart))


class ServoBus:
    """Six servos on a bus. `port` is its name, until `close`.

    deaf: servos that no longer answer.
    """

    def __init__(self) -> None:
        self.servos = {i + 1: Servo() for i in range(len(MOTORS))}
        self.deaf: set[int] = set()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def calibrate(self, folder: Path, name: str) -> None:
        """Write the calibration that the servos hold where LeRobot looks for it."""
        values = {
            motor: {"id": i + 1, "drive_mode": 0, "homing_offset": 0, "range_min": 700, "range_max": 3394}
            for i, motor in enumerate(MOTORS)
        }
        (folder / f"{name}.json").write_text(json.dumps(values))

    def position(self, motor: str) -> float:
        """Where a shaft is, ticks."""
        return self.servos[MOTORS.index(motor) + 1].position

    def degrees(self) -> list[float]:
        """Where the shafts of the joints are, in degrees from their middle."""
        return [(self.position(motor) - MIDDLE) * 360 / (TURN - 1) for motor in MOTORS[:-1]]

    def turn_to(self, degrees: Sequence[float]) -> None:
        """Turn the shafts of the joints by hand, to degrees from their middle."""
        for servo, each in zip(self.servos.values(), degrees, strict=False):
            servo.position = MIDDLE + each * (TURN - 1) / 360

    def close(self) -> None:
        """Pull the cable. Idempotent."""
        if self._master >= 0:
            os.close(self._slave)
            master, self._master = self._master, -1
            os.close(master)

    def _serve(self) -> None:
        """Answer until the cable is pulled."""
        waiting = b""
        with suppress(OSError):
            while self._master >= 0:
                waiting += os.read(self._master, 1024)
                while len(waiting) >= 6 and len(waiting) >= 4 + waiting[3]:
                    packet, waiting = waiting[: 4 + waiting[3]], waiting[4 + waiting[3] :]
                    self._answer(packet[2], packet[4], packet[5:-1])

    def _answer(self, number: int, instruction: int, data: bytes) -> None:
        if instruction == SYNC_WRITE:
            address, length = data[0], data[1]
            for at in range(2, len(data), length + 1):
                self.servos[data[at]].put(address, data[at + 1 : at + 1 + length])
            return
        numbers = list(data[2:]) if instruction == SYNC_READ else [number]
        for each in self.servos if number == EVERYONE and instruction == PING else numbers:
            if each not in self.servos or each in self.deaf:
                continue
            if instruction == WRITE:
                self.servos[each].put(data[0], data[1:])
            read = instruction in (READ, SYNC_READ)
            self._reply(each, self.servos[each].get(data[0], data[1]) if read else b"")

    def _reply(self, number: int, data: bytes) -> None:
        body = bytes([number, len(data) + 2, 0, *data])
        os.write(self._master, b"\xff\xff" + body + bytes([~sum(body) & 0xFF]))

"""The world of a command: things, what is on and in what, what the gripper and the person's hand hold.

One frame serves tables, rooms and boards: x points away from the robot, y to its left, z up. Tables and rooms are in
metres; a board's unit is the cell, and its heights are in blocks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from language.objects import DEVICES, FITTINGS, HAND, Scene

BOARD_CELLS, BOARD_HEIGHT = 8, 8
FLAT = ("cube", "cylinder")  # a thing can stand on these
FIXED = (*DEVICES, *FITTINGS, HAND)  # these stay where they are
AT_END = 0.2  # share of its way up to which a device is at its start
TABLE = (0.25, 0.80, -0.35, 0.35)  # metres: the part of the table that the arm reaches, x from and to, y from and to
TABLE_STEP = 0.06  # metres from a thing to one beside it
LITTLE = 0.04  # metres that "a bit" means
SIDES = ("left", "right", "far", "near")
OPPOSITE = {"left": "right", "right": "left", "far": "near", "near": "far"}


class Thing(NamedTuple):
    """A thing. kind: a noun of the scene. x, y: its centre. bottom, top: heights. width: along x and y."""

    kind: str
    color: str
    x: float
    y: float
    bottom: float
    top: float
    width: float
    target: bool = False


@dataclass(frozen=True)
class WorldModel:
    """The things and their surroundings.

    bounds: of the centres of things that are put down, x from and to, y from and to. pitch: the distance of neighbours.
    little: the length of "a bit". ground, ceiling: heights where things stand and up to which they are stacked.
    held: the index of what the gripper holds, or None. viewpoint: whose left is meant, "robot" or "human".
    front: which side "front" is, "near" (the viewer's) or "far" (where the robot faces). cells: whether it is a board.
    inside: thing -> the container or open hand that it is in. open: the containers that are open. moved: device -> how
    far it is from its start, in shares of its way. home: thing -> the place (x, y) where it belongs.
    flat_only: whether things are put only on things that stand on the ground. verbs: those that can be carried out;
    None: all. scene: what the project's own language is understood in; None: a board.
    """

    things: tuple[Thing, ...]
    bounds: tuple[float, float, float, float]
    pitch: float
    little: float
    ground: float = 0.0
    ceiling: float = math.inf
    held: int | None = None
    viewpoint: str = "robot"
    front: str = "near"
    cells: bool = False
    inside: Mapping[int, int] = field(default_factory=dict)
    open: frozenset[int] = frozenset()
    moved: Mapping[int, float] = field(default_factory=dict)
    home: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    flat_only: bool = False
    verbs: tuple[str, ...] | None = None
    scene: Scene | None = field(default=None, compare=False, repr=False)

    @cached_property
    def containers(self) -> tuple[int, ...]:
        """The drawers and fridges."""
        return tuple(i for i, thing in enumerate(self.things) if thing.kind in FITTINGS)

    @cached_property
    def devices(self) -> tuple[int, ...]:
        """The buttons, levers and wheels."""
        return tuple(i for i, thing in enumerate(self.things) if thing.kind in DEVICES)

    def is_loose(self, index: int) -> bool:
        """Whether the arm can carry it."""
        return not self.things[index].target and self.things[index].kind not in FIXED

    def contents(self, container: int) -> list[int]:
        """Return what is in a container, or on the open hand."""
        return [thing for thing, box in self.inside.items() if box == container]

    def is_on_ground(self, index: int) -> bool:
        """Whether it stands on the table or board, and is neither held nor in a container."""
        return index != self.held and index not in self.inside and self.below[index] is None

    @cached_property
    def below(self) -> tuple[int | None, ...]:
        """The index of the thing directly below each thing, or None."""
        return self._supports[0]

    @cached_property
    def above(self) -> tuple[int | None, ...]:
        """The index of the thing directly above each thing, or None."""
        return self._supports[1]

    @cached_property
    def hand(self) -> int | None:
        """The index of the open hand of the person, to which "me" and "my hand" refer; None if there is none."""
        return next((index for index, thing in enumerate(self.things) if thing.kind == HAND), None)

    @property
    def in_hand(self) -> tuple[float, float, float, int]:
        """The x, y and bottom of a thing that is put into the open hand, and the hand's index. There must be one."""
        assert self.hand is not None
        palm = self.things[self.hand]
        return palm.x, palm.y, palm.top, self.hand

    @property
    def only(self) -> str | None:
        """The verb that alone can be carried out; None where there are several."""
        return self.verbs[0] if self.verbs is not None and len(self.verbs) == 1 else None

    @cached_property
    def colors(self) -> frozenset[str]:
        """The colours of the things."""
        return frozenset(thing.color for thing in self.things)

    @cached_property
    def _supports(self) -> tuple[tuple[int | None, ...], tuple[int | None, ...]]:
        return _supports(self)

    @cached_property
    def _standing(self) -> dict[tuple[int, int] | None, list[int]]:
        """The things that stand on the ground or on other things: on a board, by cell."""
        found: dict[tuple[int, int] | None, list[int]] = {}
        for i, thing in enumerate(self.things):
            if i != self.held and not thing.target and i not in self.inside:
                found.setdefault(self._cell(thing.x, thing.y), []).append(i)
        return found

    def _cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the cell of a position; None on a table, which has none."""
        return (round(x / self.pitch), round(y / self.pitch)) if self.cells else None

    def toward(self, side: str) -> tuple[float, float]:
        """Return the unit vector of a side: "left", "right", "far", "near", "front", "back", "forward", "backward"."""
        sign = 1.0 if self.viewpoint == "robot" else -1.0
        side = self.side(side)
        return {"left": (0.0, sign), "right": (0.0, -sign), "far": (sign, 0.0), "near": (-sign, 0.0)}[side]

    def side(self, name: str) -> str:
        """Return one of SIDES for a side or direction."""
        if name in ("front", "back"):
            return self.front if name == "front" else OPPOSITE[self.front]
        return {"forward": "far", "backward": "near"}.get(name, name)

    @property
    def center(self) -> tuple[float, float]:
        """The middle of the bounds."""
        x0, x1, y0, y1 = self.bounds
        return (x0 + x1) / 2, (y0 + y1) / 2

    def column(self, x: float, y: float, without: int | None = None) -> list[int]:
        """Return the things that stand at a place or overlap it, the lowest first."""
        reach = 0.5 if self.cells else 0.8
        found = [
            (thing.bottom, i)
            for i in self._standing.get(self._cell(x, y), ())
            for thing in [self.things[i]]
            if i != without and max(abs(thing.x - x), abs(thing.y - y)) < reach * thing.width
        ]
        return [i for _, i in sorted(found)]

    def after(self, step: Any) -> WorldModel:
        """Return the world after a step, a `language.outcomes.Step`."""
        index, effect = step.object, step.act.name
        if step.carries and step.place is not None:
            x, y = step.place
            return self.put(index, x, y, step.bottom or 0.0, step.goal)
        if step.takes:
            inside = {thing: box for thing, box in self.inside.items() if thing != index}
            return replace(self, held=index, inside=inside)
        if effect in ("OPEN", "SHUT"):
            return replace(self, open=self.open | {index} if effect == "OPEN" else self.open - {index})
        if index in self.devices and effect == "OPERATE":
            return replace(self, moved={**self.moved, index: float(abs(self.moved.get(index, 0.0)) < 0.5)})
        return self

    def put(self, index: int, x: float, y: float, bottom: float, goal: int | None = None) -> WorldModel:
        """Return the world with the thing there, or in a container or hand, and the gripper empty."""
        thing = self.things[index]
        new = thing._replace(x=x, y=y, bottom=bottom, top=bottom + thing.top - thing.bottom)
        inside = {each: box for each, box in self.inside.items() if each != index}
        if goal is not None and self.things[goal].kind in (*FITTINGS, HAND):
            inside[index] = goal
        held = None if self.held == index else self.held
        scene = self.scene and self.scene.moved(
            _with_row(self.scene.positions, index, (x, y, (new.bottom + new.top) / 2))
        )
        return replace(
            self, scene=scene, things=(*self.things[:index], new, *self.things[index + 1 :]), held=held, inside=inside
        )

    def covers(self, x: float, y: float) -> bool:
        """Return whether something may be put there."""
        x0, x1, y0, y1 = self.bounds
        slack = 1e-6
        return x0 - slack <= x <= x1 + slack and y0 - slack <= y <= y1 + slack


def _with_row(positions: Any, index: int, row: tuple[float, float, float]) -> Any:
    changed = positions.copy()
    changed[index] = row
    return changed


def board(
    blocks: Sequence[tuple[str, str, int, int, int]], held: int | None = None, front: str = "near", **more
) -> WorldModel:
    """Return the world of a board of 8 x 8 cells.

    Args:
        blocks: kind, colour, x (cells away from the robot), y (cells to its left), z (height in blocks, from 0).
        held: the index of the block in the gripper.
        front: the side that "front" means, "near" or "far".
        more: other fields of `WorldModel`.
    """
    things = tuple(Thing(kind, color, x, y, z, z + 1, 1.0) for kind, color, x, y, z in blocks)
    last = BOARD_CELLS - 1.0
    fields = {"pitch": 1.0, "little": 1.0, "ceiling": float(BOARD_HEIGHT), "cells": True}
    return WorldModel(things, (0.0, last, 0.0, last), held=held, front=front, **{**fields, **more})  # type: ignore[arg-type]


def table(scene: Scene, held: int | None = None, **more) -> WorldModel:
    """Return the world of a table's scene, in metres.

    more: other fields of `WorldModel`, such as `bounds`, `inside` and `open`.
    """
    objects = list(scene)
    things = tuple(
        Thing(
            o.noun,
            o.color,
            o.position[0],
            o.position[1],
            o.position[2] - o.size / 2,
            o.position[2] + o.size / 2 * (o.noun != HAND),  # its position is that of its surface
            o.size,
            o.role == "target",
        )
        for o in objects
    )
    loose = [thing.bottom for i, thing in enumerate(things) if i != held and thing.kind not in FIXED]
    ground = min(loose, default=0.0)
    x0, x1, y0, y1 = TABLE
    bounds = (
        min([x0, *(thing.x for thing in things)]),
        max([x1, *(thing.x for thing in things)]),
        min([y0, *(thing.y for thing in things)]),
        max([y1, *(thing.y for thing in things)]),
    )
    fields: dict[str, Any] = {"bounds": bounds, "pitch": TABLE_STEP, "little": LITTLE, "ground": ground}
    return WorldModel(things, held=held, **{**fields, "viewpoint": scene.viewpoint, "scene": scene, **more})


def _supports(world: WorldModel) -> tuple[tuple[int | None, ...], tuple[int | None, ...]]:
    """Return the things directly below and above each thing, or None."""
    below: list[int | None] = [None] * len(world.things)
    above: list[int | None] = [None] * len(world.things)
    for together in world._standing.values():
        for i in together:
            for j in together:
                if world.things[j].kind not in FIXED and _stands_on(world.things[i], world.things[j]):
                    below[i], above[j] = j, i
    return tuple(below), tuple(above)


def _stands_on(thing: Thing, other: Thing) -> bool:
    near = 0.6 * max(thing.width, other.width)
    return (
        thing.bottom > other.bottom
        and abs(thing.bottom - other.top) < 0.3 * other.width
        and abs(thing.x - other.x) < near
        and abs(thing.y - other.y) < near
    )

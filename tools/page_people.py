"""Scripted people at the page: what they want, the circumstances in which they say it, and their words.

They use what the page uses: `Session.say`, `put_object`, `point_at`, `go_where_pointed` and `shuffle`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from demo import board
from demo.room import in_words, room_of
from demo.session import Session
from envs.tasks import NOTHING
from envs.tasks.push import MARGIN
from envs.tasks.shared.feasible import options
from envs.tasks.shared.free_places import BESIDE
from envs.tasks.shared.geometry import CLEAR, distance_to_segment
from human import Unreachable
from language import DEFAULT_KINDS, HAND, Describer, LanguageError, Plan, Scene

IDLE = (2, 20)  # control steps between two things that a person does
CORRECTED = (2, 25)  # control steps from a sentence to its correction
PLACES = 100  # that are drawn for an object before another scene is
SCENES = 50  # that are drawn for an instruction
DRAGS = (1, 2)  # least and greatest number of objects that are dragged
WAY = 5  # places on the way of an object that is dragged
ASIDE = 0.3  # sizes of an object beside its middle to which a finger points, standard deviation
SQUARES = ("one square", "two squares", "three squares")
# Columns and rows of a square beside a block, as somebody sees it who stands opposite the robot.
BESIDE_BLOCK = {"to the left of": (0, -1), "to the right of": (0, 1), "in front of": (1, 0), "behind": (-1, 0)}
ABOVE = 0.2  # metres over the table to which a finger wanders, at most


@dataclass(frozen=True)
class Wish:
    """What a person wants.

    verb: a key of language.VERBS. referent, target: numbers in the scene. place: (3,) metres, where the referent is to
    go if a see-through object marks that; None: at no place, or where the target is. where: on a board, words for the
    place, with {} for the target's name.
    """

    verb: str
    referent: int
    target: int | None = None
    place: tuple[float, float, float] | None = None
    where: str = ""


class NotPossible(Exception):
    """Nothing fits these circumstances in this scene."""


@dataclass
class Script:
    """One person at a session, in one circumstance after another.

    rng: draws what they want. said: the last sentence. refusal: what the page answered in place of doing it, or "".
    """

    session: Session
    rng: Generator
    said: str = ""
    refusal: str = ""

    def circumstances(self) -> dict[str, Callable[[], Wish]]:
        """The circumstances that this session has, by name. Each begins what the person wants, and returns it."""
        env, task = self.session.env, self.session.env.task
        known = {
            "fresh scene": self._fresh,
            "after another": self._after_another,
            "objects dragged": self._dragged,
            "corrected": self._corrected,
            "full names": self._full_names,
        }
        if env.has_person and not task.traits.stacks:
            known["pointing"] = self._pointing
            if not (task.traits.places or task.verbs):
                known["button"] = self._button
        return known

    # ---- Circumstances

    def _fresh(self) -> Wish:
        self._new_scene()
        return self._say(self._wish())

    def _after_another(self) -> Wish:
        """Say something after what was done before, in the scene as that has left it."""
        self._wait()
        return self._say(self._wish())

    def _dragged(self) -> Wish:
        self._new_scene()
        self.drag()
        return self._say(self._wish())

    def _corrected(self) -> Wish:
        """Say one thing, and another one in mid-motion."""
        self._new_scene()
        first = self._wish()
        others = [each for each in self.wishes() if (each.verb, each.target) == (first.verb, first.target)]
        others = [each for each in others if each.referent != first.referent]
        if self.session.env.task.traits.stacks:
            others = [each for each in self.wishes() if each.referent == first.referent and each.place != first.place]
        if not others:
            raise NotPossible
        then = others[self.rng.integers(len(others))]
        self._say(first)
        self._steps(int(self.rng.integers(*CORRECTED)))
        self._tell(self._correction(then))
        return then

    def _full_names(self) -> Wish:
        self._new_scene()
        wish, names = self._wish(), self.session.object_names()
        self._tell(self._sentence(wish, names))
        return wish

    def _pointing(self) -> Wish:
        """Say "this" of an object at which the finger points, from wherever it pointed before."""
        self._new_scene()
        wish = self._wish()
        self.point(wish.referent)
        names = self._words()
        names[wish.referent] = "this"
        self._tell(self._sentence(wish, names))
        return wish

    def _button(self) -> Wish:
        self._new_scene()
        wish = self._wish()
        self.point(wish.referent)
        self.said, self.refusal = "Go where I point", ""
        try:
            self.session.go_where_pointed()
        except LanguageError as error:
            self.refusal = str(error)
        return wish

    # ---- What a person does

    def _new_scene(self) -> None:
        self.session.shuffle(int(self.rng.integers(2**31)))
        self._wait()

    def _wait(self) -> None:
        for _ in range(int(self.rng.integers(*IDLE))):
            self.session.step()

    def _steps(self, most: int) -> None:
        for _ in range(most):
            if self.session.busy:
                self.session.step()

    def drag(self) -> None:
        """Drag one or two objects to places that are free, and wait until they rest. Raises NotPossible."""
        for index in self._order(self._loose())[: int(self.rng.integers(DRAGS[0], DRAGS[1] + 1))]:
            start, end = self.session.scene().positions[index, :2].copy(), self._free_place(index)
            for share in np.linspace(0.0, 1.0, WAY + 1)[1:]:
                self.session.put_object(index, start + share * (end - start))
        self._wait()

    def point(self, index: int) -> None:
        """Point somewhere, then at an object, with a finger that is steady. Raises NotPossible."""
        scene, area = self.session.scene(), self.session.env.config.workspace.object_area
        low, high = np.append(np.reshape(area, (2, 2)).T, [[0.0], [ABOVE]], axis=1)
        with suppress(Unreachable):
            self.session.point_at(self.rng.uniform(low, high))
        self._wait()
        aside = self.rng.normal(0.0, ASIDE * scene[index].size / 2, 3)
        try:
            self.session.point_at(scene.positions[index] + aside)
        except Unreachable:
            raise NotPossible from None
        self._wait()

    def _tell(self, sentence: str) -> None:
        outcome = self.session.say(sentence)
        obeyed = isinstance(outcome, Plan) and bool(outcome.steps)
        self.said, self.refusal = sentence, "" if obeyed else f"{type(outcome).__name__}: {outcome.message}"

    def _say(self, wish: Wish) -> Wish:
        self._tell(self._sentence(wish, self._words()))
        return wish

    # ---- Words

    def _words(self) -> list[str]:
        """A name for each object, of a kind of phrase that the policy was trained with where one fits."""
        scene, names = self.session.scene(), self.session.object_names()
        if self.session.env.task.traits.stacks:
            return names
        describer = Describer(tuple(self.session.env.config.task.kinds) or DEFAULT_KINDS)
        for index in np.flatnonzero(describer.nameable(scene)).tolist():
            names[index] = str(describer.phrase(scene, index, self.rng))
        return names

    def _sentence(self, wish: Wish, names: list[str]) -> str:
        if self.session.env.task.traits.stacks:
            return f"put {names[wish.referent]} {wish.where.format(names[wish.target or 0])}"
        return in_words(wish.verb, names[wish.referent], None if wish.target is None else names[wish.target])

    def _correction(self, wish: Wish) -> str:
        scene, names = self.session.scene(), self.session.object_names()
        if self.session.env.task.traits.stacks:
            return f"no, {wish.where.format(names[wish.target or 0])}"
        color = scene[wish.referent].color
        alone = sum(thing.color == color for thing in scene) == 1
        return f"no, the {color} one" if alone else f"no, {names[wish.referent]}"

    # ---- What can be wanted

    def _wish(self) -> Wish:
        """One of the wishes, each verb as often. Raises NotPossible."""
        known = self.wishes()
        verbs = sorted({each.verb for each in known})
        if not verbs:
            raise NotPossible
        verb = verbs[self.rng.integers(len(verbs))]
        chosen = [each for each in known if each.verb == verb]
        if self.session.env.task.traits.stacks:  # half of them on blocks, half in free cells
            on = bool(self.rng.integers(2))
            chosen = [each for each in chosen if each.where.startswith("on") == on] or chosen
        return chosen[self.rng.integers(len(chosen))]

    def wishes(self) -> list[Wish]:
        """All that can be done now with objects that have names."""
        env, names = self.session.env, self.session.object_names()
        named = [index for index, name in enumerate(names) if name.startswith("the ") and " at " not in name]
        if env.task.traits.stacks:
            return list(self._on_board(named))
        if env.task.verbs:
            return list(self._in_room(named))
        scene = self.session.scene()
        real = [index for index in self._loose() if index in named]
        if not env.task.traits.places:
            return [Wish(env.task.verb, index) for index in real]
        free = [index for index in named if scene.targets[index] and not self._stands_at(scene, index)]
        pairs = [(index, target) for index in real for target in free]
        pairs = [each for each in pairs if env.task.traits.grips or self._way_is_free(scene, *each)]
        return [Wish(env.task.verb, index, target, scene[target].position) for index, target in pairs]

    def _in_room(self, named: list[int]) -> Iterator[Wish]:
        env, scene = self.session.env, self.session.scene()
        held = NOTHING if env.held is None else env.held
        for verb, referent, target in options(room_of(env), held):
            if referent not in named:
                continue
            if target is None:
                yield Wish(verb, referent)
            elif target in named or scene[target].noun == HAND:
                yield Wish(verb, referent, target, scene[target].position if scene.targets[target] else None)

    def _on_board(self, named: list[int]) -> Iterator[Wish]:
        """Each block that nothing stands on: to another one that is flat, and to free cells."""
        env, scene, shapes = self.session.env, self.session.scene(), self.session.env.shapes()
        grid, blocks = board.grid_of(env), board.movable(env)
        cells = dict(zip(blocks.tolist(), grid.cells(scene.positions[blocks]).tolist(), strict=True))
        tops = [i for i, (x, y, z) in cells.items() if [x, y, z + 1] not in cells.values()]
        full = {(x, y) for x, y, _ in cells.values()}
        for referent, target in itertools.permutations([each for each in named if each in cells], 2):
            x, y, z = cells[target]
            if referent not in tops:
                continue
            if target in tops and shapes[target] == "cube" and z + 1 < env.config.task.levels:
                yield self._to_cell(referent, target, (x, y, z + 1), "on {}")
            for words, (dx, dy) in BESIDE_BLOCK.items():
                for count, number in enumerate(SQUARES, start=1):
                    at = x + count * dx, y + count * dy
                    if at not in full and 0 <= at[0] < grid.columns and 0 <= at[1] < grid.rows:
                        yield self._to_cell(referent, target, (*at, 0), f"{number} {words} {{}}")

    def _to_cell(self, referent: int, target: int, cell: tuple[int, int, int], where: str) -> Wish:
        x, y, z = board.grid_of(self.session.env).place(*cell).tolist()
        return Wish("pick_and_place", referent, target, (x, y, z), where)

    # ---- Places

    def _loose(self) -> list[int]:
        """The objects on the table that a person can drag, with nothing on them."""
        env, scene = self.session.env, self.session.scene()
        loose = [index for index, body in enumerate(env.bodies()) if body is not None and not scene.targets[index]]
        if env.task.verbs:
            return [index for index in loose if room_of(env).ready[index]]
        if env.task.traits.stacks:
            return sorted({wish.referent for wish in self.wishes()})
        x0, x1, y0, y1 = env.config.workspace.object_area
        places = scene.positions
        return [i for i in loose if x0 <= places[i, 0] <= x1 and y0 <= places[i, 1] <= y1]

    def _free_place(self, index: int) -> NDArray[np.float64]:
        """(2,) metres: where objects may stand, as far from all others as in drawn scenes. Raises NotPossible."""
        env, scene = self.session.env, self.session.scene()
        low, high = np.reshape(env.config.workspace.object_area, (2, 2)).T
        others = np.delete(scene.positions[:, :2], index, axis=0)
        for _ in range(PLACES):
            place = self.rng.uniform(low, high)
            if (np.linalg.norm(others - place, axis=1) >= env.config.task.spacing).all():
                return place
        raise NotPossible

    def _way_is_free(self, scene: Scene, index: int, target: int) -> bool:
        """Whether an object can be pushed straight to a target, as all that evaluations draw: people see it."""
        low, high = np.reshape(self.session.env.config.workspace.object_area, (2, 2)).T
        start, end = scene.positions[index, :2], scene.positions[target, :2]
        others = scene.positions[~scene.targets & (np.arange(len(scene)) != index), :2]
        apart = distance_to_segment(others, start, end)
        return bool(((start >= low + MARGIN) & (start <= high - MARGIN)).all() and (apart >= CLEAR).all())

    @staticmethod
    def _stands_at(scene: Scene, target: int) -> bool:
        """Whether an object stands at a see-through one."""
        apart = np.linalg.norm(scene.positions[~scene.targets, :2] - scene.positions[target, :2], axis=1)
        return bool((apart < BESIDE * scene[target].size).any())

    def _order(self, indices: list[int]) -> list[int]:
        return [indices[at] for at in self.rng.permutation(len(indices))]


def begin(script: Script, circumstance: str) -> Wish:
    """Begin what a person wants in a circumstance, in another scene where this one has nothing that fits."""
    known = script.circumstances()
    names = [circumstance] + ["fresh scene"] * (circumstance == "after another")
    for name in (names * SCENES)[:SCENES]:
        with suppress(NotPossible):
            return known[name]()
    raise RuntimeError(f"no scene of {SCENES} has something for '{circumstance}'")

"""What a first visitor types into the page, in four scenes, and what comes of it.

    pip install -e ".[test]"                                      # and Chromium of the system
    python -m benchmarks.visitor run benchmarks/visits/first.jsonl --out said.jsonl [--scene room]
    python -m benchmarks.visitor count said.jsonl                 # after a person has filled in the verdicts

A list has, for each input, its scene, what is typed, and what would be right: "done", "answered", "asked" or
"refused", and in words what a person expects. `moving`: it is typed while the arm carries out the input before;
`click`: pixels of the page at 1280 x 800 where the visitor clicks before typing. `run` types the inputs of a scene one
after another into the page in a browser, and writes beside each the lines of the page's log and what has changed in
the simulator, with an empty verdict. A person reads them and writes a verdict, a key of `VERDICTS`; `count` adds up.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from core.system import system_info
from demo import worlds
from demo.page import Page
from demo.page_gate import PageGate
from demo.session import Session
from demo.session_config import make_config
from demo.splash_page import open_splash_page
from language.talk import name
from tools.browser import PageTab, free_port, headless_browser

SCENES = {  # choices of play.py
    "room": {"task": "anything"},
    "table": {"task": "nl_reach", "workspace": "collabtable"},
    "board": {"task": "rearrange"},
    "pick": {"task": "nl_pick_and_place"},
    "stack": {"task": "nl_stack"},
    "pointing": {"task": "nl_reach_gesture"},
}
SEED = 3  # of the scenes that the lists were written for
VERDICTS = {
    "done": "the motion that was meant",
    "answered": "a true answer",
    "asked": "a question that was right to ask",
    "refused": "a refusal that names the true reason, or the words that were not understood, and what can be said",
    "failed": "the right plan, which the arm did not carry out, as the page says",
    "unhelpful": "a refusal, answer or question that leaves the visitor where they were",
    "wrong": "another motion, a part of what was asked for, or a false statement",
}
RIGHT = ("done", "answered", "asked")
MOVED = 0.01  # metres
NEAR = 0.12  # metres between the gripper and what it is at
MOVING_STEPS = 6  # control steps after which an arm is in motion
PATIENCE = 120.0  # seconds for an input
REPLY = "n => document.querySelectorAll('.entry').length > n"


@contextmanager
def served(choices: dict[str, str], speed: float) -> Iterator[tuple[Page, Session, str]]:
    """Yield the page of play.py with these choices, its session and its address; it runs in a thread of its own."""
    from demo.guarded_server import PageParts

    host, port = "127.0.0.1", int(free_port())
    gate, parts = PageGate(host, port, []), PageParts()
    server = open_splash_page(host, port, gate, parts)
    session = Session(make_config(**choices), SEED)
    session.set_viewpoint("human")
    page = Page(server, session, parts)
    page.loop.speed = speed
    thread = threading.Thread(target=page.loop.run)
    thread.start()
    try:
        yield page, session, gate.address
    finally:
        page.loop.stop()
        thread.join()
        page.close()
        session.close()
        server.stop()


class Visit:
    """The inputs of one scene, typed one after another.

    Args:
        page: that is served.
        session: of the page.
        tab: of the browser.
        speed: of the clock, as a multiple of real time.
    """

    def __init__(self, page: Page, session: Session, tab: PageTab, speed: float) -> None:
        self._page, self._session, self._tab, self._speed = page, session, tab, speed

    def type(self, item: dict[str, Any], interrupted: bool) -> dict[str, Any]:
        """Type an input and return it with what came of it. interrupted: the next one is typed in mid-motion."""
        before, entries, start_time = self._facts(), self._tab.tab.locator(".entry").count(), time.monotonic()
        if "click" in item:
            self._tab.tab.mouse.click(*item["click"])
            time.sleep(1)
        self._tab.say(item["say"])
        self._tab.tab.wait_for_function(REPLY, arg=entries)
        self._wait(interrupted)
        self._page.loop.speed = self._speed  # which "faster" has changed
        after = self._facts()
        log = [entry.inner_text() for entry in self._tab.tab.locator(".entry").all()[entries:]]
        seconds = round(time.monotonic() - start_time, 1)
        return item | {"log": log, "world": changes(before, after), "seconds": seconds, "verdict": ""}

    def _wait(self, interrupted: bool) -> None:
        """Wait until the arm is at rest or, before an interruption, in motion."""
        start_time, first = time.monotonic(), self._ask(lambda session: session.steps)
        while time.monotonic() - start_time < PATIENCE:
            time.sleep(0.1)
            busy, steps = self._ask(lambda session: (session.busy or session._goes_home, session.steps))
            if busy and interrupted and steps - first > MOVING_STEPS:
                return
            if not busy:
                break
        time.sleep(0.7)  # until the page has shown it

    def _facts(self) -> dict[str, Any]:
        return self._ask(facts)

    def _ask(self, question: Callable[[Session], Any]) -> Any:
        """Return what a function says of the session, in the loop's thread."""
        answers: list[Any] = []
        asked = threading.Event()

        def ask(session: Session) -> None:
            answers.append(question(session))
            asked.set()

        self._page.loop.ask(ask)
        asked.wait(PATIENCE)
        return answers[0]


def facts(session: Session) -> dict[str, Any]:
    """Return what a person sees of a scene: where things are, what holds what, and where the gripper is."""
    world = worlds.world_of(session.env, session.scene(), session._home)
    names = [name(world, index) for index in range(len(world.things))]
    places = {index: np.array([thing.x, thing.y, thing.bottom]) for index, thing in enumerate(world.things)}
    gripper = session.env.gripper[0]
    near = min(places, key=lambda index: float(np.linalg.norm(places[index] - gripper)))
    at = names[near] if np.linalg.norm(places[near] - gripper) < NEAR else "nothing"
    return {
        "names": names,
        "places": {index: place.round(3).tolist() for index, place in places.items()},
        "held": None if world.held is None else names[world.held],
        "inside": {names[thing]: names[box] for thing, box in world.inside.items()},
        "open": sorted(names[index] for index in world.open),
        "moved": {names[index]: round(share, 1) for index, share in world.moved.items()},
        "gripper": [*gripper.round(2).tolist(), f"at {at}"],
    }


def changes(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Return what differs between two states of a scene, in words. Metres: x from the robot, y to its left, z."""
    found = []
    for index, place in after["places"].items():
        old = before["places"].get(index)
        if old is not None and np.abs(np.subtract(place, old)).max() > MOVED:
            found.append(f"{before['names'][index]}: {old} -> {place}")
    for key in ("held", "inside", "open", "moved"):
        if before[key] != after[key]:
            found.append(f"{key}: {before[key]} -> {after[key]}")
    return [*found, f"gripper: {after['gripper']}"]


def run(args: argparse.Namespace) -> None:
    """Type a list into the page, print and write what came of it."""
    items = [json.loads(line) for line in args.list.read_text().splitlines()]
    written = []
    for scene, choices in SCENES.items():
        mine = [item for item in items if item["scene"] == scene and args.scene in (None, scene)]
        if not mine:
            continue
        with headless_browser() as browser, served(choices, args.speed) as (page, session, address):
            visit = Visit(page, session, PageTab(browser, address, blank=True), args.speed)
            for item, after in zip(mine, [*mine[1:], {}], strict=True):
                said = visit.type(item, bool(after.get("moving")))
                written.append(said)
                print(as_text(said), flush=True)
    args.out.write_text("".join(f"{json.dumps(said, ensure_ascii=False)}\n" for said in written))


def as_text(said: dict[str, Any]) -> str:
    """Return an input with what is right for it and what came of it, for a person to read."""
    log = " // ".join(entry.replace("\n", " | ") for entry in said["log"])
    right = f"right: {'/'.join(said['right'])}: {said['meant']}"
    return f"{said['id']} {said['say']!r}\n  {right}\n  page:  {log}\n  world: {'; '.join(said['world'])}"


def count(args: argparse.Namespace) -> None:
    """Print how many inputs have each verdict."""
    said = [json.loads(line) for line in args.list.read_text().splitlines()]
    missing = [each["id"] for each in said if each["verdict"] not in VERDICTS]
    if missing:
        sys.exit(f"error: {args.list}: no verdict ({', '.join(VERDICTS)}) for {', '.join(missing)}")
    for scene in (*SCENES, "all"):
        mine = [each["verdict"] for each in said if scene in ("all", each["scene"])]
        counts = {verdict: mine.count(verdict) for verdict in VERDICTS}
        right = sum(counts[verdict] for verdict in RIGHT)
        shares = f"done, answered or rightly asked {right / len(mine):.1%}" if mine else ""
        print(f"{scene:6s} {len(mine):3d} " + " ".join(f"{key} {n:2d}" for key, n in counts.items()), shares)
    print(json.dumps({"machine": system_info()}))


def main() -> None:
    """Run a list, or count the verdicts of one."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=["run", "count"])
    options.add_argument("list", type=Path, help="a list of inputs, or what `run` wrote")
    options.add_argument("--out", type=Path, help="of run: inputs with what came of them")
    options.add_argument("--scene", choices=list(SCENES), help="of run: this one alone")
    options.add_argument("--speed", type=float, default=1.0, help="of run: of the clock")
    args = options.parse_args()
    if args.what == "count":
        count(args)
        return
    if args.out is None:
        options.error("run requires --out, a JSONL file")
    run(args)


if __name__ == "__main__":
    main()

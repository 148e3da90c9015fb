"""The page of play.py in a browser: time to load and to move, success of typed sentences, robustness.

    pip install -e ".[test]"                               # and Chromium of the system
    python -m benchmarks.page start                        # time to the page and to the first motion, and the clock
    python -m benchmarks.page motion                       # time to motion without a browser
    python -m benchmarks.page said --count 100             # success of sentences that are typed into the page
    python -m benchmarks.page hostile --minutes 30         # random and hostile text, clicks, choices, reloads; memory
    python -m benchmarks.page film --seed 7 --out outputs/said.gif  # a sentence and its correction

Arguments after `--` go to play.py. `start` counts from the start of the process. A motion counts from the press of
Enter to the status that the page shows after the step, by which time the arm has moved.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.commands import WRITERS
from core.system import system_info
from demo.real_time_loop import RealTimeLoop
from demo.session import Session
from demo.session_config import make_config
from tools.browser import TIMEOUT, WIDE, PageTab, PlayServer, headless_browser
from tools.random_scenes import random_scene
from trainers.evaluation.evaluation import wilson

MIN_MOTION = 0.001  # metres of the gripper
DRAWING_TIME = 1.0  # seconds for a browser without a graphics card to draw a step
ACTION_WEIGHTS = {
    "type": 40,
    "enter": 40,
    "button": 10,
    "click": 20,
    "key": 20,
    "reload": 1,
    "second tab": 1,
    "change": 1,
}
KEYS = ("ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "PageUp", "PageDown", "Escape", "Tab")
CHANGES = {"Robot": ("kuka", "panda", "jaco"), "Driven by": ("expert", "hand")}  # a policy may be missing
OBSERVE_MOTION = """() => {
    document.addEventListener("keydown", e => { if (e.key === "Enter") window.pressed = performance.now() }, true);
    window.moved = null;
    new MutationObserver((_, watcher) => {
        if (!document.getElementById("now").textContent) return;
        window.moved = performance.now() - window.pressed;
        watcher.disconnect();
    }).observe(document.body, {subtree: true, childList: true, characterData: true});
}"""


def start(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the seconds to the page, milliseconds to first motions, and the speed of the clock meanwhile."""
    with headless_browser() as browser:
        start_time = time.perf_counter()
        server = PlayServer(*args.words)
        seconds_to_answer = time.perf_counter() - start_time
        page = PageTab(browser, server.address)
        seconds_to_page = time.perf_counter() - start_time
        motions, clocks = [], []
        for _ in range(args.count):
            name = page.object_names()[0]
            page.tab.evaluate(OBSERVE_MOTION)
            page.say(f"reach {name}")
            page.tab.wait_for_function("window.moved !== null")
            motions.append(page.tab.evaluate("window.moved"))
            page.wait_for_turn("Done in|Not done")
            clocks.append(page.clock())
            page.press("New scene")
            page.wait_for_turn("This is a new scene")
        server.close()
    quantiles, clock = [float(np.median(motions)), max(motions)], [min(clocks), max(clocks)]
    times = {"seconds_to_answer": seconds_to_answer, "seconds_to_page": seconds_to_page}
    return {**times, "first_motion_ms_median_worst": quantiles, "clock_least_most": clock}


def motion(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the milliseconds from a sentence to a gripper that has moved, in the page's loop, without a browser."""
    rng, session = np.random.default_rng(args.seed), Session(make_config(), args.seed)
    moved, rest = threading.Event(), session.env.gripper[0].copy()

    def on_step(session: Session) -> None:
        if np.linalg.norm(session.env.gripper[0] - rest) > MIN_MOTION:
            moved.set()

    loop, motions = RealTimeLoop(session, on_step, print), []
    thread = threading.Thread(target=loop.run)
    thread.start()
    for _ in range(args.count):
        loop.ask(Session.shuffle)
        time.sleep(1 + rng.random() * session.period)
        rest[:] = session.env.gripper[0]
        moved.clear()
        start_time = time.perf_counter()
        loop.ask(lambda session: session.say(session.example()))
        moved.wait(TIMEOUT)
        motions.append(1000 * (time.perf_counter() - start_time))
    loop.stop()
    thread.join()
    session.close()
    return {"median_ms": float(np.median(motions)), "worst_ms": max(motions)}


def said(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the outcomes of sentences that are typed into the page, each in another scene."""
    rng, ends = np.random.default_rng(args.seed), []
    server = PlayServer("--seed", str(args.seed), *args.words)
    with headless_browser() as browser:
        page = PageTab(browser, server.address)
        for _ in range(args.count):
            names = page.object_names()
            ends.append(page.say_and_wait(f"reach {names[rng.integers(len(names))]}"))
            page.press("New scene")
            page.wait_for_turn("This is a new scene")
    server.close()
    done = ends.count("Done")
    failed = {end: ends.count(end) for end in sorted(set(ends)) if end != "Done"}
    return {"count": len(ends), "success": done / len(ends), "ci95": list(wilson(done, len(ends))), "failed": failed}


def hostile(args: argparse.Namespace) -> dict[str, Any]:
    """Act at random for some minutes; count exceptions, and measure the memory each minute."""
    rng = np.random.default_rng(args.seed)
    server = PlayServer("--seed", str(args.seed), *args.words)
    counts, weights = dict.fromkeys(ACTION_WEIGHTS, 0), np.array(list(ACTION_WEIGHTS.values()))
    shares = weights / weights.sum()
    with headless_browser() as browser:
        page = PageTab(browser, server.address)
        for robot in CHANGES["Robot"]:  # the meshes of each are loaded once
            page.choose("Robot", robot)
            page.wait_for_turn(f"robot {robot}")
            page.say_and_wait(f"reach {page.object_names()[0]}")
        memory, start_time = [server.megabytes()], time.monotonic()
        while time.monotonic() - start_time < 60 * args.minutes:
            action = str(rng.choice(list(ACTION_WEIGHTS), p=shares))
            page = _act(action, page, browser, server.address, rng)
            counts[action] += 1
            if time.monotonic() - start_time > 60 * len(memory):
                memory.append(server.megabytes())
                print(f"{len(memory) - 1} min: {memory[-1]:.0f} MB", file=sys.stderr)
        page.tab.reload()
        page.wait_until_ready()
    errors = server.close()
    return {
        "minutes": args.minutes,
        "actions": counts,
        "exit_code": server.process.returncode,
        "exceptions": errors.count("Traceback"),
        "first": errors[errors.find("Traceback") :][:2000] if "Traceback" in errors else "",
        "megabytes": [round(each, 1) for each in memory],
        "grew": max(memory) / memory[0] - 1,
    }


def _act(action: str, page: PageTab, browser: Any, address: str, rng: np.random.Generator) -> PageTab:
    """Act once, and return the page for the next action: a second tab replaces the first."""
    if action in ("type", "enter"):
        text = WRITERS[rng.integers(len(WRITERS))](rng, random_scene(3, rng))
        text = text.encode("utf-8", "replace").decode()  # a browser cannot type lone surrogates
        (page.type_sentence if action == "type" else page.say)(text)
    elif action == "button":
        page.press(str(rng.choice(["Stop", "New scene", "Go where I point"])))
    elif action == "click":
        page.tab.mouse.click(*rng.integers(20, 480, 2).tolist())  # left of the panel
    elif action == "key":
        page.tab.keyboard.press(str(rng.choice(KEYS)))
    elif action == "reload":
        page.tab.reload()
        page.wait_until_ready()
    elif action == "second tab":
        other = PageTab(browser, address)
        page.tab.close()
        return other
    else:
        label = str(rng.choice(list(CHANGES)))
        page.choose(label, str(rng.choice(CHANGES[label])))
    return page


def film(args: argparse.Namespace) -> dict[str, Any]:
    """Make a GIF of a sentence and its correction during motion, with a picture every second control step."""
    server = PlayServer("--seed", str(args.seed), *args.words)
    pictures: list[Image.Image] = []
    with headless_browser() as browser:
        page = PageTab(browser, server.address, sharp=True)

        def step(times: int) -> None:
            for _ in range(times):
                for _ in range(2):
                    page.press("One step")
                time.sleep(DRAWING_TIME)
                pictures.append(Image.open(io.BytesIO(page.tab.screenshot())))

        names = page.object_names()
        page.open_lab("Clock")
        page.tab.get_by_label("Pause").click()
        page.type_sentence(f"reach {names[0]}")
        step(2)
        page.say(f"reach {names[0]}")
        step(5)
        page.type_sentence(f"no, {names[-1]}")
        page.say(f"no, {names[-1]}")
        step(14)
    server.close()
    small = [picture.convert("RGB").resize((WIDE[0] * 3 // 4, WIDE[1] * 3 // 4)) for picture in pictures]
    palette = small[-1].quantize(256, Image.Quantize.MAXCOVERAGE)  # so that small objects keep their colours
    colors = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in small]
    colors[0].save(args.out, save_all=True, append_images=colors[1:], duration=150, loop=0)
    return {"pictures": len(colors), "bytes": args.out.stat().st_size}


def main() -> None:
    """Measure one thing and print the result as JSON."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=list(COMMANDS))
    options.add_argument("words", nargs="*", default=["task=nl_reach"], help="arguments for play.py, after --")
    options.add_argument("--count", type=int, default=20, help="sentences")
    options.add_argument("--minutes", type=float, default=30.0)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--out", type=Path, help="the GIF of film")
    args = options.parse_args()
    if args.count < 1 or args.minutes <= 0 or args.seed < 0:
        options.error("--count must be at least 1, --minutes greater than 0, --seed at least 0")
    if args.what == "film" and args.out is None:
        options.error("film requires --out, a GIF")
    print(json.dumps({"machine": system_info(), args.what: COMMANDS[args.what](args)}, indent=1))


COMMANDS = {"start": start, "motion": motion, "said": said, "hostile": hostile, "film": film}

if __name__ == "__main__":
    main()

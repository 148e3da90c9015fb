"""The page of play.py: time to load and to move, success of typed sentences, robustness.

    pip install -e ".[test]"                               # and Chromium of the system
    python -m benchmarks.page start                        # time to the page and to the first motion, and the clock
    python -m benchmarks.page motion                       # time to motion without a browser
    python -m benchmarks.page said --count 100             # success of sentences that are typed into the page
    python -m benchmarks.page hostile --minutes 30         # random and hostile text, clicks, choices, reloads; memory
    python -m benchmarks.page clients --count 200          # hostile programs, in turn and 20 at once
    python -m benchmarks.page film --seed 7 --out outputs/said.gif  # a sentence and its correction

Arguments after `--` go to play.py. `start` counts from the start of the process. A motion counts from the press of
Enter to the status that the page shows after the step, by which time the arm has moved. The last line is JSON.
"""

from __future__ import annotations

import argparse
import io
import json
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
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
from tools.hostile_messages import send_hostile_messages
from tools.page_client import PageClient
from tools.random_scenes import random_scene
from trainers.evaluation.evaluation import wilson

MIN_MOTION = 0.001  # metres of the gripper
AT_ONCE, MESSAGES = 20, 20  # clients; messages of each
ANSWERED = 20  # sentences of a person after the clients
SETTLED = 6.0  # seconds after which the page has measured its clock anew
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
    return {
        "seconds_to_answer": seconds_to_answer,
        "seconds_to_page": seconds_to_page,
        "motion_median_ms": float(np.median(motions)),
        "motion_worst_ms": max(motions),
        "clock_least": min(clocks),
        "clock_most": max(clocks),
    }


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
        "megabytes": [round(each, 1) for each in memory],
        "grew": max(memory) / memory[0] - 1,
        **_failures(server, errors),
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


def clients(args: argparse.Namespace) -> dict[str, Any]:
    """Have programs send hostile messages, one after another, then many at once; then say sentences as a person."""
    server = PlayServer("--seed", str(args.seed), *args.words)

    def visit(number: int) -> int:
        return send_hostile_messages(np.random.default_rng([args.seed, number]), server.address, MESSAGES)

    def visits(first: int, count: int, at_once: int) -> int:
        """Have clients visit while the person looks on. Return how often the page has closed a socket of theirs."""
        with ThreadPoolExecutor(at_once) as pool:
            each = [pool.submit(visit, number) for number in range(first, first + count)]
            while not all(future.done() for future in each):
                person.listen(0.1)
        return sum(future.result() for future in each)

    with PageClient(server.address) as person:
        person.wait_until_ready()
        _load_everything(person)
        visits(0, AT_ONCE, 1)
        before = server.megabytes()
        closed = visits(AT_ONCE, args.count, 1) + visits(AT_ONCE + args.count, AT_ONCE, AT_ONCE)
        person.start_over()
        names = person.names()
        answered = [person.say_and_wait(f"reach {names[number % len(names)]}") for number in range(ANSWERED)]
        person.listen(SETTLED)
        grew, clock = server.megabytes() / before - 1, person.sections["clock"]["rate"]
    errors = server.close()
    return {
        "clients": args.count + AT_ONCE,
        "messages": (args.count + AT_ONCE) * MESSAGES,
        "closed_by_the_page": closed,
        "answered": sum(answer.startswith("Done") for answer in answered),
        "sentences": ANSWERED,
        "clock": clock,
        "grew": grew,
        **_failures(server, errors),
    }


def _load_everything(person: PageClient) -> None:
    """Use what is loaded at its first use: the network that sees, a policy beside the expert, writers of data sets."""
    for name in ("looks", "compares"):
        person.send("flag", name=name, value=True)
    person.say_and_wait(f"reach {person.names()[0]}")
    for kind in ("lerobot", "minari"):
        person.send("export", kind=kind)
    person.listen(SETTLED)
    for name in ("looks", "compares"):
        person.send("flag", name=name, value=False)


def _failures(server: PlayServer, errors: str) -> dict[str, Any]:
    """Return how a server has ended, and the exceptions in what it wrote."""
    return {
        "exit_code": server.process.returncode,
        "exceptions": errors.count("Traceback"),
        "first": errors[errors.find("Traceback") :][:2000] if "Traceback" in errors else "",
    }


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
    """Measure one thing and print the result as a line of JSON."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=list(COMMANDS))
    options.add_argument("words", nargs="*", default=["task=nl_reach"], help="arguments for play.py, after --")
    options.add_argument("--count", type=int, default=20, help="sentences; of clients: clients")
    options.add_argument("--minutes", type=float, default=30.0)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--out", type=Path, help="the GIF of film")
    args = options.parse_args()
    if args.count < 1 or args.minutes <= 0 or args.seed < 0:
        options.error("--count must be at least 1, --minutes greater than 0, --seed at least 0")
    if args.what == "film" and args.out is None:
        options.error("film requires --out, a GIF")
    print(json.dumps({"machine": system_info(), args.what: COMMANDS[args.what](args)}))


COMMANDS = {
    "start": start,
    "motion": motion,
    "said": said,
    "hostile": hostile,
    "clients": clients,
    "film": film,
}

if __name__ == "__main__":
    main()

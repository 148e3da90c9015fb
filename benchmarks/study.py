"""Studies with simulated participants: the clocks of robots that run at once, a server that is killed, example data.

    python -m benchmarks.study load                 # 8 participants at once: the clocks of their robots
    python -m benchmarks.study kills --count 20     # the server is killed at random moments: what of the log is lost
    python -m benchmarks.study simulate --out data  # participants of docs/examples/study.yaml go through it; their data
    python -m benchmarks.study processes            # the cost of 8 robots in one process, and in one process each

`load` and `kills` use the study of docs/examples/study.yaml, with other numbers of participants. Participants are
programs that speak with the pages as browsers do, scene included, on the same machine. An event counts as logged once
the page has acknowledged or shown it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import sqlite3
import sys
import tempfile
import threading
import time
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from core.system import system_info
from demo.study.export import export
from tools.browser import ROOT, PlayServer, free_port
from tools.study_client import LOST, SimulatedParticipant, StudyClient

EXAMPLE = ROOT / "docs/examples/study.yaml"
READY = 600.0  # seconds that a server has to start
SETTLED = 4.0  # seconds of a robot's clock before its rate is measured: a robot that is loading shows that of the page


class StudyServerProcess(PlayServer):
    """`play.py study=...` in a process of its own. address: the experimenter's page. links: of the participants."""

    def __init__(self, study: Path, port: str) -> None:
        super().__init__(f"study={study}", "--port", port, threads=1)
        self.database = study.with_suffix(".sqlite")
        assert self.process.stdout is not None
        lines = (line for line in self.process.stdout if line.startswith("  http"))
        count = int(yaml.safe_load(study.read_text("utf-8"))["participants"])
        self.links = [line.split()[0] for line in islice(lines, count)]
        threading.Thread(target=self.process.stdout.read, daemon=True).start()

    def kill(self) -> str:
        """Kill the server with SIGKILL; its children end by themselves. Return what it wrote to stderr."""
        self.process.kill()
        return self._read_errors()


def _study(folder: Path, **values: Any) -> Path:
    """The example study with other values, in a folder."""
    content = yaml.safe_load(EXAMPLE.read_text("utf-8")) | values
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def _cpu(pid: int) -> float:
    """CPU seconds of a process and all that it has started, as far as Linux tells."""
    ticks, parents = {}, {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = place.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended
        number = int(place.parent.name)
        parents[number], ticks[number] = int(fields[1]), sum(map(int, fields[11:15]))
    family = {pid}
    while grown := {number for number, parent in parents.items() if parent in family} - family:
        family |= grown
    return sum(ticks.get(number, 0) for number in family) / os.sysconf("SC_CLK_TCK")


def load(args: argparse.Namespace) -> dict[str, Any]:
    """Measure the clocks of robots that run at once, as their pages show them."""
    with tempfile.TemporaryDirectory() as name:
        study = _study(Path(name), participants=args.participants, at_once=args.participants)
        server = StudyServerProcess(study, free_port())
        people = [
            SimulatedParticipant(link, server.database, seed, pause=args.pause)
            for seed, link in enumerate(server.links)
        ]
        end = time.monotonic() + args.seconds
        threads = [threading.Thread(target=person.run, args=(end,), daemon=True) for person in people]
        for thread in threads:
            thread.start()
        experimenter, at_once, loads = StudyClient(server.address), [], []
        clocks: list[float] = []
        passed, start_cpu = 0.0, _cpu(server.process.pid)
        last: dict[str, float] = {}
        while any(thread.is_alive() for thread in threads) and time.monotonic() < end:
            experimenter.listen(1.0)
            present = [each for each in experimenter.shown.get("participants", ()) if each["robot"]]
            robots = [each["robot"] for each in present]
            clocks += [robot["rate"] for robot in robots if robot["clock"] > SETTLED]
            now = {each["code"]: each["robot"]["clock"] for each in present}
            passed += sum(max(0.0, clock - last.get(code, 0.0)) for code, clock in now.items())
            last = now
            at_once.append(len(robots))
            loads.append(os.getloadavg()[0])
        used = _cpu(server.process.pid) - start_cpu
        experimenter.close()
        for thread in threads:
            thread.join(60)
        errors = server.close()
    return {
        "participants": args.participants,
        "robots_at_once_mean_most": [float(np.mean(at_once)), max(at_once)],
        "clock_percentiles_0_1_50_99_100": np.percentile(clocks or [np.nan], (0, 1, 50, 99, 100)).round(3).tolist(),
        "clock_within_bar": float(np.mean([0.95 <= clock <= 1.05 for clock in clocks])) if clocks else np.nan,
        "samples": len(clocks),
        "cpu_seconds_per_robot_second": used / max(passed, 1e-9),
        "load_average_mean": float(np.mean(loads)),
        "exceptions": errors.count("Traceback"),
    }


def kills(args: argparse.Namespace) -> dict[str, Any]:
    """Kill the server at random moments while participants are at work. Count what of the log is lost."""
    rng, port = random.Random(args.seed), free_port()
    lost: list[str] = []
    counts: list[int] = []
    with tempfile.TemporaryDirectory() as name:
        study = _study(Path(name), participants=args.participants * args.count)
        people: list[SimulatedParticipant] = []
        errors = ""
        for kill in range(args.count):
            server = StudyServerProcess(study, port)
            if not people:
                people = [
                    SimulatedParticipant(link, server.database, seed, pause=0.5)
                    for seed, link in enumerate(server.links)
                ]
            for each in people:
                each.at_work = False
            present = [each for each in people if not each.finished][: args.participants]
            threads = [threading.Thread(target=_run_until_lost, args=(each,), daemon=True) for each in present]
            for thread in threads:
                thread.start()
            begun = time.monotonic()
            while any(each.is_alive() for each in threads) and not any(each.at_work for each in present):
                if time.monotonic() - begun > READY:
                    break
                time.sleep(0.2)
            time.sleep(rng.uniform(0.0, args.seconds))  # a random moment while they are at work
            errors += server.kill()
            for thread in threads:
                thread.join(60)
            missing, count = _missing(server.database, present)
            lost += missing
            counts.append(count)
            print(f"kill {kill + 1}: {count} checked, {len(missing)} lost", file=sys.stderr, flush=True)
        server = StudyServerProcess(study, port)
        done = [each for each in people if each.finished]
        server.close()
    return {
        "kills": args.count,
        "checked_in_all": sum(counts),
        "lost": len(lost),
        "first_lost": lost[:3],
        "finished_participants": len(done),
        "exceptions": errors.count("Traceback"),
    }


def _run_until_lost(person: SimulatedParticipant) -> None:
    try:
        person.run()
    except (*LOST, TimeoutError):
        return


def _missing(database: Path, people: list[SimulatedParticipant]) -> tuple[list[str], int]:
    """What participants have seen or got acknowledged and the database does not have, and how much was looked for."""
    missing, count = [], 0
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as base:
        assert base.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
        for person in people:
            logged: dict[tuple[int, str], list[tuple[str, dict[str, Any]]]] = {}
            query = (
                "SELECT trial, kind, data FROM events WHERE code=? AND kind IN ('reply', 'message', 'step', 'outcome')"
            )
            for trial, kind, data in base.execute(query, (person.code,)):
                values = json.loads(data)
                logged.setdefault((trial, values["entry"]), []).append((kind, values))
            for key, entry in person.seen.items():
                for part, holds in _parts(entry, logged.get(key, [])):
                    count += 1
                    missing += [f"{person.code} {key} {part}"] * (not holds)
            query = "SELECT question, value FROM answers WHERE code=? AND stage=?"
            for (stage, question), value in person.confirmed.items():
                count += 1
                stored = dict(base.execute(query, (person.code, stage)))
                missing += [f"{person.code} answer {question}"] * (json.loads(stored.get(question, "null")) != value)
            for kind, number in person.acts.items():
                count += 1
                found = base.execute("SELECT count(*) FROM events WHERE code=? AND kind=?", (person.code, kind))
                missing += [f"{person.code} {kind}"] * (found.fetchone()[0] < number)
    return missing, count


def _parts(entry: dict[str, Any], logged: list[tuple[str, dict[str, Any]]]) -> list[tuple[str, bool]]:
    """The parts of an entry that a page has shown, each with whether the log has it."""
    said = "".join(part[0] for part in entry["said"])
    first = any(
        kind in ("reply", "message") and values["said"] == said and values["text"] == entry["text"]
        for kind, values in logged
    )
    parts = [("text", first or not (said or entry["kind"] != "note"))]
    for number, step in enumerate(entry["steps"]):
        steps = [values for kind, values in logged if kind == "step" and values["step"] == number]
        parts.append((f"step {number} {step['state']}", any(each["state"] == step["state"] for each in steps)))
    if entry["result"]:
        parts.append(("result", any(k == "outcome" and v["result"] == entry["result"] for k, v in logged)))
    return parts


def simulate(args: argparse.Namespace) -> dict[str, Any]:
    """Have simulated participants go through the example study, and export their data."""
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        study = _study(Path(name), at_once=args.participants)
        server = StudyServerProcess(study, free_port())
        people = [
            SimulatedParticipant(link, server.database, args.seed + seed, pause=args.pause)
            for seed, link in enumerate(server.links[: args.count])
        ]
        threads = [threading.Thread(target=person.run, daemon=True) for person in people]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(3600)
        errors = server.close()
        counts = export(server.database, args.out)
    return counts | {"finished": sum(person.finished for person in people), "exceptions": errors.count("Traceback")}


def processes(args: argparse.Namespace) -> dict[str, Any]:
    """Measure CPU milliseconds of a control step with its page, of which one process has 50 for all robots."""
    import torch

    from demo.guarded_server import PageParts
    from demo.page import Page
    from demo.page_gate import PageGate
    from demo.session import Session
    from demo.session_config import make_config
    from demo.splash_page import open_splash_page

    torch.set_num_threads(1)
    start = time.process_time()
    session = Session(make_config(task="nl_reach"), args.seed)
    loaded = time.process_time() - start
    port = free_port()
    server = open_splash_page("127.0.0.1", int(port), PageGate("127.0.0.1", int(port)), parts := PageParts())
    page = Page(server, session, parts)
    times = {"step": 0.0, "page": 0.0, "preview": 0.0}
    for _ in range(args.count):
        if not session.busy:
            session.say(session.example())
        for name, act in (("step", session.step), ("page", lambda: page._show(session))):
            start = time.process_time()
            act()
            times[name] += 1000 * (time.process_time() - start) / args.count
    start = time.process_time()
    session.preview(session.example())
    times["preview"] = 1000 * (time.process_time() - start)
    session.close()
    server.stop()
    robots = args.participants
    total = robots * (times["step"] + times["page"])
    milliseconds = {f"{name}_ms": round(value, 2) for name, value in times.items()}
    return {**milliseconds, "loading_s": round(loaded, 2), "one_process_ms_of_50": round(total, 1)}


COMMANDS = {"load": load, "kills": kills, "simulate": simulate, "processes": processes}


def main() -> None:
    """Measure one thing and print the result as a line of JSON."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=list(COMMANDS))
    options.add_argument("--participants", type=int, help="at once; 8 for load, 4 for kills")
    options.add_argument("--seconds", type=float, help="of load (180), or most of them before a kill (25)")
    options.add_argument("--count", type=int, default=20, help="kills, or most participants of simulate")
    options.add_argument(
        "--pause", type=float, default=4.0, help="how slow participants are; 1 is about a second to think"
    )
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--out", type=Path, help="folder of the data of simulate")
    args = options.parse_args()
    args.participants = args.participants or {"kills": 4}.get(args.what, 8)
    args.seconds = args.seconds or {"load": 180.0}.get(args.what, 25.0)
    if args.participants < 1 or args.count < 1 or args.seconds <= 3 or args.pause <= 0:
        options.error("--participants and --count must be at least 1, --seconds more than 3, --pause more than 0")
    if args.what == "simulate" and args.out is None:
        options.error("simulate requires --out, a folder")
    print(json.dumps({"machine": system_info(), args.what: COMMANDS[args.what](args)}))


if __name__ == "__main__":
    main()

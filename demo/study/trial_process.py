"""The process of one trial: a robot, its page on a port of this machine, and the loop in real time."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import traceback
from contextlib import closing
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import torch

from core.errors import ConfigError
from demo.guarded_server import PageParts
from demo.page_gate import PageGate
from demo.session import Session
from demo.splash_page import open_splash_page
from demo.study.database import StudyDatabase
from demo.study.goals import SceneGoal, prepare_goal
from demo.study.progress import StudyTrial, TrialJob
from demo.study.study_config import StudyConfig, check_policies, session_config
from demo.study.trial_files import TrialFiles
from demo.study.trial_log import TrialLog
from demo.study.trial_page import TrialPage, TrialSections

HOST = "127.0.0.1"
SHIFTED = 0.005  # metres: objects that are farther from where they were are put back after a break


def run_trial(job: TrialJob, pipe: Connection) -> None:
    """Run a trial until the study's server ends this process, or ends itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all processes
    torch.set_num_threads(1)
    threading.Thread(target=_end_with_server, args=(pipe,), daemon=True).start()
    try:
        _serve(job, pipe)
    except ConfigError as error:
        pipe.send(("failed", str(error)))
    except Exception:
        traceback.print_exc(file=sys.stderr)
        pipe.send(("failed", "Something went wrong; the experimenter sees the error in the terminal."))


def _end_with_server(pipe: Connection) -> None:
    """End this process once the server has gone, whatever the way it went."""
    try:
        while True:
            pipe.recv()
    except (EOFError, OSError):
        os._exit(0)


def _serve(job: TrialJob, pipe: Connection) -> None:
    study, trial = job.study, job.trial
    with closing(StudyDatabase(job.database, worker=True)) as database:
        log = TrialLog(database, trial.code, trial.number, trial.clock)
        stored = database.first("SELECT data FROM goals WHERE scene=?", (trial.scene_name,))
        goal = None if stored is None or trial.scene.goal is None else SceneGoal.from_json(stored[0])
        config = session_config(study, trial.condition, trial.scene, f"conditions.{trial.condition_name}")
        with closing(Session(config, trial.scene.seed)) as session:
            session.set_viewpoint("human")
            parts = PageParts(TrialSections(trial, log), TrialFiles(trial.condition))
            gate = PageGate(HOST, job.port)
            server = open_splash_page(HOST, job.port, gate, parts)
            try:
                back = _put_back(session, database, trial)
                log.session = session
                names = {"names": session.object_names(), "restored": back}
                log.write("ready" if not trial.begun else "resumed", names)
                page = TrialPage(
                    server,
                    session,
                    parts,
                    trial=trial,
                    goal=goal,
                    log=log,
                    tell=lambda *words: pipe.send(words),
                    samples_per_second=study.samples_per_second,
                )
                pipe.send(("ready", server.get_port(), gate.token))
                page.loop.run()
            finally:
                server.stop()


def _put_back(session: Session, database: StudyDatabase, trial: StudyTrial) -> list[int]:
    """Put loose objects where they were at the latest event of a trial. Returns which were moved."""
    query = "SELECT state FROM events WHERE code=? AND trial=? AND state IS NOT NULL ORDER BY id DESC LIMIT 1"
    row = database.first(query, (trial.code, trial.number)) if trial.begun else None
    if row is None:
        return []
    places = np.array(json.loads(row["state"])["objects"])
    scene, bodies = session.env.scene(), session.env.bodies()
    if places.shape != scene.positions.shape:
        return []
    moved = np.linalg.norm(places - scene.positions, axis=1) > SHIFTED
    found = [int(index) for index in np.flatnonzero(moved) if bodies[index] is not None]
    for index in found:
        session.env.put_object(index, places[index])
    return found


def run_preparation(study: StudyConfig, pipe: Connection) -> None:
    """Check what a study needs, and prepare its goals. Sends the goals by scene, or an error's text."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    torch.set_num_threads(1)
    try:
        check_policies(study)
        scenes = {name: scene for name, scene in study.scenes.items() if scene.goal is not None}
        result: Any = {name: prepare_goal(study, name, scene) for name, scene in scenes.items()}
    except ConfigError as error:
        result = str(error)
    pipe.send(result)

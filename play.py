"""Talk to a robot and point at things: a page in the browser shows the robot, which does what you say.

    python play.py                                      # prints the address of the page; with a pretrained policy
    python play.py robot=panda task=nl_pick_and_place   # another robot, another task
    python play.py checkpoint=outputs/<run>             # a policy of your own
    python play.py --gui                                # PyBullet's own window and the keyboard, no page
    python play.py --headless out.mp4 --say "open the drawer" scene=drawer

    python play.py study=study.yaml                     # a study with participants: docs/study.md
    python play.py task=nl_reach arm=sim arm.latency=0.06   # an arm in place of the simulated one: docs/deployment.md

Keys: task, robot, control, workspace, objects, driver (policy, expert, hand), second_try (true or false: whether the
expert tries once more what the policy did not manage) and checkpoint; or scene, a prepared scene (sort, point, drawer,
which, tower) or the end of a copied link, which chooses all of them. Any other key=value overrides the environment's
config, as in train.py. The page requires pip install -e ".[play]".
"""

from __future__ import annotations

import argparse
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from core.command_line import check_file
from core.errors import ConfigError
from core.machine_limits import require_docstrings
from core.platform_tuning import lean_imports
from core.plugins import take_config_dir
from core.program import OptionParser, help_text, program

if TYPE_CHECKING:
    from demo.session import Session

SESSION_KEYS = ("scene", "task", "robot", "control", "workspace", "objects", "driver", "second_try", "checkpoint")
TASK_KEYS = {"task", "control", "workspace", "objects", "checkpoint"}  # whoever gives one has chosen a task
VIDEO_SUFFIXES = (".mp4", ".mkv", ".mov", ".avi")
MAX_VIDEO_STEPS = 2400  # control steps: two minutes
FINAL_VIDEO_STEPS = 20  # control steps shown after the end: one second


def parser() -> OptionParser:
    """Build the parser of the options."""
    options = OptionParser(
        prog="play.py", description=help_text(__file__), formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("overrides", nargs="*", metavar="key=value")
    options.add_argument("--port", type=int, default=8080)
    options.add_argument("--host", default="127.0.0.1", help="any address but loopback lets other machines in")
    options.add_argument("--origin", action="append", default=[], help="address of a server or tunnel before the page")
    options.add_argument("--seed", type=int, default=0, help="of the scenes")
    options.add_argument("--gui", action="store_true", help="no page: PyBullet's own window, with the keyboard")
    options.add_argument("--headless", type=Path, metavar="VIDEO", help="no page: do what --say says, and write an mp4")
    instruction = "with --headless: the instruction; {0}, {1} stand for objects of the scene"
    options.add_argument("--say", action="append", help=instruction)
    return options


def cli(words: Sequence[str] | None = None) -> None:
    """Run `main` with these words, or the process's arguments. Exits with one line for bad input."""
    with program():
        main(take_config_dir(sys.argv[1:] if words is None else words))


def main(words: Sequence[str]) -> None:
    """Serve the page, open the window or write the video. Raises ConfigError for bad input."""
    args = parser().parse_args(words)
    require_docstrings()
    if (args.headless is None) != (args.say is None):
        raise ConfigError("--headless and --say belong together: --headless out.mp4 --say 'open the drawer'")
    if args.say is not None and len(args.say) > 1:
        raise ConfigError(f"--say is given {len(args.say)} times: give one instruction, 'open the drawer then ...'")
    if args.gui and args.headless is not None:
        raise ConfigError("--gui opens a window and --headless opens none: give one of them")
    if args.seed < 0:
        raise ConfigError(f"--seed={args.seed} must be at least 0")
    if (args.gui or args.headless is not None) and _is_study(args.overrides):
        raise ConfigError("study=... is for the page: leave out --gui and --headless")
    if args.headless is not None:
        check_file("--headless", args.headless, VIDEO_SUFFIXES, new=True)
        write_video(args)
    elif args.gui:
        open_window(args)
    else:
        serve_page(args)


def _is_study(words: Sequence[str]) -> bool:
    """Whether a command line asks for a study."""
    return any(word.startswith("study=") for word in words)


def make_session(args: argparse.Namespace) -> Session:
    """Make the session that the arguments choose. Raises ConfigError."""
    from core.command_line import split

    with lean_imports():
        from demo.session import Session
    from demo.session_config import DEFAULTS, check_choices, default_task, make_config
    from demo.shared_scene import scene_of
    from deployment.arm import ArmError
    from deployment.connecting import about, split_arm

    arm, words = split_arm(args.overrides)
    if arm is not None:
        if args.gui:
            raise ConfigError(f"--gui shows a simulated robot: leave it out, or arm={arm.name}")
        if "deadman" in arm.rules:
            raise ConfigError(
                f"safety.deadman={arm.rules['deadman']} needs keys, which a page cannot hold: use deploy.py"
            )
        print(about(arm), flush=True)
    values, overrides = split(words, SESSION_KEYS, "robot=panda")
    check_choices(values)
    seed = args.seed
    if "scene" in values:
        others = [f"{key}={value}" for key, value in values.items() if key != "scene"]
        if others or args.seed:
            chosen = others[0] if others else f"--seed={args.seed}"
            raise ConfigError(f"scene={values['scene']} chooses robot, task and seed itself: leave out {chosen}")
        shared = scene_of(values["scene"])
        values, seed = shared.choices, shared.seed
    elif not values.keys() & TASK_KEYS:
        values["task"] = default_task(values.get("robot", DEFAULTS["robot"]))
    try:
        return Session(make_config(**values, overrides=overrides), seed, args.gui, arm)
    except ArmError as error:
        raise ConfigError(str(error)) from None


# ---- PyBullet's window


def open_window(args: argparse.Namespace) -> None:
    """Run a session in PyBullet's window until a person leaves it. Raises ConfigError."""
    session = make_session(args)
    from core.system import suppress_stdout
    from demo.window_ui import WindowUI
    from human.body.window import TYPING_KEYS, WindowDisplay, WindowKeys

    try:
        with suppress_stdout(), suppress(KeyboardInterrupt):  # PyBullet prints when its window closes
            client = session.env.client
            WindowUI(session, WindowKeys(client, TYPING_KEYS), WindowDisplay(client)).run()
    finally:
        session.close()


# ---- The page


def serve_page(args: argparse.Namespace) -> None:
    """Serve the page until the process is interrupted. Raises ConfigError."""
    if find_spec("viser") is None or find_spec("trimesh") is None:
        raise ConfigError('the page requires viser, which is not installed: pip install -e ".[play]"')
    _check_address(args.host, args.port)
    if _is_study(args.overrides):
        from demo.study.serving import serve_study

        serve_study(args)
        return
    from demo.guarded_server import PageParts
    from demo.page_gate import PageGate, is_loopback
    from demo.splash_page import open_splash_page

    gate, parts = PageGate(args.host, args.port, args.origin), PageParts()
    server = open_splash_page(args.host, args.port, gate, parts)
    try:
        if server.get_port() != args.port:  # else the token would be sent to who has taken the port meanwhile
            raise ConfigError(f"--port={args.port} has been taken; try another --port")
        if not is_loopback(args.host):
            there = gate.with_token(f"http://{socket.gethostname()}:{args.port}")
            print(f"warning: anyone with the address can drive the robot; other machines use {there}", file=sys.stderr)
        with _on_interrupt(lambda: sys.exit(0)), ExitStack() as stack:
            print(f"{gate.address} (press Ctrl-C to stop)", flush=True)
            for origin in args.origin:
                print(f"or {gate.with_token(origin)}", flush=True)
            with lean_imports():
                from demo.page import Page
            session = stack.enter_context(closing(make_session(args)))
            if not any(word.startswith("task.viewpoint=") for word in args.overrides):
                session.set_viewpoint("human")  # of who looks at the page: its camera stands there
            scene = next((word.removeprefix("scene=") for word in args.overrides if word.startswith("scene=")), None)
            page = stack.enter_context(closing(Page(server, session, parts, scene)))
            with _on_interrupt(page.loop.stop):
                print(f"it is ready; try: {session.example()}", flush=True)
                page.loop.run()
    finally:
        server.stop()
        if parts.dropped:
            print(f"{parts.dropped} messages that the page never sends were dropped", file=sys.stderr)


@contextmanager
def _on_interrupt(action: Callable[[], object]) -> Iterator[None]:
    """Calls the action on SIGINT and SIGTERM. Set explicitly, since background processes ignore SIGINT by default."""
    handlers = {number: signal.signal(number, lambda *_: action()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _check_address(host: str, port: int) -> None:
    """Raise ConfigError if the port is taken or not allowed: viser would take another one without a message."""
    if not 0 < port < 65536:
        raise ConfigError(f"--port={port} must be from 1 to 65535")
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise ConfigError(f"--host={host} --port={port} cannot be used: {error.strerror}; try another --port") from None


# ---- The video


def write_video(args: argparse.Namespace) -> None:
    """Do one instruction and write it to an mp4. Raises ConfigError for words that are not understood."""
    from demo.video_recorder import VideoRecorder
    from language import Answer, Plan

    session = make_session(args)
    try:
        names = session.object_names()
        interpretation = session.say(_with_names(args.say[0], names))
        if isinstance(interpretation, Answer):
            print(f"{interpretation.message} (No video is written: nothing moves.)")
            return
        if not isinstance(interpretation, Plan):
            raise ConfigError(f"--say: {interpretation.message} (the objects are {', '.join(names)})")
        args.headless.parent.mkdir(parents=True, exist_ok=True)
        recorder = VideoRecorder(args.headless)
        for _ in range(MAX_VIDEO_STEPS):
            recorder.add(session)
            if not session.busy:
                break
            session.step()
        for _ in range(FINAL_VIDEO_STEPS):
            recorder.add(session)
        recorder.close()
        print(f"{session.view.status} {args.headless}")
    finally:
        session.close()


def _with_names(sentence: str, names: list[str]) -> str:
    """Return the sentence with names in place of {0}, {1}, ..."""
    for index, name in enumerate(names):
        sentence = sentence.replace(f"{{{index}}}", name)
    return sentence


if __name__ == "__main__":
    cli()

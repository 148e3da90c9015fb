"""Talk to it and point at it: a page with the robot, which does what you say.

    python play.py                                      # http://127.0.0.1:8080, NL reach with a pretrained policy
    python play.py robot=panda task=nl_pick_and_place   # another robot, another task
    python play.py checkpoint=outputs/<run>             # your own
    python play.py --gui                                # PyBullet's own window and the keyboard, no page
    python play.py --headless out.mp4 --say "reach the red cube"

key=value: task, robot, control, workspace, objects, driver (policy, expert, hand) and checkpoint; any other key is an
override of the world's config, as in train.py. The page needs pip install -e ".[play]".
"""

from __future__ import annotations

import argparse
import ipaddress
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from conf.schema import ConfigError

if TYPE_CHECKING:
    from demo.session import Session

OWN = ("task", "robot", "control", "workspace", "objects", "driver", "checkpoint")
LONGEST_FILM = 2400  # control steps: two minutes


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(
        prog="play.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("overrides", nargs="*", metavar="key=value")
    options.add_argument("--port", type=int, default=8080)
    options.add_argument("--host", default="127.0.0.1", help="anything but loopback lets others in: it warns")
    options.add_argument("--seed", type=int, default=0, help="of the scenes")
    options.add_argument("--gui", action="store_true", help="no page: PyBullet's own window, with the keyboard")
    options.add_argument("--headless", type=Path, metavar="FILM", help="no page: do what --say says, into this mp4")
    options.add_argument("--say", help="with --headless: the instruction; {0}, {1} stand for objects of the scene")
    return options


def main(arguments: list[str]) -> None:
    """Raises ConfigError for what was typed."""
    given = parser().parse_args(arguments)
    if (given.headless is None) != (given.say is None):
        raise ConfigError("--headless and --say belong together: --headless out.mp4 --say 'reach the red cube'")
    if given.gui and given.headless is not None:
        raise ConfigError("--gui opens a window and --headless opens none: give one of them")
    if given.seed < 0:
        raise ConfigError(f"--seed={given.seed} must be at least 0")
    if given.headless is not None:
        film(given)
    elif given.gui:
        show(given)
    else:
        serve(given)


def session(given: argparse.Namespace) -> Session:
    """The session that was asked for. Raises ConfigError."""
    from conf.arguments import split
    from demo.session import Session
    from demo.session_config import choose

    own, others = split(given.overrides, OWN, "robot=panda")
    return Session(choose(**own, overrides=others), given.seed, given.gui)


def show(given: argparse.Namespace) -> None:
    """PyBullet's window, until it is left. Raises ConfigError."""
    from human.suppress_stdout import suppress_stdout

    played = session(given)
    from demo.gui import Gui
    from human.body.window import TYPING_KEYS, WindowDisplay, WindowKeys

    try:
        with suppress_stdout(), suppress(KeyboardInterrupt):  # Bullet's window talks as it is closed
            client = played.stage.client
            Gui(played, WindowKeys(client, TYPING_KEYS), WindowDisplay(client)).run()
    finally:
        played.close()


def serve(given: argparse.Namespace) -> None:
    """The page, until it is interrupted. Raises ConfigError."""
    if find_spec("viser") is None or find_spec("trimesh") is None:
        raise ConfigError('the page needs viser, which is not installed: pip install -e ".[play]"')
    _check_address(given.host, given.port)
    from demo.splash_page import opened

    server = opened(given.host, given.port)
    print(f"http://{given.host}:{server.get_port()} (Ctrl-C ends it)", flush=True)
    if not _is_loopback(given.host):
        print(f"warning: --host={given.host}: whoever reaches this machine can drive the robot", file=sys.stderr)
    try:
        with _ended_by(lambda: sys.exit(0)), closing(session(given)) as played:
            from demo.page import Page

            with closing(Page(server, played)) as page, _ended_by(page.loop.stop):
                print(f"it is ready; try: {played.example()}", flush=True)
                page.loop.run()
    finally:
        server.stop()


@contextmanager
def _ended_by(end: Callable[[], object]) -> Iterator[None]:
    """Let SIGINT and SIGTERM do this: said outright, since what runs in the background ignores the first."""
    before = {number: signal.signal(number, lambda *_: end()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _check_address(host: str, port: int) -> None:
    """Raises ConfigError for a port that cannot be had: another one, silently, would not be found."""
    if not 0 < port < 65536:
        raise ConfigError(f"--port={port} must be from 1 to 65535")
    try:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise ConfigError(f"--host={host} --port={port} cannot be had: {error.strerror}; try another --port") from None


def film(given: argparse.Namespace) -> None:
    """One instruction, done and filmed. Raises ConfigError for words that are not understood."""
    from demo.video_recorder import Tape

    played = session(given)
    try:
        names = played.names()
        heard = played.say(_named(given.say, names))
        if heard.understood is None:
            raise ConfigError(f"--say: {heard.message} (here are {', '.join(names)})")
        given.headless.parent.mkdir(parents=True, exist_ok=True)
        tape = Tape(given.headless)
        for _ in range(LONGEST_FILM):
            tape.add(played)
            if not played.busy:
                break
            played.step()
        for _ in range(20):  # a second to see what came of it
            tape.add(played)
        tape.close()
        print(f"{played.show.status} {given.headless}")
    finally:
        played.close()


def _named(sentence: str, names: list[str]) -> str:
    """The sentence with names in the place of {0}, {1}, ..."""
    for index, name in enumerate(names):
        sentence = sentence.replace(f"{{{index}}}", name)
    return sentence


def cli(words: Sequence[str] | None = None) -> None:
    """The program: `main` with `words`, by default those of this process. Exits with one line for bad input."""
    try:
        main(sys.argv[1:] if words is None else list(words))
    except ConfigError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    cli()

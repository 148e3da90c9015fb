"""The command play.py: the video, the page, and errors of one line."""

import re
import shlex
import signal
import socket
import subprocess
import sys
import urllib.request
from contextlib import closing
from functools import partial
from pathlib import Path

import imageio.v2 as imageio
import pytest

import play
from core.errors import ConfigError
from tools.browser import free_port
from tools.forked import call

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def port():
    return free_port()


@pytest.mark.slow
def test_headless_writes_a_video_of_a_pretrained_policy(tmp_path, capsys):
    video = tmp_path / "new" / "said.mp4"
    play.main(["--headless", str(video), "--say", "reach {0} then reach {1}", "task=nl_reach"])
    assert "Done in" in capsys.readouterr().out
    frames = imageio.mimread(video, memtest=False)
    assert len(frames) > 15
    assert (frames[0] != frames[-1]).any()


VIDEOS = re.findall(r"^python play.py (--headless .*)$", (ROOT / "docs" / "play.md").read_text("utf-8"), re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("line", VIDEOS)
def test_the_videos_of_the_docs_are_written(line, tmp_path, capsys):
    words = shlex.split(line)
    words[1] = str(tmp_path / "said.mp4")
    play.main(words)
    assert "Done in" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "robot"), [(["scene=drawer"], "kuka"), (["robot=panda", "second_try=false"], "panda")]
)
def test_a_session_is_what_the_words_choose(words, robot):
    with closing(play.make_session(play.parser().parse_args(words))) as session:
        assert session.config.robot == robot
        assert session.config.second_try == ("second_try=false" not in words)


def test_a_scene_that_is_not_known_is_refused_before_an_arm_is_asked_for():
    with pytest.raises(ConfigError, match=r"scene=drawe .*did you mean 'drawer'"):
        play.make_session(play.parser().parse_args(["scene=drawe"]))


@pytest.mark.slow
def test_a_bad_sentence_raises_and_writes_no_video(tmp_path):
    video = tmp_path / "said.mp4"
    said = (
        ("reach the elephant", "know the word 'elephant'"),
        ("reach {9}", "3 things fit"),
        ("{", "not get any words"),
    )
    for sentence, message in said:
        with pytest.raises(ConfigError, match=message):
            play.main(["--headless", str(video), "--say", sentence, "task=nl_reach"])
    assert not video.exists()


@pytest.mark.slow
def test_a_question_gets_its_answer_and_no_video(tmp_path, capsys):
    video = tmp_path / "said.mp4"
    play.main(["--headless", str(video), "--say", "what do you see?", "task=nl_reach"])
    assert capsys.readouterr().out.startswith("I see the ")
    assert not video.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--headless", "said.mp4"], "--headless and --say belong together"),
        (["--say", "reach the cube"], "--headless and --say belong together"),
        (["--headless", "said.mp4", "--say", "open it", "--say", "close it"], "--say is given 2 times"),
        (["--seed", "-1"], "--seed=-1 must be at least 0"),
        (["--port", "0"], "--port=0 must be from 1 to 65535"),
        (["--port", "abc"], "--port=abc must be a whole number; see play.py --help"),
        (["--seed", "1.5"], "--seed=1.5 must be a whole number"),
        (["--port"], "--port: expected one argument"),
        (["--prot", "80"], "unrecognized arguments: --prot"),
        (["--host", "no.such.host.invalid"], "--host=no.such.host.invalid"),
        (["robot"], "robot: arguments are written key=value"),
        (["robot=pandora"], "robot=pandora is not known; did you mean 'panda'"),
        (["objects=many"], "objects=many"),
        (["task.radius=-1"], "radius=-1"),
        (["checkpoint=nowhere"], "checkpoint=nowhere does not exist"),
    ],
)
def test_bad_input_raises_an_error_of_one_line(words, message, monkeypatch, tmp_path, port):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as error:
        play.main(["--port", port, *words])
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_taken_port_raises():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"--port={port} cannot be used"):
            play.main(["--port", str(port)])


@pytest.mark.slow
@pytest.mark.parametrize("ready", [False, True], ids=["while it loads", "once it is ready"])
def test_the_page_is_served_and_an_interrupt_ends_the_process_without_errors(port, ready):
    command = [sys.executable, "play.py", "--port", port, "robot=jaco", "driver=expert"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = next(line for line in process.stdout if line.startswith("http")).split()[0]
        with urllib.request.urlopen(address, timeout=60) as answer:
            assert b"<html" in answer.read().lower()
        if ready:
            assert next(line for line in process.stdout if line.startswith("it is ready; try: reach the "))
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert "warning" not in errors  # other machines cannot open it


@pytest.mark.slow
def test_bad_input_ends_the_process_with_one_line_and_no_traceback():
    ended = call(partial(play.cli, ["robot=pandora"]), ROOT)
    assert ended.code == 1
    assert [line for line in ended.err.splitlines() if line.startswith("error: ")]
    assert "Traceback" not in ended.err

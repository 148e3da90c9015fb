"""`python -m language` as a process: pipes, signals, exit codes and imports."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import language

ROOT = Path(language.__file__).parent.parent
COMMAND = [sys.executable, "-m", "language"]


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n"
        "- {id: c, noun: cube, color: blue, position: [0.6, 0.2, 0.0]}\n"
    )
    return str(path)


def run(*arguments, **options):
    """The command when it has ended."""
    options = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True} | options
    return subprocess.run([*COMMAND, *arguments], cwd=ROOT, timeout=60, **options)


def start(*arguments):
    """The command as it runs, with a pipe for each stream."""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen([*COMMAND, *arguments], text=True, cwd=ROOT, preexec_fn=heed_interrupts, **pipes)


def heed_interrupts():
    """Heed Ctrl-C, which a shell has its background jobs ignore, and so all that they start."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
def test_sentences_through_a_pipe_are_answered_at_once(scene):
    with start("parse", "-", "--scene", scene) as process:
        for sentence, goal in (("reach the red cube", "a"), ("no, the blue one", "c")):
            process.stdin.write(sentence + "\n")
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["goal"] == goal
        process.stdin.close()
        assert process.wait(timeout=20) == 0


def interrupted(process):
    """Press Ctrl-C until the process ends: one that comes just before the process waits for input is seen later."""
    for _ in range(20):
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(timeout=1)
    raise TimeoutError("Ctrl-C does not end the process")


@pytest.mark.slow
def test_ctrl_c_exits_with_130_and_no_traceback(scene):
    with start("parse", "-", "--scene", scene) as process:
        process.stdin.write("reach the red cube\n")
        process.stdin.flush()
        process.stdout.readline()
        assert interrupted(process) == 130
        assert process.stderr.read() == ""


def test_a_closed_pipe_exits_with_141_and_no_message():
    with start("sample", "--n", "100000", "--depth", "0") as process:
        assert process.stdout.readline()
        process.stdout.close()
        assert process.wait(timeout=20) == 141
        assert process.stderr.read() == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_prints_one_line():
    with open("/dev/full", "w") as full:
        done = run("sample", "--n", "1", stdout=full)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_undecodable_bytes_are_unknown_words(scene):
    done = run("parse", "-", "--scene", scene, text=False, input=b"reach the \xff cube\nreach the red cube\n")
    first, second = map(json.loads, done.stdout.splitlines())
    assert (first["error"], first["position"], second["goal"], done.returncode) == ("question", 12, "a", 2)


def test_the_command_line_imports_no_heavy_library():
    code = "import sys, language.cli; print(*{'torch', 'lark', 'pybullet'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.split() == []


@pytest.mark.slow
def test_the_process_exits_with_the_code_of_the_command(scene):
    assert run("parse", "reach the red cube", "--scene", scene).returncode == 0
    done = run("parse", "reach the red sphere", "--scene", scene, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr

"""A run that Ray ends is started again from its last checkpoint. The programs here stand for train.py on Ray."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from itertools import product
from pathlib import Path

import pytest

from core.errors import RunError
from trainers.cluster import supervised_run
from trainers.cluster.supervised_run import RunWords, supervise

ROOT = Path(__file__).parents[3]
PROGRAM = """
import os, sys
from pathlib import Path
folder, ends = Path(sys.argv[-1].partition("=")[2]), {ends}
with open(folder / "starts.txt", "a") as file:
    print(*sys.argv[1:], file=file)
starts = len((folder / "starts.txt").read_text().splitlines())
{before}
if starts <= ends:
    os._exit(1)  # as Ray's C++ does
os.write(int(os.environ["DEIXIS_RUN_ENDED_PIPE"]), b"1")
sys.exit({code})
"""
SAVE = '(folder / "checkpoints").mkdir(exist_ok=True); (folder / "checkpoints" / "last.pt").touch()'


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(supervised_run, "PAUSE_SECONDS", 0.0)


def program(folder: Path, ends: int = 0, code: int = 0, before: str = "") -> Path:
    path = folder / "program.py"
    path.write_text(PROGRAM.format(ends=ends, code=code, before=before))
    return path


def starts(folder: Path) -> list[str]:
    return (folder / "starts.txt").read_text().splitlines()


def test_a_run_that_ends_by_itself_is_not_started_again(tmp_path):
    assert supervise(program(tmp_path, code=3), RunWords(["seed=1"], tmp_path), 2) == 3
    assert starts(tmp_path) == [f"seed=1 hydra.run.dir={tmp_path}"]


@pytest.mark.slow
def test_a_run_that_ray_ends_begins_again_or_goes_on_from_its_checkpoint(tmp_path, capfd):
    words = ["collector=ray", "seed=1"]
    assert supervise(program(tmp_path, ends=1), RunWords(words, tmp_path), 2) == 0
    assert starts(tmp_path) == [f"collector=ray seed=1 hydra.run.dir={tmp_path}"] * 2
    assert "the run is started again (1 of at most 2 times)" in capfd.readouterr().err
    (tmp_path / "starts.txt").unlink()
    assert supervise(program(tmp_path, ends=1, before=SAVE), RunWords(words, tmp_path), 2) == 0
    assert starts(tmp_path)[1] == f"resume={tmp_path} collector=ray hydra.run.dir={tmp_path}"


def test_a_resumed_run_keeps_its_overrides_and_an_old_checkpoint_does_not_count(tmp_path):
    words = RunWords(["resume=/old", "total_frames=9"], tmp_path)
    exec(SAVE, {"folder": tmp_path})
    os.utime(words.last, (1, 1))
    assert words() == ["resume=/old", "total_frames=9", f"hydra.run.dir={tmp_path}"]
    os.utime(words.last)
    assert words() == [f"resume={tmp_path}", "total_frames=9", f"hydra.run.dir={tmp_path}"]


def test_the_last_restart_ends_with_what_is_saved(tmp_path):
    with pytest.raises(RunError, match=r"restarts=1 allows no more restarts; .*last\.pt is its last checkpoint; go on"):
        supervise(program(tmp_path, ends=9, before=SAVE), RunWords([], tmp_path), 1)
    assert len(starts(tmp_path)) == 2


def test_a_signal_is_sent_on_once_and_its_code_returned(tmp_path):
    wait = "import signal, time\nsignal.signal(signal.SIGTERM, lambda *_: os._exit(143))\ntime.sleep(30)"
    path = program(tmp_path, before=wait)

    def stop():
        while not (tmp_path / "starts.txt").exists():
            time.sleep(0.05)
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=stop).start()
    assert supervise(path, RunWords([], tmp_path), 2) == 143
    assert len(starts(tmp_path)) == 1


def test_an_error_that_ray_raises_is_one_line_and_no_orderly_end(monkeypatch):
    def fail(text):
        raise RuntimeError(text)

    of_ray: dict = {"__name__": "ray._private.node"}
    exec("def fail(text):\n    raise RuntimeError(text)", of_ray)
    read, write = os.pipe()
    monkeypatch.setenv(supervised_run.FINISHED, str(write))
    with pytest.raises(RuntimeError, match="ours"), supervised_run.ray_errors():
        fail("ours")
    with pytest.raises(RunError, match=r"^Ray has ended: Timed out waiting$"), supervised_run.ray_errors():
        of_ray["fail"]("Timed out\nwaiting")
    supervised_run.report_end()
    os.close(write)
    assert os.read(read, 1) == b""
    os.close(read)


APART = """
import os, sys
from pathlib import Path
from trainers.cluster.supervised_run import run_apart

def work():
    {work}

run_apart(work, Path(__file__), sys.argv[1:], "evaluation: start it again")
print("exit")
"""


@pytest.mark.parametrize(
    ("work", "code", "said"),
    [
        ("print(sys.argv[1], os.environ.get('DEIXIS_RUN_ENDED_PIPE'))", 0, "a None\nexit\nexit\n"),
        ("sys.exit(3)", 3, ""),
        ("os._exit(1)", 1, "RunError: Ray, or a node of it, has ended the evaluation: start it again"),
        ("os.kill(os.getpid(), 9)", 1, "RunError: Ray, or a node of it, has ended the evaluation: start it again"),
    ],
)
def test_work_apart_ends_as_it_ends_itself_or_with_what_to_do(tmp_path, work, code, said):
    (tmp_path / "program.py").write_text(APART.format(work=work))
    path = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(tmp_path / "program.py"), "a"], env=path, capture_output=True, text=True)
    assert done.returncode == code
    assert said in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ["raylet/raylet ", "agent.py", "gcs_server"])
def test_programs_of_which_ray_is_killed_end_with_one_error(tmp_path, request, pattern):
    """Evaluations, recordings and sweeps. The raylet's own command names its agents: both die."""
    if not request.config.getoption("--thorough"):
        pytest.skip("each of the tries starts Ray and kills it: --thorough")
    from tests.helpers.ray_faults import killed_program

    few = ("collector.workers=1", "collector.worlds=8", "algo.minibatch=64", "logger=[]", "eval.video_episodes=0")
    commands = {
        "evaluate.py": ("checkpoint=nl_reach_kuka", "collector=ray", "episodes=4000"),
        "record.py": ("expert=true", "collector=ray", "episodes=2000", "format=minari", "out=demos-v0"),
        "train.py": ("-m", "seed=1,2", "hydra/launcher=ray", "total_frames=1000000", *few, "hydra.sweep.dir=sweep"),
    }
    for seconds, (name, words) in product((4.0, 12.0), commands.items()):
        place = tmp_path / f"{seconds:g} {name}"
        place.mkdir()
        done = killed_program([str(ROOT / name), *words], place, pattern, seconds)
        errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        assert (done.returncode, len(errors)) == (1, 1), (name, seconds, done.stderr[-2000:])
        assert not (place / "demos-v0").exists()


@pytest.mark.slow
def test_a_run_goes_on_whatever_of_ray_is_killed(tmp_path, request):
    """The raylet, its agent and the head at random moments, before and after the first batch."""
    if not request.config.getoption("--thorough"):
        pytest.skip("each of the 20 tries starts Ray twice: --thorough")
    from random import Random

    from tests.helpers.ray_faults import killed_run

    rng = Random(0)
    for index in range(20):
        what = ("raylet/raylet ", "agent.py", "gcs_server")[index % 3]
        done = killed_run(tmp_path / str(index), what, rows=rng.choice((-1, 0, 1, 3)))
        assert done.returncode in (0, 1), (what, done.stderr[-500:])
        assert done.returncode == 0 or "error: " in done.stderr, (what, done.stderr[-500:])
        assert (tmp_path / str(index) / "checkpoints" / "last.pt").is_file(), what

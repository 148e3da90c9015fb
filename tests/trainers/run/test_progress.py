import io
import re
import subprocess
import sys
from pathlib import Path

from trainers.run.progress import WINDOW, Progress

ROOT = Path(__file__).parents[3]


def row(frames, episodes, success, seconds=1.0, **more):
    return {"frames": frames, "time/total": seconds, "train/episodes": episodes, "train/success": success, **more}


def said(capsys, rows):
    """The lines that are printed where nobody looks at a terminal, after the one that says that the run starts."""
    with Progress(1000) as progress:
        first = capsys.readouterr().out
        for each in rows:
            progress.show(each)
            if "eval/success_at_end" in each:
                progress.show_evaluation(each | {"time/evaluated": each["time/total"]})
    assert first == "starting a run of 1000 frames\n"
    return capsys.readouterr().out.splitlines()


def test_what_the_run_does_before_its_first_row_is_a_line(capsys):
    with Progress(1000) as progress:
        progress.say("building 64 worlds")
    assert capsys.readouterr().out.splitlines() == ["starting a run of 1000 frames", "building 64 worlds"]


def last_line(capsys, rows):
    return said(capsys, rows)[-1:]


def test_a_line_is_printed_at_once_at_evaluations_and_every_ten_seconds(capsys):
    seconds = (3.0, 5.0, 13.0, 14.0, 22.9, 24.0)
    rows = [row(10 * i, 1, 0.0, at) for i, at in enumerate(seconds, 1)]
    rows[3]["eval/success_at_end"] = 0.5
    assert [line.split()[0] for line in said(capsys, rows)] == ["10", "30", "40", "60"]


def test_success_in_training_is_the_mean_of_many_episodes_not_the_last_rows(capsys):
    rows = [row(10, 30, 0.0, **{"eval/success_at_end": 0.5}), row(20, 10, 1.0, 12.0)]
    assert last_line(capsys, rows) == ["20 of 1000 frames, 12 s: success 0.50, in training 0.25"]


def test_only_the_last_episodes_count(capsys):
    rows = [row(10, WINDOW, 0.0), row(20, WINDOW, 0.75, 12.0)]
    assert last_line(capsys, rows) == ["20 of 1000 frames, 12 s: in training 0.75"]


def test_rows_in_which_no_episode_ended_change_nothing(capsys):
    nan = float("nan")
    rows = [row(10, 0, nan), row(20, 4, 0.5), row(30, 0, nan, 12.0)]
    assert last_line(capsys, rows) == ["30 of 1000 frames, 12 s: in training 0.50"]


def test_an_evaluation_is_shown_with_the_frames_after_which_the_policy_was_saved(capsys):
    with Progress(1000) as progress:
        progress.show(row(10, 4, 0.5))
        progress.show(row(20, 4, 0.5, 3.0))
        progress.show_evaluation(row(10, 4, 0.5, **{"eval/success_at_end": 0.25, "time/evaluated": 4.0}))
    assert capsys.readouterr().out.splitlines()[-1] == "10 of 1000 frames, 4 s: success 0.25"


def test_the_start_is_shown_before_torch_is_imported():
    code = "import sys; from trainers.run.progress import Progress; Progress(10); sys.exit('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("starting a run of 10 frames\n", 0)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_begins_at_the_frames_of_the_run_that_is_resumed(monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with Progress(1000) as progress:
        progress.resume(400)
        progress.show(row(500, 1, 0.5))
    seen = re.findall(r"(\d+)/1000", terminal.getvalue())
    assert [int(frames) for frames in dict.fromkeys(seen)] == [0, 400, 500]


def test_nothing_is_shown_where_it_is_not_wanted(capsys):
    with Progress(1000, shown=False) as progress:
        progress.resume(400)
        progress.show(row(500, 1, 0.5, **{"eval/success_at_end": 0.5}))
    assert capsys.readouterr() == ("", "")


def test_a_bar_makes_no_semaphore_that_a_killed_run_would_leave():
    code = (
        "from pathlib import Path\n"
        "from trainers.run.progress import Progress\n"
        "with Progress(1000):\n"
        "    print('/dev/shm/sem.' in Path('/proc/self/maps').read_text())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False", done.stderr

"""Reports of sweeps: tables, page and error messages."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from core.errors import ConfigError
from tests.helpers.programs import run_module
from tests.helpers.run_folders import add_run, config
from trainers.evaluation.video import open_video
from trainers.reports.report import write
from trainers.sweeps.runs import find_runs


@pytest.fixture
def sweep(tmp_path):
    """Two scenarios of three seeds each, one that failed, and one that was stopped."""
    curves = {0: (0.2, 0.6, 0.95), 1: (0.5, 0.9, 0.9), 2: (0.1, 0.4, 0.8)}
    for seed, curve in curves.items():
        values = config(seed, control="absolute", scenario=1, task="nl_pick_and_place")
        add_run(tmp_path / f"{seed}_a", values, curve, success=curve[-1], wrong=0.01 * seed)
        values = config(seed, robot="panda", scenario=4, task="nl_pick_and_place")
        done = None if seed == 2 else 1.0
        add_run(tmp_path / f"{seed + 3}_b", values, (0.1, 1.0), success=done, error="boom\n" if seed == 2 else None)
    values = config(0, scenario=5, robot="jaco", algo="sac", task="nl_pick_and_place")
    add_run(tmp_path / "10_c", values, (0.1,), success=None)
    start = {
        "time": "2000-01-01 00:00:00",
        "overrides": ["scenario='1','4','5'"],
        "machine": {"cores": "2", "cpu": "a"},
    }
    (tmp_path / "sweep.yaml").write_text(yaml.safe_dump([start]))
    return tmp_path


def table(text: str, heading: str) -> list[list[str]]:
    """The rows of the first table under a heading, its header first."""
    lines = text.split(f"## {heading}\n")[1].split("\n## ")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    return [rows[0], *rows[2:]]


@pytest.mark.slow
def test_the_configuration_table_summarises_the_seeds(sweep):
    write(sweep)
    header, first, second, together = table((sweep / "report.md").read_text(), "Final success and time to success")
    row = dict(zip(header, first, strict=True))
    assert row["configuration"] == "1: kuka absolute ppo"
    assert row["seeds"] == "3"
    assert row["success (95 %)"] == "0.883 (0.800-0.950)"  # of three seeds, the mean, and the lowest and the highest
    assert row["worst seed (95 %)"] == "seed 2: 0.800 (0.763-0.833)"
    assert (row["wrong object"], row["final / best"]) == ("0.010", "1.00")
    assert [row[f"frames to {level} %"] for level in (50, 90, 95)] == ["200", "300", "-"]
    assert [row[f"seconds to {level} %"] for level in (50, 90, 95)] == ["20", "30", "-"]
    assert second[:3] == ["4: panda step ppo", "2 of 3", "1.000 (1.000-1.000)"]
    assert together[:2] == ["all", "5"]
    assert together[2].startswith("0.950 ")  # of 0.8, 0.9, 0.95, 1, 1 without the lowest and the highest


@pytest.mark.slow
def test_every_seed_has_a_row(sweep):
    write(sweep)
    rows = table((sweep / "report.md").read_text(), "Every seed")
    assert [row[:2] for row in rows[1:]] == [
        *(["1: kuka absolute ppo", f"{seed}"] for seed in (0, 1, 2)),
        *(["4: panda step ppo", f"{seed}"] for seed in (0, 1)),
    ]
    assert rows[1][-3:] == ["200 (20 s)", "300 (30 s)", "300 (30 s)"]
    assert rows[3][-3:] == ["300 (30 s)", "-", "-"]


def test_unfinished_runs_are_listed_with_error_and_command(sweep):
    write(sweep)
    rows = table((sweep / "report.md").read_text(), "Runs that did not finish")
    assert rows[1:] == [
        ["5_b", "python train.py scenario=4 seed=2", "failed: boom"],
        ["10_c", "python train.py scenario=5 seed=0", "not finished"],
    ]


@pytest.mark.slow
def test_commands_and_machine_come_from_the_sweep_file(sweep):
    write(sweep)
    text = (sweep / "report.md").read_text()
    assert table(text, "Commands")[1] == ["2000-01-01 00:00:00", "python train.py -m scenario=1,4,5"]
    assert table(text, "Machine")[1:] == [["cores", "2"], ["cpu", "a"]]


def test_the_html_page_is_one_file_without_external_resources(sweep):
    page = write(sweep).read_text()
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) == 3
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"https?://|<link|<script [^>]*src|@import|href=", page)
    pictures = re.findall(r"!\[.*\]\((.*)\)", (sweep / "report.md").read_text())
    assert pictures == ["success.png", "tasks.png", "losses.png"]
    assert all((sweep / name).stat().st_size > 5000 for name in pictures)


def add_film(run: Path, pixels: int = 64) -> None:
    rng = np.random.default_rng(0)
    with open_video(run / "evaluation.mp4", 20) as video:
        for _ in range(20):
            video.append_data(rng.integers(0, 255, (pixels, pixels, 3)).astype(np.uint8))


def test_films_are_in_the_page_and_a_damaged_one_is_only_named(tmp_path):
    for seed in range(3):
        add_run(tmp_path / f"{seed}_a", config(seed))
    add_film(tmp_path / "0_a")
    (tmp_path / "1_a" / "evaluation.mp4").write_bytes(b"no film")
    page = write(tmp_path).read_text()
    (film,) = re.findall(r'src="data:video/mp4;base64,([^"]*)"', page)
    assert base64.b64decode(film) == (tmp_path / "0_a" / "evaluation.mp4").read_bytes()
    assert page.count("data:image/jpeg;base64,") == 1
    assert f"{tmp_path / '1_a' / 'evaluation.mp4'}" in page
    assert f"{tmp_path / '2_a' / 'evaluation.mp4'}" not in page


@pytest.mark.slow
def test_the_page_stays_below_5_mb_and_shows_a_picture_of_films_that_do_not_fit(tmp_path):
    for seed in range(6):
        add_film(add_run(tmp_path / f"{seed}_a", config(seed)), pixels=256)
    sizes = [(tmp_path / f"{seed}_a" / "evaluation.mp4").stat().st_size for seed in range(6)]
    assert sum(sizes) > 3.75e6  # as text more than 5 MB
    page = write(tmp_path).read_text()
    assert len(page) < 5e6
    assert 0 < page.count("data:video/mp4") < 6
    assert page.count("data:image/jpeg") == 6


def test_a_sweep_that_has_not_ended_says_how_many_runs_it_lacks(sweep):
    start = {"time": "-", "overrides": ["scenario='1','4','5'", "seed=range(5)"]}
    (sweep / "sweep.yaml").write_text(yaml.safe_dump([start]))
    assert "<h1>5 of 15 runs of 2 configurations</h1>" in write(sweep).read_text()


def test_one_seed_has_no_interval_of_its_own(tmp_path):
    add_run(tmp_path / "0_a", config(0), success=0.456)
    write(tmp_path)
    _, row = table((tmp_path / "report.md").read_text(), "Final success and time to success")
    assert row[2:4] == ["0.456", "seed 0: 0.456 (0.413-0.500)"]


def test_text_of_a_run_is_escaped(tmp_path):
    add_run(tmp_path / "0_a", config(0))
    add_run(tmp_path / "1_a", config(1), success=None, error="a | b <script>")
    page = write(tmp_path).read_text()
    assert "&lt;script&gt;" in page
    assert "a \\| b" in (tmp_path / "report.md").read_text()


@pytest.mark.slow
def test_the_main_tasks_have_a_figure_if_there_are_any(tmp_path):
    for number, task in enumerate(("nl_reach", "reach", "nl_reach_gesture")):
        add_run(tmp_path / f"{number}_a", config(0, task=task))
    write(tmp_path)
    assert "Mean reward and success ratio: nl_reach, nl_reach_gesture]" in (tmp_path / "report.md").read_text()
    other = tmp_path / "other"
    add_run(other / "0_a", config(0, task="reach"))
    write(other)
    assert "Main tasks" not in (other / "report.md").read_text()


@pytest.mark.slow
def test_a_directory_may_hold_several_sweeps_or_be_a_single_run(tmp_path):
    run = add_run(tmp_path / "first" / "0_a", config(0))
    add_run(tmp_path / "second" / "0_a", config(1))
    assert len(find_runs(tmp_path)) == 2
    assert write(run) == run / "report.html"


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("metrics.csv", "frames,eval/success_at_end\n100,0.5\n200,x\n300,0.5\n", r"metrics\.csv is damaged: line 3"),
        ("metrics.csv", "frames,eval/success_at_end\n100\n200,0.5\n", r"metrics\.csv is damaged: line 2"),
        ("metrics.csv", "\0\0\0\n", r"metrics\.csv is damaged: its first line"),
        ("eval.json", '{"success_at_end": 0.9', r"eval\.json is damaged"),
        ("eval.json", '{"success_at_end": 0.9}', r"eval\.json is damaged: it has no ci95"),
        ("config.yaml", "seed: [", r"config\.yaml is damaged: it is not YAML: "),
        ("config.yaml", "", r"config\.yaml is damaged: it is empty$"),
        ("config.yaml", "# sha256: 0\nseed: 1\n", r"config\.yaml is damaged: its sha256 does not fit"),
        ("job.json", "[]", r"job\.json is damaged: it holds no group of keys$"),
    ],
)
def test_a_damaged_file_is_named(file, text, message, tmp_path):
    add_run(tmp_path / "0_a", config())
    (tmp_path / "0_a" / file).write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        write(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_report_without_finished_runs_is_refused_with_the_first_error(tmp_path):
    add_run(tmp_path / "0_a", config(), success=None, error="Traceback\n  x\nKeyError: 'a'\n")
    with pytest.raises(ConfigError, match=r"no run in .* has finished; 1 failed: KeyError: 'a'"):
        write(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give one directory"),
        (["{tmp}/nowhere"], "nowhere does not exist"),
        (["{tmp}"], "holds no runs"),
        (["{tmp}/file"], "file is not a directory"),
    ],
)
def test_bad_input_gets_one_line_and_no_traceback(arguments, message, tmp_path):
    (tmp_path / "file").touch()
    words = [word.format(tmp=tmp_path) for word in arguments]
    done = run_module("trainers.reports.report", *words)
    assert done.code == 1
    assert done.out == ""
    (line,) = done.err.splitlines()
    assert line.startswith("error: ")
    assert message in line

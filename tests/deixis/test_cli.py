"""The console command `deixis`: help, version, unknown commands, and that it starts without heavy libraries."""

import subprocess
import sys

import pytest

import deixis
from deixis import cli


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["deixis", *words])
    return cli.main()


@pytest.mark.parametrize("words", [(), ("-h",), ("--help",)])
def test_help_lists_every_command(words, monkeypatch, capsys):
    assert run(monkeypatch, *words) == 0
    said = capsys.readouterr().out
    for name in ("train", "evaluate", "play", "record", "report", "parse", "describe"):
        assert f"\n  {name} " in said


def test_version_is_the_package_version(monkeypatch, capsys):
    assert run(monkeypatch, "--version") == 0
    assert capsys.readouterr().out == f"deixis {deixis.__version__}\n"


def test_an_unknown_command_is_refused_in_one_line(monkeypatch, capsys):
    assert run(monkeypatch, "traim") == 2
    said = capsys.readouterr()
    assert said.err == "error: traim is not a command of deixis; did you mean 'train'?\n"
    assert said.out == ""


def test_every_command_loads(monkeypatch):
    assert all(callable(program.load()) for program in cli.PROGRAMS.values())


def test_parse_and_describe_are_those_of_python_m_language(monkeypatch, capsys, tmp_path):
    assert run(monkeypatch, "parse", "reach the red cube") == 0
    assert capsys.readouterr().out == "task reach, object the red cube\n"
    scene = tmp_path / "scene.yaml"
    scene.write_text("- {id: a, noun: cube, color: red, position: [0.5, 0.1, 0.0]}\n")
    assert run(monkeypatch, "describe", "--scene", str(scene)) == 0
    assert "cube" in capsys.readouterr().out
    assert run(monkeypatch, "parse", "reach the rde cube") == 2


def test_report_refuses_what_is_no_folder_of_runs(monkeypatch, tmp_path, capsys):
    with pytest.raises(SystemExit, match=r"^error: .*no run"):
        run(monkeypatch, "report", str(tmp_path))


def test_evaluate_names_the_pretrained_policies_where_a_checkpoint_is_missing(monkeypatch):
    with pytest.raises(SystemExit, match=r"^error: checkpoint=nl_reach_kuca .*did you mean 'nl_reach_kuka'\?$"):
        run(monkeypatch, "evaluate", "checkpoint=nl_reach_kuca")


def test_help_imports_no_heavy_library():
    heavy = {"torch", "tensordict", "torchrl", "pybullet", "hydra", "matplotlib", "numpy"}
    code = "import sys; from deixis.cli import main; sys.argv = ['deixis', '--help']; main()\n"
    code += f"print('loaded', *set({sorted(heavy)}) & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded"

"""The reference pages agree with the specs."""

from pathlib import Path

import pytest

from core.errors import ConfigError
from core.overrides import groups
from envs import make_env
from envs.mdp.observations import descriptions
from tools import reference_tables
from tools.reference_tables import main

REFERENCE = Path(reference_tables.__file__).parents[1] / "docs" / "reference"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pages():
    return reference_tables.pages()


def test_the_committed_pages_are_up_to_date(pages):
    for name, text in pages.items():
        assert (REFERENCE / name).read_text("utf-8") == text, "run python -m tools.reference_tables"
    assert sorted(path.name for path in REFERENCE.glob("*.md")) == sorted(pages)


def test_every_task_and_robot_has_a_section(pages):
    assert [line[3:] for line in pages["tasks.md"].splitlines() if line[:3] == "## "][4:] == groups()["task"]
    assert [line[3:] for line in pages["robots.md"].splitlines() if line[:3] == "## "] == groups()["robot"]


@pytest.mark.parametrize("choice", [("throw", "panda", "joints"), ("turn", "jaco", "absolute")])
def test_widths_equal_those_of_an_environment(choice, pages):
    """These combinations are not among those from which the pages are made."""
    task, robot, control = choice
    env = make_env([f"task={task}", f"robot={robot}", f"control={control}"])
    robot_width, action_width = env.observation_spec["robot"].shape[-1], env.action_spec.shape[-1]
    shapes = {key: tuple(env.observation_spec[key].shape[1:]) for key in ("objects", "reward_terms")}
    env.close()
    table = pages["tasks.md"].partition("## Numbers of")[2].partition("\n## ")[0]
    head, _, *rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line[:1] == "|"
    ]
    first = next(i for i, row in enumerate(rows) if f"`{task}`" in row[0])
    row = next(row for row in rows[first:] if row[1] == robot)
    assert (int(row[2]), int(row[head.index(f"`action`, `{control}`")])) == (robot_width, action_width)
    section = pages["tasks.md"].partition(f"\n## {task}\n")[2].partition("\n## ")[0]
    for key, shape in shapes.items():
        assert f"| `{key}` | (N, {', '.join(map(str, shape))}) |" in section


def test_every_key_has_a_description(pages):
    named = {line.split("`")[1] for line in pages["tasks.md"].splitlines() if line.count("| (N")}
    asked_for = {"privileged/places", "pixels", "tip", "privileged/seen_at"}  # with noise, and with pictures
    assert named | asked_for == set(descriptions())


def test_check_refuses_a_page_that_is_out_of_date(tmp_path, monkeypatch, pages, capsys):
    monkeypatch.setattr(reference_tables, "pages", lambda: pages)
    main([f"out={tmp_path / 'new'}"])
    main([f"out={tmp_path / 'new'}", "check=true"])
    assert capsys.readouterr().out.split() == [str(tmp_path / "new" / name) for name in pages]
    (tmp_path / "new" / "robots.md").write_text("old")
    message = r"robots\.md is out of date; run python -m tools\.reference_tables"
    with pytest.raises(ConfigError, match=message) as caught:
        main([f"out={tmp_path / 'new'}", "check=true"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("chek=true", r"chek is not a known key; did you mean 'check'\?"),
        ("check=perhaps", "check=perhaps: "),
        ("out={file}/x", "out=.*/x cannot be a folder: Not a directory"),
    ],
)
def test_bad_arguments_raise_an_error_of_one_line(word, message, tmp_path, monkeypatch, pages):
    monkeypatch.setattr(reference_tables, "pages", lambda: pages)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=message) as caught:
        main([word.format(file=tmp_path / "file")])
    assert "\n" not in str(caught.value)

"""The contact sheets show robots, persons and sentences."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from core.errors import ConfigError
from core.overrides import groups
from tools import gallery
from tools.gallery import COLUMNS, HEIGHT, MARGIN, WIDTH, main, sheet, tasks, workspaces

SHIRT = (42, 71, 105)  # RGB of the person's shirt, lit

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cells():
    return workspaces(["collabtable", "drawer"], ["kuka"]) + tasks(["nl_lift"])


def near(picture, color, apart=40):
    """The number of pixels with about this colour."""
    return int((np.abs(np.asarray(picture, int) - color).max(-1) < apart).sum())


def test_a_cell_shows_robot_person_and_sentence(cells):
    assert [cell.title for cell in cells] == ["collabtable, kuka", "drawer, kuka", "nl_lift"]
    assert [near(cell.picture, (240, 100, 10)) > 200 for cell in cells] == [True] * 3  # the kuka's orange
    assert [near(cell.picture, SHIRT, apart=14) > 200 for cell in cells] == [True, False, False]
    assert cells[2].sentence.startswith("lift the ")


def test_robot_and_person_are_not_cut_at_the_edges(cells):
    """The edges show only table, floor or background."""
    for cell in cells:
        top, left, right = cell.picture[0], cell.picture[:, 0], cell.picture[:, -1]
        assert (top > 250).all(), cell.title
        assert near(left, (240, 100, 10)) + near(right, (240, 100, 10)) == 0, cell.title


def test_a_sheet_has_each_picture_in_its_place(cells):
    whole = np.asarray(sheet(cells).convert("RGB"), int)
    assert whole.shape[1] == 3 * (WIDTH + MARGIN) + MARGIN
    for i, cell in enumerate(cells):
        x = MARGIN + i * (WIDTH + MARGIN)
        shown = whole[MARGIN : MARGIN + HEIGHT, x : x + WIDTH]
        assert np.abs(shown - cell.picture).mean() < 4
        assert (whole[MARGIN + HEIGHT :, x : x + WIDTH] < 100).any()  # its caption


def test_every_workspace_robot_and_task_is_rendered(tmp_path, monkeypatch, cells):
    asked = {}

    def note(name):
        return lambda *given: asked.update({name: given}) or cells[:1]

    monkeypatch.setattr(gallery, "workspaces", note("workspaces"))
    monkeypatch.setattr(gallery, "tasks", note("tasks"))
    main([f"out={tmp_path / 'new'}", "seed=7", "physics.substeps=6"])
    options = groups()
    assert asked["workspaces"] == (options["workspace"], options["robot"], ["physics.substeps=6"], 7)
    assert asked["tasks"] == (options["task"], ["physics.substeps=6"], 7)
    assert Image.open(tmp_path / "new" / "tasks.png").size[0] > WIDTH


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("docs", "docs: arguments are written key=value"),
        ("seed=-1", "seed=-1 is out of range"),
        ("sed=1", r"sed=1: sed is not a known key; did you mean 'seed'\?"),
        ("robot=pand", r"robot=pand is not known; did you mean 'panda'\?"),
        ("out={file}/x", "out=.*/x cannot be a folder: Not a directory"),
    ],
)
def test_bad_gallery_arguments_raise_an_error_of_one_line(word, message, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=message) as caught:
        main([word.format(file=tmp_path / "file")])
    assert "\n" not in str(caught.value)


def test_the_committed_sheets_are_small_and_used_in_the_docs():
    docs = Path(gallery.__file__).parents[1] / "docs"
    pages = [page.read_text("utf-8") for page in docs.glob("*.md")]
    for name, cells in (("workspaces.png", 24), ("tasks.png", 18)):
        assert (docs / "gallery" / name).stat().st_size < 500_000
        assert Image.open(docs / "gallery" / name).height > cells / COLUMNS * HEIGHT
        assert any(f"gallery/{name})" in page for page in pages), name

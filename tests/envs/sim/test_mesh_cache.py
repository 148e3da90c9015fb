"""Files made from meshes are kept on disk between processes."""

import pytest

from envs.sim.urdf import cache_folder, kept_folder, scratch


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "deixis"


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text("a mesh")
    return path


class Maker:
    """Writes a hull, and counts how often."""

    def __init__(self):
        self.count = 0

    def __call__(self, folder):
        self.count += 1
        (folder / "hull.obj").write_text(f"hull {self.count}")


def test_the_same_meshes_are_made_once_and_changed_ones_anew(home, mesh):
    make = Maker()
    first, again = kept_folder([mesh], make), kept_folder([mesh], make)
    assert first == again
    assert first.parent == home == cache_folder()
    assert (first / "hull.obj").read_text() == "hull 1"
    mesh.write_text("another mesh")
    assert (kept_folder([mesh], make) / "hull.obj").read_text() == "hull 2"
    assert make.count == 2


def test_nothing_is_left_of_what_could_not_be_made(home, mesh):
    def fail(folder):
        (folder / "hull.obj").write_text("half of it")
        raise ValueError("a mesh without points")

    with pytest.raises(ValueError, match="without points"):
        kept_folder([mesh], fail)
    assert list(home.iterdir()) == []


def test_where_nothing_can_be_kept_files_are_made_for_the_process(tmp_path, monkeypatch, mesh):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    make = Maker()
    folder = kept_folder([mesh], make)
    assert folder.parent == scratch()
    assert kept_folder([mesh], make) == folder
    assert make.count == 1


def test_another_process_that_makes_the_same_first_is_no_error(home, mesh):
    make = Maker()

    def late(folder):
        kept_folder([mesh], make)
        (folder / "hull.obj").write_text("late")

    assert (kept_folder([mesh], late) / "hull.obj").read_text() == "hull 1"


def test_a_relative_cache_home_is_ignored(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "deixis"

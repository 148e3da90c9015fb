"""Files made from others are kept for all processes and runs, keyed by content, and can be deleted at any time."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from core import file_cache
from core.errors import RunError
from core.file_cache import cache_folder, cached_folder, cached_text, file_digest, temporary_folder

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "deixis"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "arm.stl"
    path.write_text("a mesh")
    return path


class Maker:
    """Writes a hull, and counts how often."""

    def __init__(self, size=0):
        self.count, self.size = 0, size

    def __call__(self, folder):
        self.count += 1
        (folder / "hull.obj").write_text(f"hull {self.count}" + " " * self.size)


def test_the_same_sources_are_made_once_and_an_edited_mesh_gives_another_entry(home, mesh):
    make = Maker()
    first, again = cached_folder("hull", [mesh], make), cached_folder("hull", [mesh], make)
    assert first == again
    assert first.parent == home == cache_folder()
    assert (first / "hull.obj").read_text() == "hull 1"
    mesh.write_text("b mesh")  # as many bytes, and at the same time
    other = cached_folder("hull", [mesh], make)
    assert (other / "hull.obj").read_text() == "hull 2"
    assert (first / "hull.obj").is_file()
    mesh.write_text("a mesh")
    assert cached_folder("hull", [mesh], make) == first
    assert make.count == 2


def test_files_of_the_same_name_and_size_in_two_folders_differ(home, tmp_path):
    paths = [tmp_path / name / "model.urdf" for name in "ab"]
    for path in paths:
        path.parent.mkdir()
        path.write_text(f"robot {path.parent.name}")
        os.utime(path, (1, 1))
    assert len({cached_folder("robot", [path], Maker()) for path in paths}) == 2
    assert file_digest(paths[0]) != file_digest(paths[1])


def test_the_boundary_between_sources_counts(home):
    assert cached_folder("text", ["ab", "c"], Maker()) != cached_folder("text", ["a", "bc"], Maker())


def test_a_text_is_a_file_of_that_name(home):
    path = cached_text("model.urdf", "<robot/>")
    assert (path.name, path.read_text()) == ("model.urdf", "<robot/>")
    assert cached_text("model.urdf", "<robot />") != path


@pytest.mark.parametrize("what", ["entry", "file", "everything"])
def test_what_was_deleted_is_made_again(home, mesh, what):
    make = Maker()
    entry = cached_folder("hull", [mesh], make)
    (entry / "hull.obj").unlink()
    if what != "file":
        (entry / file_cache.MANIFEST).unlink()
        entry.rmdir()
    if what == "everything":
        home.rmdir()
    again = cached_folder("hull", [mesh], make)
    assert (again, (again / "hull.obj").read_text()) == (entry, "hull 2")


def test_a_folder_that_is_deleted_while_an_entry_is_made_does_no_harm(home, mesh):
    make = Maker()

    def interrupted(folder):
        make(folder)
        if make.count == 1:
            (folder / "hull.obj").unlink()
            folder.rmdir()
            home.rmdir()

    assert (cached_folder("hull", [mesh], interrupted) / "hull.obj").read_text() == "hull 2"


def test_nothing_is_left_of_what_could_not_be_made(home, mesh):
    def fail(folder):
        (folder / "hull.obj").write_text("half of it")
        raise ValueError("a mesh without points")

    with pytest.raises(ValueError, match="without points"):
        cached_folder("hull", [mesh], fail)
    assert list(home.iterdir()) == []


def test_another_process_that_makes_the_same_first_is_no_error(home, mesh):
    make = Maker()

    def late(folder):
        cached_folder("hull", [mesh], make)
        (folder / "hull.obj").write_text("late")

    assert (cached_folder("hull", [mesh], late) / "hull.obj").read_text() == "hull 1"


@pytest.fixture
def restless_threads():
    """Let threads take turns after nearly every instruction."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


@pytest.mark.usefixtures("restless_threads")
def test_many_threads_get_the_same_whole_entry(home):
    make = Maker(size=100_000)
    rounds = range(25)

    def sizes(name):
        with ThreadPoolExecutor(8) as threads:
            entries = [threads.submit(cached_folder, "hull", [name], make) for _ in range(8)]
            return [(entry.result() / "hull.obj").stat().st_size > 100_000 for entry in entries]

    assert all(all(sizes(str(number))) for number in rounds)
    assert len(list(home.iterdir())) == len(rounds)


@pytest.mark.usefixtures("restless_threads")
def test_threads_that_complete_an_entry_do_not_take_it_from_each_other(home, mesh):
    make = Maker()
    entry = cached_folder("hull", [mesh], make)
    (entry / "hull.obj").unlink()

    def get(_):
        return (cached_folder("hull", [mesh], make) / "hull.obj").read_text()

    with ThreadPoolExecutor(8) as threads:
        assert all(text.startswith("hull") for text in threads.map(get, range(50)))
    assert list(home.iterdir()) == [entry]


def test_two_processes_share_an_entry(home, mesh):
    code = (
        "import sys; from pathlib import Path; from core.file_cache import cached_folder\n"
        "def make(folder): (folder / 'hull.obj').write_text('made'); print('made')\n"
        "cached_folder('hull', [Path(sys.argv[1])], make)"
    )
    said = [
        subprocess.run([sys.executable, "-c", code, str(mesh)], cwd=ROOT, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [done.stdout for done in said] == ["made\n", ""]


def test_entries_that_were_not_used_for_the_longest_time_go(home, monkeypatch):
    monkeypatch.setattr(file_cache, "MOST_BYTES", 3_500)
    make = Maker(size=1_000)
    entries = {name: cached_folder("hull", [name], make) for name in "abc"}
    for age, name in enumerate("cba"):
        os.utime(entries[name], (1_000_000 - age, 1_000_000 - age))
    assert cached_folder("hull", ["a"], make) == entries["a"]  # used again
    cached_folder("hull", ["d"], make)
    assert [name for name, entry in entries.items() if entry.exists()] == ["a", "c"]


def test_an_entry_larger_than_the_bound_is_kept_while_it_is_the_newest(home, monkeypatch):
    monkeypatch.setattr(file_cache, "MOST_BYTES", 500)
    first, second = (cached_folder("hull", [name], Maker(size=1_000)) for name in "ab")
    assert (first.exists(), second.exists()) == (False, True)


def test_what_a_killed_process_left_goes_after_an_hour(home, mesh):
    home.mkdir(parents=True)
    old, new = (home / f"{file_cache.MAKING}{name}" for name in ("old", "new"))
    for folder in (old, new):
        folder.mkdir()
    os.utime(old, (1_000_000, 1_000_000))
    cached_folder("hull", [mesh], Maker())
    assert (old.exists(), new.exists()) == (False, True)


def test_where_the_home_cannot_be_written_to_one_temporary_folder_serves_the_user(
    tmp_path, monkeypatch, mesh, temporary
):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    make = Maker()
    folder = cached_folder("hull", [mesh], make)
    assert folder.parent == temporary_folder()
    assert cached_folder("hull", [mesh], make) == folder
    assert make.count == 1
    assert list(temporary.iterdir()) == [temporary_folder()]


def test_the_temporary_folder_of_another_user_is_not_used(tmp_path, monkeypatch, mesh, temporary):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    (tmp_path / "theirs").mkdir()
    temporary_folder().symlink_to(tmp_path / "theirs")
    with pytest.raises(RunError, match="belongs to another user"):
        cached_folder("hull", [mesh], Maker())


def test_a_relative_cache_home_is_ignored(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "deixis"


def test_a_source_that_is_missing_is_an_error(home, tmp_path):
    with pytest.raises(FileNotFoundError):
        cached_folder("hull", [tmp_path / "none.stl"], Maker())

"""Files that someone else wrote: bounds of size, nesting and repetition, and plain values only."""

from __future__ import annotations

import os

import pytest
import yaml

from core.safe_files import FileError, check_plain, parse_yaml, read_bytes, read_json, read_yaml


def merge_bomb(levels: int = 9, width: int = 9) -> bytes:
    """A few hundred bytes that describe width^levels keys."""
    lines = ["a0: &a0 {k: v}"]
    lines += [f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * width)}]}}" for i in range(1, levels)]
    return "\n".join(lines).encode()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[" * 100_000, "nested more than 60 deep"),
        (b"!!python/object/apply:os.system [id]", "the tag .* is not accepted"),
        (b"- " + b"1:" * 20_000 + b"1.5", "too large"),
        (b"- 0b" + b"x", None),
        (b"\xff\xfe\x00\xd8", "is not YAML"),
    ],
)
def test_unsafe_yaml_is_refused(content, message):
    if message is None:
        assert parse_yaml(content) == ["0bx"]
        return
    with pytest.raises(FileError, match=message):
        parse_yaml(content)


@pytest.mark.slow
@pytest.mark.parametrize("has_libyaml", [True, False])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (merge_bomb(), "describes more than"),
        (merge_bomb().replace(b"<<:", b"x:"), "describes more than"),
        (b"- 1\n" * 60_000, "describes more than"),
        (b"[" * 2_000, "nested more than 60 deep"),
        (b"[" * 50 + b"\x01", "special characters are not allowed"),
    ],
)
def test_yaml_is_refused_before_a_value_is_built(content, message, has_libyaml, monkeypatch):
    monkeypatch.setattr(yaml, "load", lambda *_, **__: pytest.fail("a value was built"))
    if not has_libyaml:
        monkeypatch.delattr(yaml, "CSafeLoader")
    with pytest.raises(FileError, match=message):
        parse_yaml(content)


def test_aliases_within_the_bound_are_read():
    assert parse_yaml(b"a: &a [1, 2]\nb: *a\nc: {<<: {d: 1}}") == {"a": [1, 2], "b": [1, 2], "c": {"d": 1}}


def test_only_regular_files_of_a_bounded_size_are_read(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    with open(tmp_path / "large", "wb") as file:
        file.truncate(2**40)
    (tmp_path / "link").symlink_to("/dev/zero")
    for name, message in (("fifo", "not a regular file"), ("link", "not a regular"), ("large", "1,099,511,627,776")):
        for reader in (read_bytes, read_yaml, read_json):
            with pytest.raises(FileError, match=message):
                reader(tmp_path / name)
    with pytest.raises(FileError, match="No such file"):
        read_bytes(tmp_path / "none")
    with pytest.raises(FileError, match="cannot be read"):
        read_bytes(tmp_path / "a\0b")
    (tmp_path / "empty").touch()
    assert read_bytes(tmp_path / "empty") == b""


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "", "NaN", '"\ud800'.encode("utf-8", "surrogatepass")])
def test_invalid_json_is_refused(tmp_path, text):
    (tmp_path / "x.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FileError, match="is not"):
        read_json(tmp_path / "x.json")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"a": {"_target_": "os.system"}}, "'_target_'"),
        ({"a": ["${oc.env:HOME}"]}, "interpolations"),
        ({1: 2}, "the key 1"),
        ({"a": {1, 2}}, "of type set"),
        ({"a": [[]] * 60_000}, "too large"),
    ],
)
def test_a_config_that_is_not_plain_is_refused(value, message):
    with pytest.raises(FileError, match=message):
        check_plain(value)
    check_plain({"a": [1, 2.0, "x", None, True], "b": {"c": {}}})

"""Joining a Ray cluster, and the messages for what cannot be joined. No test here starts Ray."""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from core.errors import ConfigError
from trainers.cluster import ray_session
from trainers.cluster.ray_session import RaySession, difference, import_ray, versions


@pytest.fixture(autouse=True)
def no_cluster_of_this_machine(monkeypatch, tmp_path):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(ray_session, "CURRENT_CLUSTER", tmp_path / "ray_current_cluster")
    monkeypatch.setattr(ray_session, "CONNECT_SECONDS", 0.2)


def free_port() -> int:
    with socket.socket() as each:
        each.bind(("127.0.0.1", 0))
        return int(each.getsockname()[1])


def test_a_missing_ray_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r'needs ray, which is not installed: pip install -e "\.\[cluster\]"'):
        import_ray()


@pytest.mark.parametrize(("free", "size"), [(64 * 2**20, 2**29), (3 * 2**30, 3 * 2**29), (2**40, 2**32)])
def test_the_object_store_takes_half_of_the_free_shared_memory_within_limits(monkeypatch, free, size):
    monkeypatch.setattr(ray_session.shutil, "disk_usage", lambda path: SimpleNamespace(free=free))
    monkeypatch.setattr(ray_session, "SHARED_MEMORY", Path.cwd())
    assert ray_session._store_bytes() == size


@pytest.mark.slow
def test_an_address_that_nothing_answers_is_named():
    address = f"127.0.0.1:{free_port()}"
    with pytest.raises(ConfigError, match=f"collector.address={address} is out of reach"):
        RaySession(address)


def test_an_address_without_a_port_is_named():
    with pytest.raises(ConfigError, match=r"collector\.address=cluster must be HOST:PORT"):
        RaySession("cluster")


def test_the_variable_with_a_bad_address_is_named(monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", "ray://here")
    with pytest.raises(ConfigError, match="RAY_ADDRESS=ray://here must be HOST:PORT"):
        RaySession()


def test_auto_without_a_cluster_says_how_to_start_one():
    with pytest.raises(ConfigError, match=r"finds no cluster on this machine; run `ray start --head`"):
        RaySession("auto")


def test_a_cluster_of_this_machine_that_has_ended_is_not_joined():
    ray_session.CURRENT_CLUSTER.write_text(f"127.0.0.1:{free_port()}\n")
    assert ray_session._find_address(None) is None


def test_a_cluster_of_this_machine_that_listens_is_joined():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        ray_session.CURRENT_CLUSTER.write_text(address)
        assert ray_session._find_address(None) == "auto"
        assert ray_session._find_address("local") is None


def test_the_versions_of_two_nodes_are_compared_by_name():
    own = versions()
    assert difference(own, versions()) == ""
    assert difference(own, own | {"torch": "1.0"}) == f"torch 1.0 there, {own['torch']} here"
    assert own["Deixis"].startswith("sources ")


def test_the_checksum_of_the_sources_follows_their_contents(monkeypatch, tmp_path):
    from trainers.cluster import ray_session as module

    monkeypatch.setattr(module, "ROOT", tmp_path)
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "a.py").write_text("a = 1")
    before = versions()["Deixis"]
    (tmp_path / "conf" / "a.py").write_text("a = 2")
    assert versions()["Deixis"] != before

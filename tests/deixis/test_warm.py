"""`deixis warm`: what it compiles is what a later run uses, and which runs compile nothing."""

import shutil

import pytest

import train
from core.composition import compose
from core.errors import ConfigError, RunError
from deixis.warm import main
from tests.helpers.thorough import some

SMALL = ["task=reach", "policy=mlp", "policy.hidden=[16]", "algo.batch=32", "collector.worlds=8"]
RUN = ["total_frames=600", "algo.compile=on", "eval.episodes=1", "eval.worlds=1", "eval.video_episodes=0", "logger=[]"]
needs_a_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")


@pytest.mark.slow
@needs_a_compiler
@pytest.mark.parametrize("algo", some(["bc", "td3"], 1))  # bc has half as many functions to compile
def test_a_run_finds_compiled_what_was_warmed(algo, tmp_path, monkeypatch, capsys):
    cache, words = tmp_path / "cache", [*SMALL, f"algo={algo}"]
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(cache))
    number = main(words)
    assert number > 0
    assert capsys.readouterr().out == f"{cache}: {number} functions compiled, 0 were there\n"
    train.run(compose([*words, *RUN, *(["algo.learning_starts=100"] if algo == "td3" else [])]), tmp_path / "run")
    assert len(list(cache.rglob("*.so"))) == number


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["algo=ppo"], "algo=ppo compiles no gradient steps; algo=sac, td3,"),
        (["algo=bc", "policy=pixels", "task=nl_reach"], "policy=pixels compiles no gradient steps"),
        (["algo=sac", "collector=ray"], "collector=ray compiles where it learns"),
        (["algo=sca"], "did you mean 'sac'"),
    ],
)
def test_runs_that_compile_nothing_are_refused(words, message):
    with pytest.raises(ConfigError, match=message):
        main(words)


def test_that_nothing_could_be_compiled_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(train, "run", lambda config, folder: {})
    with pytest.raises(RunError, match="no gradient step could be compiled"):
        main([*SMALL, "algo=sac"])

"""What a program says as it refuses bad input."""

import pytest


def refusal(cli, monkeypatch, capsys, *words):
    """Return the only line that `cli` prints as it refuses these words, with exit code 2."""
    monkeypatch.setattr("sys.argv", ["deixis", *words])
    with pytest.raises(SystemExit) as ended:
        cli()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    return said

"""The project's own instruction sets: how many expectations are met, through the function that the page calls."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_own_sets_are_understood_as_well_as_when_they_were_measured():
    command = [sys.executable, "-m", "benchmarks.instructions", "--data", "benchmarks/sets", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    total = json.loads(done.stdout.splitlines()[-1])["total"]
    assert total["n"] == 5932
    assert total["met"] >= 0.88 * total["n"]
    assert total["wrong"] <= 0.01 * total["n"]
    assert total["refused unhelpfully"] <= 0.02 * total["n"]

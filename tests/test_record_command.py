"""record.py as a person uses it: help and bad input."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import record
from core.errors import ConfigError

pytestmark = pytest.mark.slow
ROOT = Path(record.__file__).parent


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "checkpoint=<run dir or file> is missing"),
        (["checkpoint=/nowhere"], "checkpoint=/nowhere does not exist"),
        (["expert=true", "format=hdf"], "format=hdf is not known; choose from lerobot, minari"),
        (["expert=true", "episodes=0"], "episodes=0"),
        (["expert=true", "task=nl_pus"], "did you mean 'nl_push'"),
        (["expert=true", "task.slots=3"], "task.slots is not a known key"),
        (["checkpoint={run}", "robot=panda"], "trained with robot=kuka"),
        (["checkpoint={run}", "gesture=ray", "workspace=collabtable"], "gesture is .* and gesture it was trained with"),
        (["expert=true", "out={run}"], "exists already"),
        (["expert=true", "format=minari", "out=my demos"], "give out=my_demos-v0"),
        (["replay=/nowhere"], "/nowhere does not exist"),
        (["replay={run}"], "not a recording of this project: it has no deixis.json"),
        (["replay={run}", "episodes=3"], "episodes=3: replay=<dir> takes no other key"),
    ],
)
def test_record_refuses_bad_input_in_one_line(tiny_run, words, said):
    with pytest.raises(ConfigError, match=said) as error:
        record.main([word.format(run=tiny_run) for word in words])
    assert "\n" not in str(error.value)


def test_record_prints_its_help_and_refuses_bad_input_in_one_line():
    words = [sys.executable, "record.py"]
    metadata = subprocess.run([*words, "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert "format=lerobot" in metadata.stdout
    refused = subprocess.run([*words, "episodes=2"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    assert refused.stderr.startswith("error: checkpoint=")

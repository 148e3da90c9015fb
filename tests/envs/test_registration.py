"""What `import envs` offers."""

import subprocess
import sys

import pytest


@pytest.mark.slow
def test_nothing_is_printed_at_start():
    code = (
        "import human; import envs; envs.make_env([]).close(); import gymnasium; "
        "gymnasium.make('Deixis/NLPickAndPlace-v0').close()"
    )
    done = subprocess.run([sys.executable, "-W", "error::UserWarning", "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_importing_envs_does_not_import_torch():
    code = "import envs, sys; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"

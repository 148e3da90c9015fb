"""Imports without torch's compiler and Ray: the imports of a run load neither, and both can be imported later."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
LEAN = """
import sys
from core.platform_tuning import lean_imports
with lean_imports():
    import trainers.run.train_loop
heavy = [name for name in ("torch._dynamo", "ray", "sympy", "transformers", "matplotlib") if name in sys.modules]
assert not heavy, heavy
"""
COMPILED = """
import torch
assert torch.compile(lambda x: x + 1, backend="eager")(torch.ones(())) == 2
assert torch._dynamo is sys.modules["torch._dynamo"] and torch._dynamo.__file__
"""


def test_a_run_imports_no_compiler_and_no_ray_and_code_can_still_be_compiled():
    done = subprocess.run([sys.executable, "-c", LEAN + COMPILED], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_compiler_that_was_imported_before_stays():
    code = "import sys, torch._dynamo as before\n" + LEAN.partition("heavy")[0]
    code += "assert sys.modules['torch._dynamo'] is before"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

import subprocess
import sys

CODE = "import sys, language; print(*{'pybullet', 'torch', 'tensordict', 'lark', 'envs'} & set(sys.modules))"


def test_language_imports_no_physics_no_networks_and_no_parser_until_it_parses():
    found = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []

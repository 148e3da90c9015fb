"""Calls explain themselves: what takes more than four arguments takes the further ones by keyword."""

import ast
from pathlib import Path

ENVS = Path(__file__).parents[2] / "envs"
MOST = 4
# Doors of the package, whose order of arguments is documented; and what another part of the project defines.
DOORS = {"make_env", "WorkspaceEnv", "GymEnv", "GymVectorEnv", "ObservationTerm", "Room"}


def by_position(function):
    return [each.arg for each in function.args.posonlyargs + function.args.args if each.arg not in ("self", "cls")]


def is_keyword_only(node):
    return any("kw_only" in ast.unparse(decorator) for decorator in node.decorator_list)


def fields(node):
    declared = any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)
    return [each for each in node.body if isinstance(each, ast.AnnAssign)] if declared else []


def long_signatures():
    for path in sorted(ENVS.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        inside = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                inside |= {id(each): node.name for each in node.body}
                if len(fields(node)) > MOST and not is_keyword_only(node):
                    yield path.name, node.name
            elif isinstance(node, ast.FunctionDef) and len(by_position(node)) > MOST:
                yield path.name, inside.get(id(node), node.name) if node.name == "__init__" else node.name


def test_more_than_four_arguments_are_taken_by_keyword():
    assert [(file, name) for file, name in long_signatures() if name not in DOORS] == []

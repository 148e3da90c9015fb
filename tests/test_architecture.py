"""Import directions, import cycles, light imports, and the sizes of files and functions."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {  # package -> the packages that it may import beside itself
    "conf": set(),
    "core": {"conf"},
    "language": {"core"},
    "human": {"core", "language"},
    "envs": {"core", "language", "human"},
    "trainers": {"core"},
    "hydra_plugins": {"core", "trainers"},
    "deployment": {"core", "language", "human", "envs", "trainers"},
    "demo": {"core", "language", "human", "envs", "trainers", "deployment"},
    "deixis": {"core", "language", "human", "envs", "trainers", "demo", "deployment"},
    "tools": {"core", "language", "human", "envs", "trainers", "demo", "deixis", "deployment"},  # shared by tests
}
LAYERS = {  # sub-package or module of envs -> those that it may import beside itself
    "sim": set(),
    "tasks": {"sim"},
    "perception": {"sim", "tasks"},
    "mdp": {"sim", "tasks", "perception"},
    "config": {"sim", "tasks", "mdp", "perception"},
    "episode_replay": {"sim", "tasks", "mdp"},
    "workspace_env": {"sim", "tasks", "mdp", "config", "episode_replay", "perception"},
    "registration": {"sim", "config", "workspace_env"},
    "gym_interface": {"mdp", "workspace_env"},
    "gym_env": {"gym_interface", "registration"},
    "gym_vector_env": {"gym_interface", "registration"},
    "checker": {"workspace_env"},
    "perception_training": {"sim", "tasks", "perception", "mdp", "config", "workspace_env"},
    "experts": {"sim", "tasks", "mdp", "workspace_env"},
    "interactive": {"sim", "mdp", "config", "workspace_env", "perception"},
    "perturbed_conditions": {"tasks", "mdp", "config"},
}
PYBULLET = ("envs/sim/", "human/body/")
GENERATED = {"build", "dist", "outputs", "multirun", "site"}  # folders that programs write
MAX_FILE_LINES = 600
MAX_FUNCTION_LINES = 50
MAX_FILES = 310  # outside of UNCOUNTED
UNCOUNTED = ("tests", "language", "demo", "integrations", "examples")
SMALL_MODULE = 70  # lines, up to which a module that one other module imports had better be part of it
MAX_SMALL_MODULES = 8
REGISTERED = ("envs/experts", "envs/tasks", "trainers/algorithms")  # modules that are found by name


@cache
def written():
    """Every Python file of the project, as paths relative to its root."""
    paths = sorted(path.relative_to(ROOT) for path in ROOT.rglob("*.py"))
    return [path for path in paths if path.parts[0] not in GENERATED and not path.parts[0].startswith(".")]


def sources(folder):
    return [path for path in written() if path.is_relative_to(folder)]


@cache
def tree(path):
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


@cache
def imported(path):
    """The dotted names of modules that a file imports anywhere in it; `from a import b` gives a and a.b."""
    return tuple(imports_of(path))


def imports_of(path):
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)


def top_level(path):
    return {name.split(".")[0] for name in imported(path)}


def programs():
    return {path.stem for path in ROOT.glob("*.py")} | {"benchmarks", "examples", "tests"}


@pytest.mark.slow
@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_the_packages_below_it(package):
    assert sources(package)
    barred = (set(PACKAGES) | programs()) - PACKAGES[package] - {package}
    assert {str(path): found for path in sources(package) if (found := barred & top_level(path))} == {}


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_of_envs_imports_only_the_layers_below_it(layer):
    allowed = {f"envs.{name}" for name in LAYERS[layer] | {layer}}
    if layer in ("experts", "interactive"):
        allowed |= {"envs.make_env", "envs.read_env"}  # what `envs` itself offers
    for path in sources(f"envs/{layer}") or [Path(f"envs/{layer}.py")]:
        used = {".".join(name.split(".")[:2]) for name in imported(path) if name.startswith("envs.")}
        assert used <= allowed, path


def test_every_layer_of_envs_is_listed_here():
    names = {path.parts[1].removesuffix(".py") for path in sources("envs")} - {"__init__"}
    assert names == set(LAYERS)


def test_benchmarks_and_tools_import_no_tests():
    for path in [*sources("benchmarks"), *sources("tools")]:
        assert "tests" not in top_level(path), path


def test_every_package_is_listed_here():
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"benchmarks", "tests"}
    assert packages <= set(PACKAGES)


@pytest.mark.slow
def test_pybullet_is_imported_in_the_simulation_and_the_human_body_only():
    users = {path.as_posix() for path in written() if "pybullet" in top_level(path)}
    assert {user for user in users if not user.startswith((*PYBULLET, "tests/", "benchmarks/"))} == set()


def test_no_module_imports_itself_through_others():
    modules = {}
    for path in written():
        parts = path.with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph = {}
    for name, path in modules.items():
        found = {each for each in imported(path) if each in modules}
        # `from package import module` needs the module; the package's own __init__ is loaded first, by Python.
        found -= {name} | {".".join(name.split(".")[:i]) for i in range(1, name.count(".") + 1)}
        graph[name] = found
    assert cycle_in(graph) == []


def cycle_in(graph):
    """A cycle as a list of names, or []."""
    done = set()

    def visit(name, trail):
        if name in trail:
            return [*trail[trail.index(name) :], name]
        if name in done:
            return []
        done.add(name)
        return next((found for each in sorted(graph[name]) if (found := visit(each, [*trail, name]))), [])

    return next((found for name in sorted(graph) if (found := visit(name, []))), [])


def test_the_search_for_cycles_finds_one():
    assert cycle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert cycle_in({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("language", {"torch", "tensordict", "torchrl", "pybullet", "hydra", "matplotlib", "lark", "envs"}),
        ("core.schema", {"torch", "pybullet", "hydra", "omegaconf", "numpy"}),
        ("core.errors", {"torch", "pybullet", "hydra", "omegaconf", "numpy"}),
        ("core.platform_tuning", {"torch", "pybullet", "hydra", "omegaconf", "numpy"}),
        ("core.overrides", {"torch", "pybullet", "hydra"}),
    ],
)
def test_a_light_module_loads_no_heavy_library(module, heavy):
    code = f"import sys, {module}; print(*set({sorted(heavy)}) & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.split() == []


def test_the_evaluation_of_a_policy_does_not_load_the_dialogue():
    code = "import sys, envs.workspace_env, evaluate, trainers.evaluation.evaluation; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not {"language.dialogue", "language.talk", "language.settling"} & set(found.stdout.split())


def test_no_file_is_too_long():
    lengths = {path.as_posix(): len((ROOT / path).read_text("utf-8").splitlines()) for path in written()}
    assert {name: lines for name, lines in lengths.items() if lines > MAX_FILE_LINES} == {}


def test_there_are_few_files():
    files = [path for path in written() if path.parts[0] not in UNCOUNTED]
    assert len(files) <= MAX_FILES


def test_few_small_modules_serve_one_other_alone():
    importers = {}
    for path in written():
        if path.parts[0] != "tests":
            for name in set(imported(path)):
                importers.setdefault(name, set()).add(path)
    alone = []
    for path in written():
        kept = path.parts[0] in UNCOUNTED or path.as_posix().startswith(REGISTERED) or len(path.parts) == 1
        if not kept and path.stem not in ("__init__", "__main__"):
            lines = len((ROOT / path).read_text("utf-8").splitlines())
            users = importers.get(".".join(path.with_suffix("").parts), set()) - {path}
            alone += [path.as_posix()] * (lines <= SMALL_MODULE and len(users) == 1)
    assert len(alone) <= MAX_SMALL_MODULES, alone


def test_a_public_class_name_occurs_once():
    places = {}
    for path in written():
        if path.parts[0] != "tests":
            for node in tree(path).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    places.setdefault(node.name, []).append(path.as_posix())
    assert {name: paths for name, paths in places.items() if len(paths) > 1} == {}


def test_no_function_is_too_long():
    lengths = {
        f"{path}:{node.lineno} {node.name}": node.end_lineno - node.lineno + 1
        for path in written()
        for node in ast.walk(tree(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert {name: lines for name, lines in lengths.items() if lines > MAX_FUNCTION_LINES} == {}


def test_tests_import_no_benchmarks_and_no_other_tests():
    for path in sources("tests"):
        names = set(imported(path))
        assert not {name for name in names if name.split(".")[0] == "benchmarks"}, path
        assert not {name for name in names if name.split(".")[-1].startswith("test_")}, path


def test_helpers_of_tests_are_imported_by_one_name_only():
    helpers = {path.stem for path in sources("tests/helpers")}
    for path in sources("tests"):
        assert not helpers & {name.split(".")[0] for name in imported(path)}, path


def test_test_files_have_distinct_names_and_no_packages():
    names = [path.name for path in sources("tests") if path.name != "conftest.py"]
    assert len(names) == len(set(names))
    assert "__init__.py" not in names

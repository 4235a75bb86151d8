"""Imports point down one list of layers, and each unit knows only what it is meant to know."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.rooms import LOOSE, ROOMS, ROOT, path_of, purpose

PACKAGE = "ibe_rl"
SCRIPTS = ("train", "explain")
DEEPEST = 11

FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in [*(ROOT / PACKAGE).rglob("*.py"), *(ROOT / f"{name}.py" for name in SCRIPTS)]
}


@cache
def imported(module: str) -> frozenset[str]:
    """Full names of all that a module imports, wherever in it."""
    return frozenset(imports_of(module))


def imports_of(module: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(FILES[module].read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: imports are absolute"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in FILES else str(node.module)


def inner(module: str) -> set[str]:
    return {name for name in imported(module) if name in FILES}


def outer(module: str) -> set[str]:
    return {name.split(".")[0] for name in imported(module)} - {PACKAGE}


def unit(module: str) -> str:
    return [*module.split("."), ""][1] if module.startswith(PACKAGE) else f"{module}.py"


LINE = {room: number for number, room in enumerate((*ROOMS, "viewer", "__main__", *(f"{name}.py" for name in SCRIPTS)))}


@cache
def edges_of_units() -> list[tuple[str, str]]:
    return sorted({(unit(module), unit(name)) for module in FILES for name in inner(module)})


def circles(edges: set[tuple[str, str]]) -> set[str]:
    """Take away what imports nothing that is left; what stays lies on or above a circle."""
    left = {name for edge in edges for name in edge}
    while free := {name for name in left if not any(a == name and b in left for a, b in edges)}:
        left -= free
    return left


def below(*modules: str) -> set[str]:
    """All modules of the package that importing these brings in, the packages around them too."""
    found, waiting = set(), [*modules]
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            parts = module.split(".")
            waiting += inner(module) | {".".join(parts[:n]) for n in range(1, len(parts))}
    return found


def test_every_unit_has_its_line():
    assert {unit(module) for module in FILES} - {""} == set(LINE)


def test_loose_modules_are_few():
    assert {path.stem for path in (ROOT / PACKAGE).glob("*.py")} - {"__init__", "__main__"} == set(LOOSE)


def test_imports_point_down():
    wrong = [
        (user, used) for user, used in edges_of_units() if user and used and user != used and LINE[used] >= LINE[user]
    ]
    assert wrong == []


@cache
def depth(module: str) -> int:
    return 1 + max((depth(name) for name in inner(module) if name != module), default=0)


def test_the_import_graph_is_shallow():
    assert max(map(depth, FILES)) <= DEEPEST


@pytest.mark.parametrize("room", ROOMS)
def test_each_room_says_what_it_is_for(room: str):
    text = ast.get_docstring(ast.parse(path_of(room).read_text())) or ""
    assert purpose(room)
    if room not in LOOSE:
        assert all(f"{word}:" in text for word in ("In", "Out", "Imports"))


def test_the_package_itself_imports_only_what_needs_no_torch():
    assert {used for user, used in edges_of_units() if user == ""} == {"types", "envs", "task"}
    assert {user for user, used in edges_of_units() if used == ""} == {"__main__"}


def test_there_is_no_circle():
    assert circles({(module, name) for module in FILES for name in inner(module)}) == set()
    assert circles({(user, used) for user, used in edges_of_units() if user != used}) == set()


def test_the_search_for_circles_finds_them():
    assert circles({("a", "b"), ("b", "c")}) == set()
    assert circles({("a", "b"), ("b", "c"), ("c", "b")}) == {"a", "b", "c"}


@pytest.mark.parametrize("module", ["ibe_rl", "ibe_rl.envs", "ibe_rl.ibe", "ibe_rl.types", "ibe_rl.storage.log"])
def test_what_works_on_plain_arrays_knows_no_torch(module: str):
    assert set().union(*(outer(name) for name in below(module))) & {"torch", "torchrl", "tensordict"} == set()


def users(*packages: str) -> set[str]:
    return {unit(module) for module in FILES if outer(module) & set(packages)}


def test_only_the_view_knows_rerun():
    assert users("rerun", "rerun_sdk") == {"view"}


def test_only_the_settings_know_hydra():
    assert users("hydra", "omegaconf") == {"config"}


def test_agents_know_no_environment_and_predictors_no_agent():
    for name in ("agents", "predict", "explain", "ibe", "metrics"):
        known = {unit(module) for module in below(*(m for m in FILES if unit(m) == name)) if module != PACKAGE}
        direct = {used for user, used in edges_of_units() if user == name}
        assert name == "predict" or "envs" not in direct  # it rolls out copies of environments
        assert "collect" not in direct
        assert name == "agents" or "agents" not in known


def code(path: Path) -> str:
    """The text of a file without its docstrings."""
    lines = path.read_text().splitlines()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            first = node.body[0]
            lines[first.lineno - 1 : first.end_lineno] = [""] * (first.end_lineno - first.lineno + 1)
    return "\n".join(lines)


GAMES = re.compile(
    r"lander|lunar|rocket|landing|landed|\bland\b|(?<!np\.)\bpads?\b|cart.?pole|reacher|fetch.?reach|acrobot|bipedal",
    re.IGNORECASE,
)


def test_only_env_knows_the_games():
    elsewhere = {
        module: path.read_text() for module, path in FILES.items() if unit(module) != "envs" and module not in SCRIPTS
    }
    scripts = {name: code(FILES[name]) for name in SCRIPTS}
    pages = {
        ".".join(path.relative_to(ROOT).parts): path.read_text()
        for path in (ROOT / PACKAGE).rglob("*.*")
        if path.suffix in WRITTEN
    }
    found = {name: games_in(name, text) for name, text in (elsewhere | scripts | pages).items()}
    assert {name: words for name, words in found.items() if words} == {}


def games_in(name: str, text: str) -> list[str]:
    """The words of games in a text, but for those of the paper: it has one game, and calls its task landing."""
    allowed = next((words for start, words in OF_THE_PAPER.items() if name.startswith(start)), set())
    return [word for word in GAMES.findall(text) if word.lower() not in allowed]


OF_THE_PAPER = {"ibe_rl.apps.study.": {"landing"}, "ibe_rl.apps.paper.report.html": {"rocket", "land"}}
WRITTEN = (".html", ".js", ".css", ".jinja")


def test_files_are_short():
    long = {module: len(path.read_text().splitlines()) for module, path in FILES.items() if module not in SCRIPTS}
    assert {module: lines for module, lines in long.items() if lines > 300} == {}


def test_no_module_is_a_drawer_for_everything():
    parts = {part for module in FILES for part in module.split(".")}
    for word in ("util", "utils", "helper", "helpers", "manager", "common", "misc", "base"):
        assert word not in parts


def public_names(module: str) -> Iterator[str]:
    """What a module defines at its top level without an underscore."""
    for node in ast.parse(FILES[module].read_text()).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names = [node.name]
        elif isinstance(node, ast.Assign):
            names = [each.id for target in node.targets for each in ast.walk(target) if isinstance(each, ast.Name)]
        else:
            names = [node.target.id] if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) else []
        yield from (name for name in names if not name.startswith("_"))


def test_one_name_is_defined_in_one_place():
    inside = [module for module in FILES if module not in SCRIPTS]
    where = {name: module for module in inside for name in public_names(module)}
    twice = {(name, module) for module in inside for name in public_names(module) if where[name] != module}
    assert twice == set()

"""Imports point down one list of layers, and each unit knows only what it is meant to know."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = "ibe_rl"
SCRIPTS = ("train", "explain")

LAYERS = (
    {
        *("data", "task", "scene", "colours", "limits", "ports", "run_folder", "signals", "named_code"),
        *("config", "task_config", "predictor_config", "config_store"),
        *("arguments", "command_line", "checkpoint", "resume", "under_way", "arrays", "ending", "workers"),
    },
    {"env", "log", "ibe", "ray_workers", "ray_run"},
    {"instruct", "agent", "guest", "predict", "metrics"},
    {
        *("collect", "explainer", "play", "lessons", "fitting", "reactions", "rule_reads", "probe"),
        *("refresh", "development"),
        *("obedience", "classroom"),
    },
    {"progress", "stream", "serve", "viewer", "evaluation", "paper", "sweep", "telling"},
    {"parts", "own_agent", "minari_log", "guest_folder"},
    set(SCRIPTS),
)
SIDEWAYS = {
    ("ray_run", "ray_workers"),
    *(
        ("refresh", "lessons"),
        ("development", "lessons"),
        ("fitting", "lessons"),
        ("reactions", "play"),
        ("probe", "lessons"),
    ),
    *(("refresh", "fitting"), ("development", "fitting"), ("development", "probe")),
    *(
        ("development", "refresh"),
        ("development", "explainer"),
        ("obedience", "development"),
        ("classroom", "explainer"),
        ("progress", "stream"),
    ),
    *(("telling", "evaluation"), ("telling", "stream"), ("minari_log", "guest_folder"), ("own_agent", "guest_folder")),
    *(("viewer", "serve"), ("viewer", "stream"), ("paper", "evaluation")),
    *(("sweep", "viewer"), ("sweep", "serve"), ("sweep", "evaluation"), ("sweep", "paper")),
}
"""Imports on one line that are meant; on the lowest line all are, as long as there is no circle."""

FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in [*(ROOT / PACKAGE).rglob("*.py"), *(ROOT / f"{name}.py" for name in SCRIPTS)]
}


def imported(module: str) -> Iterator[str]:
    """Full names of all that a module imports, wherever in it."""
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
    return [*module.split("."), ""][1] if module.startswith(PACKAGE) else module


UNITS = {unit(module) for module in FILES} - {""}
LINE = {name: number for number, names in enumerate(LAYERS) for name in names}
EDGES = sorted({(unit(module), unit(name)) for module in FILES for name in inner(module)})


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
    assert {name for names in LAYERS for name in names} == UNITS


def test_imports_point_down():
    wrong = [
        (user, used)
        for user, used in EDGES
        if user and used and user != used and LINE[used] >= LINE[user] > 0 and (user, used) not in SIDEWAYS
    ]
    assert wrong == []
    assert [(user, used) for user, used in EDGES if user in LAYERS[0] and used not in LAYERS[0]] == []


def test_meant_exceptions_are_needed():
    assert set(EDGES) >= SIDEWAYS


def test_the_package_itself_imports_only_what_needs_no_torch():
    assert {used for user, used in EDGES if user == ""} == {"data", "env", "ibe", "task"}
    assert {user for user, used in EDGES if used == ""} == set()


def test_there_is_no_circle():
    assert circles({(module, name) for module in FILES for name in inner(module)}) == set()
    assert circles({(user, used) for user, used in EDGES if user != used}) == set()


def test_the_search_for_circles_finds_them():
    assert circles({("a", "b"), ("b", "c")}) == set()
    assert circles({("a", "b"), ("b", "c"), ("c", "b")}) == {"a", "b", "c"}


@pytest.mark.parametrize("module", ["ibe_rl", "ibe_rl.env", "ibe_rl.ibe", "ibe_rl.data", "ibe_rl.log"])
def test_what_works_on_plain_arrays_knows_no_torch(module: str):
    assert set().union(*(outer(name) for name in below(module))) & {"torch", "torchrl", "tensordict"} == set()


def users(*packages: str) -> set[str]:
    return {unit(module) for module in FILES if outer(module) & set(packages)}


def test_only_the_view_knows_rerun():
    assert users("rerun", "rerun_sdk") == {"stream", "serve"}


def test_only_the_settings_know_hydra():
    assert users("hydra", "omegaconf") <= {
        "arguments",
        "config",
        "task_config",
        "config_store",
        "command_line",
        *SCRIPTS,
    }


def test_agents_know_no_environment_and_predictors_no_agent():
    for name in ("agent", "predict", "explainer", "ibe", "metrics"):
        known = {unit(module) for module in below(*(m for m in FILES if unit(m) == name)) if module != PACKAGE}
        direct = {used for user, used in EDGES if user == name}
        assert not direct & {"env", "collect"}
        assert name == "agent" or "agent" not in known


def code(path: Path) -> str:
    """The text of a file without its docstrings."""
    lines = path.read_text().splitlines()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            first = node.body[0]
            lines[first.lineno - 1 : first.end_lineno] = [""] * (first.end_lineno - first.lineno + 1)
    return "\n".join(lines)


GAMES = re.compile(r"lander|lunar|rocket|landing|landed|\bland\b|(?<!np\.)\bpads?\b|cart.?pole|reacher", re.IGNORECASE)


def test_only_env_knows_the_games():
    elsewhere = {module: path.read_text() for module, path in FILES.items() if unit(module) not in ("env", *SCRIPTS)}
    scripts = {name: code(FILES[name]) for name in SCRIPTS}
    pages = {path.name: path.read_text() for path in (ROOT / PACKAGE).rglob("*.*") if path.suffix in WRITTEN}
    found = {name: GAMES.findall(text) for name, text in (elsewhere | scripts | pages).items()}
    assert {name: words for name, words in found.items() if words} == {}


WRITTEN = (".html", ".js", ".css", ".jinja")


def test_files_are_short():
    long = {module: len(path.read_text().splitlines()) for module, path in FILES.items() if module not in SCRIPTS}
    assert {module: lines for module, lines in long.items() if lines > 300} == {}


def test_no_module_is_a_drawer_for_everything():
    parts = {part for module in FILES for part in module.split(".")}
    for word in ("util", "utils", "helper", "helpers", "manager", "common", "misc", "base"):
        assert word not in parts

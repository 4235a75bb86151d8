"""The package as a stranger has it: built, installed in a clean environment, used in a folder of one's own."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest
from processes import SMALL

from ibe_rl import __version__

ROOT = Path(__file__).parent.parent
SOURCES = ("ibe_rl", "configs", "demo", "train.py", "explain.py", "README.md", "LICENSE", "CHANGELOG.md")
SOURCES += ("constraints.txt", "pyproject.toml", "hatch_build.py", ".gitignore")
BUILD = "import sys, hatchling.build; print(getattr(hatchling.build, sys.argv[1])(sys.argv[2]))"
MINE = "# Mine.\nkind: mine\nn_clusters: 3\n"

pytestmark = pytest.mark.slow


def build(what: str, source: Path, to: Path) -> Path:
    """Build with the backend that pyproject.toml names."""
    command = [sys.executable, "-c", BUILD, f"build_{what}", str(to)]
    built = subprocess.run(command, cwd=source, capture_output=True, text=True, check=True)
    return to / built.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from the unpacked source distribution, which is built from a copy of the checkout."""
    source, unpacked, dist = (tmp_path_factory.mktemp(name) for name in ("source", "unpacked", "dist"))
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, source / name)
    shutil.unpack_archive(build("sdist", source, dist), unpacked)
    return build("wheel", unpacked / f"ibe_rl-{__version__}", dist)


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the programs of an environment that has the wheel, and what it needs from this environment."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "--disable-pip-version-check", "install"]
    subprocess.run([*pip, "--quiet", "--no-deps", "--no-index", wheel], env=outside(), check=True)
    theirs = next(folder.glob("lib/python*/site-packages"))
    (theirs / "what_it_needs.pth").write_text(sysconfig.get_paths()["purelib"])  # whose own .pth files do not count
    return folder / "bin"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A person's folder."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "configs" / "mapping").mkdir(parents=True)
    (folder / "configs" / "mapping" / "mine.yaml").write_text(MINE)
    return folder


def outside() -> dict[str, str]:
    """The environment variables without what leads to this checkout."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def said_by(programs: Path, place: Path, command: str) -> str:
    """What a command prints that is typed there."""
    variables = outside() | {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    ended = subprocess.run(command, shell=True, cwd=place, env=variables, capture_output=True, text=True, timeout=250)  # noqa: S602 - as a person types it
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def test_nothing_is_installed_outside_the_package_s_own_name(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {Path(name) for name in archive.namelist()}
    assert {name.parts[0] for name in names} == {"ibe_rl", f"ibe_rl-{__version__}.dist-info"}
    beside = [path for path in (ROOT / "ibe_rl").rglob("*.*") if path.is_file() and "__pycache__" not in path.parts]
    assert {path.relative_to(ROOT) for path in beside} <= names
    moved = [path for name in ("configs", "demo") for path in (ROOT / name).rglob("*") if path.is_file()]
    moved += [ROOT / "train.py", ROOT / "explain.py"]
    assert {Path("ibe_rl/shipped", path.relative_to(ROOT)) for path in moved} <= names


def test_help_comes_without_torch(programs: Path, place: Path) -> None:
    said = said_by(programs, place, "ibe-rl --help")
    assert "usage: ibe-rl COMMAND" in said
    assert said_by(programs, place, "ibe-rl --version") == f"ibe-rl {__version__}\n"
    loaded = said_by(programs, place, "python -X importtime -m ibe_rl train --help 2>&1")
    assert "n_clusters" in loaded
    assert not re.search(r"\| +(torch|sklearn|hydra)\b", loaded)


def test_the_demo_that_comes_along_explains_itself(programs: Path, place: Path) -> None:
    said = said_by(programs, place, "ibe-rl demo viewer=off predictor.processes=1")
    assert "went as predicted" in said
    assert (place / "runs" / "demo" / "checkpoints").is_dir()


def test_a_training_with_a_vocabulary_of_one_s_own_and_what_it_says_to_type(programs: Path, place: Path) -> None:
    small = " ".join([*SMALL, "total_frames=3000", "refresh_every_frames=1500", "viewer=file"])
    said = said_by(programs, place, f"ibe-rl train mapping=mine {small}")
    folder = next((place / "runs").glob("2*"))
    assert "n_clusters: 3" in (folder / ".hydra" / "config.yaml").read_text()
    assert re.search(rf"look at it again:     (cd \S+ && )?ibe-rl view /\S+/runs/{folder.name}\n", said)
    told = re.search(r"one episode in words: (.*ibe-rl explain .+)", said)
    assert told
    elsewhere = f"{told[1]} viewer=off predictor.processes=1"
    assert "vocabulary of frame" in said_by(programs, place.parent, elsewhere)


def test_from_python_it_finds_the_settings(programs: Path, place: Path) -> None:
    code = "from ibe_rl.config.command_line import composed; print(composed('explain', []).predictor.kind)"
    assert said_by(programs, place, f'python -c "{code}"') == "simulator\n"

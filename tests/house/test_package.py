"""The package: what a wheel holds, how the command line behaves at its edges."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("geo", "coverage", "mission", "physics", "exporters")


def quarterdeck(*arguments, cwd=ROOT, **options):
    """Run the command line in a process of its own."""
    command = [sys.executable, "-m", "quarterdeck", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, **options)


def test_wheel_holds_every_room(tmp_path):
    """A wheel has each module of each room as a regular file, the samples, the schemas, the type marker, nothing else."""
    pytest.importorskip("build", reason="the package `build` is not installed")
    shutil.copytree(
        ROOT,
        tmp_path / "clone",
        symlinks=True,
        ignore=shutil.ignore_patterns(".*", "__pycache__", "build", "out", "*.egg-info"),
    )
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(tmp_path / "clone")]
    subprocess.run(command, check=True, capture_output=True)
    names = {n for n in zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist() if ".dist-info/" not in n}
    expected = {f"quarterdeck/{p.relative_to(ROOT)}" for r in (*ROOMS, "data") for p in (ROOT / r).rglob("*.*")}
    expected |= {str(p.relative_to(ROOT)) for p in (ROOT / "quarterdeck").rglob("*.*")}  # the links to the rooms aside
    assert names == {n for n in expected if "__pycache__" not in n}


def test_mypy_sees_every_module():
    """Mypy's packages setting reaches all rooms: the number of files checked is the number of files there are."""
    pytest.importorskip("mypy", reason="mypy is not installed")
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, check=False)
    rooms = [ROOT / room for room in (*ROOMS, "data", "quarterdeck")]
    files = [p for room in rooms for p in room.rglob("*.py")]
    folders = {p.parent for room in rooms for p in room.rglob("*.*")} - {p.parent for p in files if p.name == "__init__.py"}
    folders = {p for p in folders if p.name != "__pycache__"}  # mypy counts those without __init__.py too
    checked = re.search(r"(\d+) source files", done.stdout)
    assert checked
    assert int(checked[1]) == len(files) + len(folders)


@pytest.mark.parametrize(
    "code", ["import quarterdeck", "import numba, quarterdeck.geo.transit", "import coverage; coverage.Coverage"]
)
def test_root_as_working_directory(code):
    """Running Python in a clone, its root on sys.path, breaks nothing: `coverage` is still coverage.py."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONSAFEPATH"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr


def test_help_imports_nothing_heavy():
    """`--help` does not import the libraries that take long."""
    code = "import sys\nfrom quarterdeck.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
    code += "heavy = {'numpy', 'numba', 'shapely', 'scipy', 'pybullet'} & set(sys.modules)\nassert not heavy, heavy"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "plan" in done.stdout


def test_nearest_verb_is_suggested():
    """A mistyped verb or option exits with 2 and suggests the nearest."""
    done = quarterdeck("plam")
    assert done.returncode == 2
    assert "did you mean 'plan'" in done.stderr


def test_input_error_is_one_line_and_writes_nothing(tmp_path):
    """Wrong input: one line on standard error, status 2, no file."""
    (tmp_path / "bad.geojson").write_text("hello")
    done = quarterdeck("plan", str(tmp_path / "bad.geojson"), "-o", str(tmp_path / "plan.geojson"))
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "plan.geojson").exists()

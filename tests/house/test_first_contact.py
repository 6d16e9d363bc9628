"""First contact: what somebody meets who has just installed it."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest

from quarterdeck.cli import VERBS, main
from quarterdeck.geo.properties import GEOMETRIES


def run(capsys, *arguments):
    """Return exit status, standard output and standard error of the command line."""
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    told = capsys.readouterr()
    return stop.value.code or 0, told.out, told.err


def completed(*words):
    """Return the words that the shell is offered for the last one."""
    return [word for _, word in offered(*words)]


def offered(*words):
    """Return the kind and the text of what the shell is offered for the last word."""
    environment = os.environ | {
        "_QUARTERDECK_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(["quarterdeck", *words]),
        "COMP_CWORD": str(len(words)),
    }
    done = subprocess.run(
        [sys.executable, "-m", "quarterdeck"], env=environment, capture_output=True, text=True, check=True
    )
    return [tuple(line.split(",", 1)) for line in done.stdout.splitlines()]


def test_the_first_site_says_what_it_is_for_and_works(tmp_path, capsys):
    """`init` writes a small site whose features all have a description; it is checked and planned, and its run passes."""
    site, plan = tmp_path / "site.geojson", tmp_path / "plan.geojson"
    assert run(capsys, "init", "-o", str(site))[0] == 0
    assert site.stat().st_size < 4000
    features = json.loads(site.read_text())["features"]
    assert all(len(f["properties"]["description"]) > 40 for f in features)
    assert {f["properties"]["role"] for f in features} == {"area", "operating", "obstacle", "vehicle"} <= set(GEOMETRIES)
    assert run(capsys, "check", str(site))[0] == 0
    assert run(capsys, "plan", str(site), "-o", str(plan))[0] == 0
    pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    assert run(capsys, "simulate", str(plan))[0] == 0


def test_version_tells_what_results_depend_on(capsys):
    """Each library by name, with the native ones inside."""
    status, out, _ = run(capsys, "--version")
    assert status == 0
    assert out.startswith("quarterdeck, version ")
    for name in ("python 3", "numpy ", "numba ", "shapely ", "(GEOS ", "pyproj ", "(PROJ ", "pybullet "):
        assert name in out


@pytest.mark.parametrize(
    ("arguments", "nearest"),
    [
        (["plam"], "'plan'"),
        (["plan", "--spacng", "3"], "--spacing"),
        (["plan", "--method", "lins"], "'lines'"),
        (["init", "harbor"], "'harbour'"),
        (["simulate", "-", "--gnss", "rtx"], "'rtk'"),
    ],
)
def test_the_nearest_is_suggested(capsys, arguments, nearest):
    """A mistyped verb, option or word is answered with the nearest, and exit status 2."""
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    told = re.search(r"(id you mean|Possible options:)(.*)", err.splitlines()[-1])  # so older clicks
    assert told
    assert nearest in told[2]


def test_the_shell_completes_verbs_options_and_words():
    """`quarterdeck re<TAB>` and on; no verb is imported for its name."""
    assert completed("re") == sorted(v for v in VERBS if v.startswith("re"))
    assert "--time-limit" in completed("plan", "--ti")
    assert completed("plan", "--method", "g") == ["guards"]
    assert completed("export", "plan.geojson", "--to", "png,qgc-") == ["png,qgc-plan", "png,qgc-wpl"]


@pytest.mark.parametrize("words", [("plan", "si"), ("simulate", "x", "--report", ""), ("report", "x", "--track", "log")])
def test_the_shell_completes_files(words):
    """Where a file is wanted the shell completes its name."""
    assert [kind for kind, _ in offered(*words)] == ["file"]


def test_bash_completes(tmp_path):
    """The line of the README, in a real bash."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("there is no bash")
    program = tmp_path / "quarterdeck"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m quarterdeck "$@"\n')
    program.chmod(0o755)
    script = """eval "$(_QUARTERDECK_COMPLETE=bash_source quarterdeck)"
        COMP_WORDS=(quarterdeck rep) COMP_CWORD=1; _quarterdeck_completion quarterdeck; echo "${COMPREPLY[@]}" """
    environment = os.environ | {"PATH": os.pathsep.join([str(tmp_path), os.environ["PATH"]])}
    done = subprocess.run([bash, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["replan", "replay", "report", "reproduce"]


def test_a_name_that_steers_the_terminal_is_told_without_it(tmp_path, capsys):
    """An escape sequence in a site's text does not reach the terminal."""
    path = tmp_path / "site.geojson"
    feature = {"type": "Feature", "properties": {"role": "\x1b[2Jarea"}, "geometry": None}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    status, out, err = run(capsys, "check", str(path))
    assert status == 2
    assert "\x1b" not in out + err

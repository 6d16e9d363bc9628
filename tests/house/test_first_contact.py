"""First contact: what somebody meets who has just installed it."""

import json
import os
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
    """Return what the shell is offered for the last word."""
    environment = os.environ | {
        "_QUARTERDECK_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(["quarterdeck", *words]),
        "COMP_CWORD": str(len(words)),
    }
    done = subprocess.run(
        [sys.executable, "-m", "quarterdeck"], env=environment, capture_output=True, text=True, check=True
    )
    return [line.partition(",")[2] for line in done.stdout.splitlines()]


def test_the_first_site_says_what_it_is_for_and_can_be_planned(tmp_path, capsys):
    """`init` writes a small site whose features all have a description; it is checked and planned as it is."""
    site, plan = tmp_path / "site.geojson", tmp_path / "plan.geojson"
    assert run(capsys, "init", "-o", str(site))[0] == 0
    assert site.stat().st_size < 4000
    features = json.loads(site.read_text())["features"]
    assert all(len(f["properties"]["description"]) > 40 for f in features)
    assert {f["properties"]["role"] for f in features} == {"area", "operating", "obstacle", "vehicle"} <= set(GEOMETRIES)
    assert run(capsys, "check", str(site))[0] == 0
    assert run(capsys, "plan", str(site), "--placement", "none", "-o", str(plan))[0] == 0


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
    assert nearest in err.splitlines()[-1].partition("id you mean")[2]


def test_the_shell_completes_verbs_options_and_words():
    """`quarterdeck re<TAB>` and on; no verb is imported for its name."""
    assert completed("re") == sorted(v for v in VERBS if v.startswith("re"))
    assert "--time-limit" in completed("plan", "--ti")
    assert completed("plan", "--method", "g") == ["guards"]


def test_a_name_that_steers_the_terminal_is_told_without_it(tmp_path, capsys):
    """An escape sequence in a site's text does not reach the terminal."""
    path = tmp_path / "site.geojson"
    feature = {"type": "Feature", "properties": {"role": "\x1b[2Jarea"}, "geometry": None}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    status, out, err = run(capsys, "check", str(path))
    assert status == 2
    assert "\x1b" not in out + err

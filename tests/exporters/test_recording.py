"""The recording, as rerun's own tools read it."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from shapely import LineString, MultiPolygon, box

from quarterdeck.exporters.recording import recording
from quarterdeck.geo.scenario import Casualty
from quarterdeck.mission.mission import Layer
from quarterdeck.physics.moments import Moment

RERUN = Path(sys.executable).with_name("rerun")


@pytest.mark.skipif(not RERUN.exists(), reason="rerun's command is not installed")
def test_rerun_verifies_it_and_finds_the_same_twice(boats, tmp_path):
    """`rerun rrd verify` accepts it, and `compare` finds two recordings of one mission alike."""
    paths = [tmp_path / f"{i}.rrd" for i in (1, 2)]
    for path in paths:
        path.write_bytes(recording(boats, moments=(Moment(30.0, boats.vehicles[0].id, "lost", 1.0, 2.0),)))
    for command in (["verify", paths[0]], ["compare", "--unordered", *paths]):
        done = subprocess.run([RERUN, "rrd", *command], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not RERUN.exists(), reason="rerun's command is not installed")
def test_it_has_what_the_picture_has(boats, tmp_path):
    """Tasks, casualties, layers and who was lost are in it, in both views; what is not there is not."""
    area = box(0.0, 0.0, 9.0, 9.0)
    mission = replace(
        boats,
        casualties=(Casualty("c1", (5.0, 5.0), "red"),),
        layers=(Layer("region", (area, MultiPolygon([area])), ({"vehicle": boats.vehicles[0].id}, {})),),
        left_out=(LineString([(0, 0), (9, 9)]),),
    )
    moments = (Moment(30.0, boats.vehicles[0].id, "lost", 1.0, 2.0),)
    plain, rich = entities(recording(boats), tmp_path), entities(recording(mission, moments=moments), tmp_path)
    more = {"casualties", "layers/region", r"layers/left\ out", f"lost/{boats.vehicles[0].id}/0"}
    assert {f"{view}/{name}" for view in ("metres", "map") for name in more} | {"happened"} == rich - plain
    assert {"metres/site/areas", "map/site/areas", f"metres/vehicles/{boats.vehicles[0].id}"} <= plain


def entities(data, folder):
    """Return the entities of a recording, as rerun prints them."""
    path = folder / "some.rrd"
    path.write_bytes(data)
    done = subprocess.run([RERUN, "rrd", "print", path], capture_output=True, text=True, check=True)
    return set(re.findall(r" - /((?:metres|map|happened)\S*(?:\\ \S+)*) - data columns", done.stdout))

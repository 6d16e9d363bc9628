"""The recording, as rerun's own tools read it."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from shapely import LineString, MultiPolygon, box

from quarterdeck.exporters.recording import recording
from quarterdeck.geo.palette import CASUALTY, SITE
from quarterdeck.geo.scenario import Casualty
from quarterdeck.mission.layers import fleet_colours
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


def test_it_has_what_the_picture_has_in_the_same_colours(boats, tmp_path):
    """Tasks, casualties, layers and who was lost are in it, in both views; what is not there is not."""
    area, first = box(0.0, 0.0, 9.0, 9.0), boats.vehicles[0].id
    mission = replace(
        boats,
        casualties=(Casualty("c1", (5.0, 5.0), "red"),),
        layers=(Layer("region", (area, MultiPolygon([area])), ({"vehicle": first}, {})),),
        left_out=(LineString([(0, 0), (9, 9)]),),
    )
    moments = (Moment(30.0, first, "lost", 1.0, 2.0),)
    plain, rich = colours_in(recording(boats), tmp_path), colours_in(recording(mission, moments=moments), tmp_path)
    more = {"casualties", "layers/region", r"layers/left\ out", f"lost/{first}/0"}
    assert {f"/{view}/{name}" for view in ("metres", "map") for name in more} | {"/happened"} == rich.keys() - plain.keys()
    assert plain["/map/site/areas"] == {SITE["area"]}
    for vehicle, colour in fleet_colours(boats).items():
        assert plain[f"/metres/vehicles/{vehicle}"] == plain[f"/map/plan/{vehicle}"] == {colour}
    assert rich[f"/map/lost/{first}/0"] == {fleet_colours(mission)[first]}
    assert rich["/map/casualties"] == {CASUALTY["red"]}


def colours_in(data, folder):
    """Return the entities of a recording with their colours, as rerun reads them."""
    reader = pytest.importorskip("rerun.chunk", reason="this rerun-sdk is too old to read recordings").RrdReader
    path = folder / "some.rrd"
    path.write_bytes(data)
    found = {}
    for chunk in reader(path).stream():
        batch = chunk.to_record_batch()
        own = found.setdefault(str(chunk.entity_path), set())
        for name in (n for n in batch.schema.names if n.endswith(":colors")):
            own |= {f"#{rgba >> 8:06x}" for rgba in batch.column(name).to_pylist()[0]}
    return found

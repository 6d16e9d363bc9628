"""What responders get: GeoJSON, CSV and Cursor on Target say the same as the mission."""

import csv
import io
import json
import math
from datetime import datetime, timedelta

import numpy as np
import pytest
from lxml import etree

from quarterdeck.exporters.casualties import casualties_csv, casualties_geojson, cursor_on_target, log_csv
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.outcome import Outcome, run_triage
from quarterdeck.mission.triage.settings import Settings
from quarterdeck.mission.world import Fault


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    """A mission in which robots sort and measure badly, and one UGV is lost."""
    settings = Settings(confidence=0.6, position_error=0.8)
    return run_triage(generate(paper_team(), 3), "relay", settings, seed=5, faults=[Fault("ugv3", 120.0)])


def test_geojson_has_each_found_casualty_with_who_and_when(outcome: Outcome) -> None:
    """Every casualty found is a Point within a millimetre of where it is known to be; the others are not given away."""
    document = json.loads(casualties_geojson(outcome))
    head, *features = document["features"]
    assert head["geometry"] is None
    assert head["properties"]["figures"]["treated"] == sum(f.treated is not None for f in outcome.fates)
    found = {f.id: f for f in outcome.fates if f.found is not None}
    assert {f["id"] for f in features} == set(found)
    for feature in features:
        fate, given = found[feature["id"]], feature["properties"]
        x, y = outcome.scenario.frame.to_metres(np.array(feature["geometry"]["coordinates"]))[0]
        where = (fate.x, fate.y) if fate.reached is not None else outcome.told[fate.id]
        assert (x, y) == pytest.approx(where, abs=1e-3)
        assert given["colour"] == (fate.category or fate.sort)
        assert given["found_by"] == fate.found_by
        assert given["treated"] == (None if fate.treated is None else pytest.approx(fate.treated, abs=1e-3))
        assert given["uncertainty"] == (0.0 if fate.reached is not None else 0.8)


def test_geojson_tells_all_that_the_mission_came_of(outcome: Outcome) -> None:
    """Run again with the header's settings, seed and faults, the site gives the same casualties."""
    text = casualties_geojson(outcome)
    head = json.loads(text)["features"][0]["properties"]
    assert head["version"] == VERSION
    assert head["input_hash"] == outcome.scenario.input_hash
    told = head["parameters"]
    faults = [Fault(**f | {"until": math.inf if f["until"] is None else f["until"]}) for f in told["faults"]]
    assert faults == [Fault("ugv3", 120.0)]
    settings = Settings(**told["settings"])
    again = run_triage(outcome.scenario, head["method"], settings, seed=head["seed"], faults=faults)
    assert casualties_geojson(again) == text


def test_csv_rows_match_the_geojson_and_the_log(outcome: Outcome) -> None:
    """The list has the casualties of the map; the log every entry in order."""
    rows = list(csv.DictReader(io.StringIO(casualties_csv(outcome))))
    features = json.loads(casualties_geojson(outcome))["features"][1:]
    assert [r["id"] for r in rows] == [f["id"] for f in features]
    assert [r["state"] for r in rows] == [f["properties"]["state"] for f in features]
    log = list(csv.DictReader(io.StringIO(log_csv(outcome))))
    assert [(r["who"], r["what"], r["about"]) for r in log] == [(e.who, e.what, e.about) for e in outcome.log]
    times = [float(r["time"]) for r in log]
    assert times == sorted(times)


def test_cursor_on_target_events_are_well_formed_and_timed(outcome: Outcome) -> None:
    """Each event has what the format requires, a 9-line marker a casualty, and goes stale after it starts."""
    root = etree.fromstring(cursor_on_target(outcome, "2026-05-01T11:00:00+02:00"))
    events = root.findall("event")
    found = [f for f in outcome.fates if f.found is not None]
    markers = [e for e in events if e.get("type") == "b-r-f-h-c"]
    assert len(markers) == len(found)
    assert len(events) == len(found) + 5
    assert len({e.get("uid") for e in events}) == len(events)
    began = datetime.fromisoformat("2026-05-01T09:00:00Z")
    for event in events:
        assert event.get("version") == "2.0"
        assert event.get("how") == "m-s"
        start, stale = (datetime.fromisoformat(event.get(n)) for n in ("start", "stale"))
        assert began <= start < stale
        assert all(np.isfinite(float(event.find("point").get(n))) for n in ("lat", "lon", "hae", "ce", "le"))
    for fate, marker in zip(found, markers, strict=True):
        if fate.treated is not None:
            late = datetime.fromisoformat(marker.get("time")) - began - timedelta(seconds=fate.treated)
            assert abs(late) < timedelta(milliseconds=2)
        precedence = {"red": "urgent", "yellow": "priority", "green": "routine"}[fate.category or fate.sort or ""]
        assert marker.find("detail/_medevac_").get(precedence) == "1"


@pytest.mark.parametrize("start", ["today", "2026-05-01T09:00:00"])
def test_a_start_without_zone_or_sense_is_refused(outcome: Outcome, start: str) -> None:
    """A time that devices would misread is not written."""
    with pytest.raises(InputError, match=r"write it as|add Z"):
        cursor_on_target(outcome, start)

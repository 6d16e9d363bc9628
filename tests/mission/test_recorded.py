"""Progress by logs: a perfect run is the plan's own progress, and what went otherwise is found and told."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.api import assign, plan
from quarterdeck.coverage.metrics import swath
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.logs import Log
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.recorded import progress_state, recorded_progress
from quarterdeck.mission.replan import Changes, replan
from quarterdeck.mission.routes import survey_tracks
from quarterdeck.mission.tracks import record

DATA = Path(__file__).parents[2] / "data"


@cache
def planned(site):
    """Return a plan of a sample site: swaths, guards or tasks."""
    scenario = read_scenario(DATA / f"{site}.geojson")
    if site == "inspection_hall":
        return assign(scenario, iterations=20)
    return plan(scenario, method="guards", range=40) if site == "plant_yard" else plan(scenario, method="stc")


def perfect(mission, step=1.0):
    """Return a log for each vehicle that does its route exactly as planned, places as receivers round them."""
    logs = []
    for route in mission.routes:
        at = np.array(
            [(t, *xyz) for w, xyz in zip(route.waypoints, route.xyz, strict=True) for t in (w.time, w.time + w.hold)]
        )
        at = at[np.r_[True, np.diff(at[:, 0]) > 0]]
        time = np.append(np.arange(0.0, route.duration, step), route.duration)
        x, y, z = (np.interp(time, at[:, 0], at[:, i]) for i in (1, 2, 3))
        lon, lat = mission.frame.to_degrees(np.column_stack([x, y])).round(7).T
        none = np.full(len(time), np.nan)
        used = route.energy * time / max(route.duration, 1e-9)
        logs.append([(route.vehicle, Log(route.vehicle, "log", "mission", time, lon, lat, z, none, none, used))])
    return logs


def changed(logs, vehicle, **columns):
    """Return the logs with a change to the one of a vehicle: each column becomes what its function makes of it."""
    return [
        [(v, replace(log, **{n: f(getattr(log, n).copy()) for n, f in columns.items()}) if v == vehicle else log)]
        for [(v, log)] in logs
    ]


def without(logs, vehicle, chosen):
    """Return the logs, that of a vehicle without the places at which `chosen` of its times holds."""
    names = ("time", "lon", "lat", "height", "heading", "speed", "energy")
    return [
        [(v, replace(log, **{n: getattr(log, n)[~chosen(log.time)] for n in names}) if v == vehicle else log)]
        for [(v, log)] in logs
    ]


@pytest.mark.parametrize("part", [0.0, 0.137, 0.83])
@pytest.mark.parametrize("site", ["west_ant_island", "farm_survey", "plant_yard", "inspection_hall"])
def test_a_perfect_run_replans_to_the_plan(site, part):
    """By the logs of a perfect run `replan` gives the waypoints and times that it gives by the plan itself."""
    mission = planned(site)
    time = part * max(r.duration for r in mission.routes)
    found = record(mission, perfect(mission))
    assert not found.notes
    assert not found.reasons
    progress, notes = recorded_progress(mission, found.tracks, time)
    assert not notes
    mine, theirs = (replan(mission, p) for p in (progress, planned_progress(mission, time)))
    for a, b in zip(mine.routes, theirs.routes, strict=True):
        assert abs(len(a.waypoints) - len(b.waypoints)) <= 1  # one within a metre of a waypoint may have reached it
        count = min(len(a.waypoints), len(b.waypoints)) - 1
        assert np.allclose(a.xyz[0], b.xyz[0], atol=1.0)
        if count:
            assert np.allclose(a.xyz[-count:], b.xyz[-count:])
            assert np.allclose([w.time for w in a.waypoints[-count:]], [w.time for w in b.waypoints[-count:]], atol=1.0)
        assert a.energy == pytest.approx(b.energy, abs=1.0)
    assert progress.served == planned_progress(mission, time).served


def test_a_gap_is_driven_again():
    """What lies in a gap of the log does not count: it is told, and replanning has it driven."""
    mission = planned("farm_survey")
    route = mission.routes[1]
    first, last = 0.3 * route.duration, 0.5 * route.duration
    found = record(mission, without(perfect(mission), route.vehicle, lambda t: (t > first) & (t < last)))
    assert len(found.notes) == 1
    assert f"gaps: 1, of {last - first:,.0f} s" in found.notes[0].replace(
        f"{last - first + 1:,.0f}", f"{last - first:,.0f}"
    )
    progress, _ = recorded_progress(mission, found.tracks, 0.7 * route.duration)
    after = replan(mission, progress)
    lines = [t for v, r in zip(after.vehicles, after.routes, strict=True) for t in survey_tracks(v, r)]
    whole = [t for v, r in zip(mission.vehicles, mission.routes, strict=True) for t in survey_tracks(v, r)]
    promised = swath(whole, mission.spacing)
    assert promised.difference(swath([*progress.tracks, *lines], mission.spacing)).area < 0.01 * promised.area


def test_another_order_counts():
    """Who drives another's lines has done them: with the first two exchanged nothing is driven twice."""
    mission = planned("farm_survey")
    a, b = (r.vehicle for r in mission.routes[:2])
    logs = {v: log for [(v, log)] in perfect(mission)}
    crossed = [[(a, logs[b])], [(b, logs[a])], *[[(v, logs[v])] for v in logs if v not in {a, b}]]
    found = record(mission, crossed)
    assert any("are the files exchanged" in r.why for r in found.reasons)
    time = 0.5 * mission.routes[0].duration
    progress, _ = recorded_progress(mission, found.tracks, time)
    mine, theirs = (swath(p.tracks, mission.spacing) for p in (progress, planned_progress(mission, time)))
    assert mine.symmetric_difference(theirs).area < 0.02 * theirs.area


def test_a_jump_is_left_out_and_told():
    """A fix that jumps away for a second is left out; the rest is as it was."""
    mission = planned("west_ant_island")

    def jump(lat):
        lat[1000] += 0.01
        return lat

    found = record(mission, changed(perfect(mission, 5.0), "usv-2", lat=jump))
    assert len(found.notes) == 1
    assert "1 positions that jump away and back" in found.notes[0]
    assert np.hypot(*np.diff(found.tracks[1].xy, axis=0).T).max() < 50


def test_a_clock_that_goes_back_is_told():
    """Times that go back are left out, the most that agree are kept."""
    mission = planned("west_ant_island")

    def back(time):
        time[2000:2010] -= 600.0
        return time

    found = record(mission, changed(perfect(mission, 5.0), "usv-2", time=back))
    assert "clock goes back once, 9,400 s into it; 10 positions are left out, 55 s, in which" in found.notes[0]
    assert "10 positions are left out" in found.notes[0]
    assert (np.diff(found.tracks[1].time) > 0).all()


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"lat": lambda lat: lat + 5.0}, "km from the plan's site"),
        ({"lat": lambda lat: lat + 0.1}, "only 0% of its way is along its route"),
        ({"lat": lambda lat: np.full_like(lat, np.nan)}, "no fix"),
        ({"time": lambda time: time + 90_000.0}, "is its log of another day"),
        ({"time": lambda time: time - 900_000.0}, "before the mission's start"),
    ],
)
def test_logs_of_another_mission(columns, words):
    """A log from elsewhere, of another time, or without a fix is a reason, not a figure."""
    mission = planned("west_ant_island")
    found = record(mission, changed(perfect(mission, 5.0), "usv-2", **columns))
    assert len(found.reasons) == 1
    assert "usv-2" in str(found.reasons[0])
    assert words in str(found.reasons[0])


def test_a_vehicle_without_a_log():
    """It is a reason; and to replan it has to be given up, whereupon nothing of its own counts as done."""
    mission = planned("west_ant_island")
    found = record(mission, [log for log in perfect(mission, 5.0) if log[0][0] != "usv-5"])
    assert found.reasons == (Reason("no track given", "track", "usv-5"),)
    with pytest.raises(InputError, match="--lost usv-5"):
        recorded_progress(mission, found.tracks, 5000.0)
    progress, _ = recorded_progress(mission, found.tracks, 5000.0, stopped={"usv-5": float("inf")})
    after = replan(mission, progress, Changes(lost=frozenset({"usv-5"})))
    assert len(after.routes) == 4


def test_state_tells_the_same():
    """Written to a report and read back progress is the same to a millimetre."""
    mission = planned("farm_survey")
    progress, _ = recorded_progress(mission, record(mission, perfect(mission)).tracks, 300.0)
    state = progress_state(mission, progress)
    assert state["time"] == 300.0
    back = mission.frame.to_metres(np.array(state["tracks"][0]))
    assert np.allclose(back, progress.tracks[0], atol=1e-3)

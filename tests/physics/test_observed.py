"""A real mission is measured as a simulated one: logs of a run give the report of the run."""

from dataclasses import replace

import numpy as np
import pytest

from quarterdeck.geo.frame import Frame
from quarterdeck.mission.tracks import read_tracks
from quarterdeck.physics.observed import report_tracks

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")

EPOCH = 1_780_000_000.0  # the mission's start, Unix seconds
METRES = ("clearance", "separation", "outside", "length")


@pytest.fixture(scope="module")
def runs():
    """Return a cache of simulated runs by model."""
    return {}


@pytest.fixture
def driven(mow, runs):
    """Return a maker of missions with their simulated run."""
    from quarterdeck.physics.simulate import simulate

    def make(model):
        if model not in runs:
            mission = replace(mow(model, count=2, rows=4), frame=Frame(121.6, 38.9))
            runs[model] = mission, simulate(mission, seed=3)
        return runs[model]

    return make


def rows_of(mission, trace, i, wait=30.0, every=1):
    """Return the rows of a log of vehicle `i`: it stands for `wait` seconds before the mission, and for 20 after it."""
    dt = float(trace.time[1]) * every
    xy = np.column_stack([trace.x[::every, i], trace.y[::every, i]])
    lon, lat = mission.frame.to_degrees(xy).T
    compass = np.degrees(np.pi / 2 - trace.heading[::every, i]) % 360
    values = {"lon": lon, "lat": lat, "height": trace.z[::every, i], "heading": compass, "speed": trace.speed[::every, i]}
    values["energy"] = 5.0 + trace.energy[::every, i]
    before, after = round(wait / dt), round(20 / dt)
    rows = {n: np.r_[np.full(before, v[0]), v, np.full(after, v[-1])] for n, v in values.items()}
    rows["speed"][:before] = rows["speed"][len(rows["speed"]) - after :] = 0.0
    return rows | {"time": EPOCH - before * dt + np.arange(len(lon) + before + after) * dt}


def assert_same(logged, simulated, *, energy=True):
    """The same figures to a metre and a second, and what is no length or time to a thousandth."""
    for mine, theirs in zip(logged.vehicles, simulated.vehicles, strict=True):
        assert mine.time == pytest.approx(theirs.time, abs=1.0)
        assert mine.finished == theirs.finished
        assert mine.hits == theirs.hits
        for name in METRES:
            a, b = getattr(mine, name), getattr(theirs, name)
            assert a == b if b is None else a == pytest.approx(b, abs=1.0), name
        for legs in ("legs", "turns"):
            for name in ("mean", "p95", "max"):
                assert getattr(getattr(mine, legs), name) == pytest.approx(getattr(getattr(theirs, legs), name), abs=1.0)
        if energy:
            assert mine.energy == pytest.approx(theirs.energy, rel=0.01)
    assert logged.figures["coverage_driven"] == pytest.approx(simulated.figures["coverage_driven"], abs=1e-3)
    assert logged.passed == simulated.passed


@pytest.mark.parametrize("model", ["otter", "husky", "survey-quad"])
@pytest.mark.parametrize("ending", [".bin", ".tlog", ".gpx", ".csv"])
def test_logs_give_the_report_of_the_trace(driven, write_log, tmp_path, model, ending):
    """Written as a log, with standing before and after, and read back, a run gives its own report."""
    mission, run = driven(model)
    for i, vehicle in enumerate(mission.vehicles):
        write_log(tmp_path / f"{vehicle.id}{ending}", rows_of(mission, run.trace, i), EPOCH)
    start = None if ending in {".bin", ".tlog"} else EPOCH
    record = read_tracks(mission, [str(p) for p in sorted(tmp_path.iterdir())], start=start)
    assert record.start == pytest.approx(EPOCH, abs=1.0)
    assert not record.reasons
    report = report_tracks(mission, record).report
    assert_same(report, run.report, energy=ending != ".gpx")
    told = [n for n in report.notes if "no energy" in n]
    assert len(told) == (2 if ending == ".gpx" else 0)
    assert list(report.notes) == told


def test_trace_gives_its_own_report(driven, tmp_path):
    """What `simulate --trace` writes is read back as the run that it was."""
    mission, run = driven("otter")
    path = tmp_path / "run.npz"
    path.write_bytes(run.trace.to_bytes(mission.frame))
    record = read_tracks(mission, [str(path)])
    assert_same(report_tracks(mission, record).report, run.report)


def test_a_log_that_ends_under_way_is_told(driven, tmp_path):
    """The trace of a run that was cut short says so, vehicle by vehicle, beside what was not finished."""
    from quarterdeck.physics.simulate import simulate

    mission, _ = driven("otter")
    path = tmp_path / "cut.npz"
    path.write_bytes(simulate(mission, seed=3, duration=30.0).trace.to_bytes(mission.frame))
    report = report_tracks(mission, read_tracks(mission, [str(path)])).report
    ids = [v.id for v in mission.vehicles]
    assert [n for n in report.notes if "its log ends" in n] == [
        f"{v}: its log ends at 30 s, before it was home" for v in ids
    ]
    assert f"did not finish: {', '.join(ids)}" in report.reasons


def test_start_by_setting_off(driven, write_log, tmp_path):
    """Without a word of when it began, the mission begins as the vehicles set off."""
    mission, run = driven("otter")
    for i, vehicle in enumerate(mission.vehicles):
        write_log(tmp_path / f"{vehicle.id}.gpx", rows_of(mission, run.trace, i))
    record = read_tracks(mission, [str(p) for p in sorted(tmp_path.iterdir())])
    assert record.start == pytest.approx(EPOCH, abs=3.0)


def test_receivers_that_scatter(driven, write_log, tmp_path):
    """A fix a second, half a metre off at random: the mission begins and ends within a few seconds of when it did."""
    mission, run = driven("otter")
    random = np.random.default_rng(1)
    for i, vehicle in enumerate(mission.vehicles):
        rows = rows_of(mission, run.trace, i, every=10, wait=120.0)
        off = random.normal(0.0, 0.5, (len(rows["time"]), 2)) / 111_000
        rows |= {"lon": rows["lon"] + off[:, 0] / np.cos(np.radians(38.9)), "lat": rows["lat"] + off[:, 1]}
        write_log(tmp_path / f"{vehicle.id}.gpx", rows)
    record = read_tracks(mission, [str(p) for p in sorted(tmp_path.iterdir())])
    assert record.start == pytest.approx(EPOCH, abs=6.0)
    report = report_tracks(mission, record).report
    for mine, theirs in zip(report.vehicles, run.report.vehicles, strict=True):
        assert mine.finished
        assert mine.time == pytest.approx(theirs.time, abs=10.0)
        assert mine.legs.p95 == pytest.approx(theirs.legs.p95, abs=1.0)
    assert report.figures["coverage_driven"] == pytest.approx(run.report.figures["coverage_driven"], abs=0.02)

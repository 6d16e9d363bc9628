"""Sensing in a run: what is believed, what is seen, and what it does to the vehicles."""

import json
import math

import jsonschema
import numpy as np
import pytest
from shapely import affinity, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.physics.report import report_schema
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


def yard(*, wide: float = 2.0) -> list[Obstacle]:
    """Return walls along two legs of a rover, 5 m apart, that a scan can be matched with; 1 m beside its way."""
    boxes = [box(x, y, x + w, y + wide) for x, y, w in ((5, -4, 3), (14, 1.5, 5), (24, -4, 4), (33, 1.2, 3), (20, 7, 2))]
    return [Obstacle(f"b{i}", b) for i, b in enumerate(boxes)]


def test_known_poses_have_no_error_and_the_lidar_does_not_disturb(mow) -> None:
    """Along a plan that keeps its clearance, a robot with lidar drives as one without."""
    mission = mow("husky", spacing=5.0, length=40.0, obstacles=yard())
    blind, seeing = simulate(mission), simulate(mission, sensing=Sensing(lidar=True))
    assert seeing.report.passed, seeing.report.reasons
    assert seeing.report.vehicles[0].localisation.max == 0
    assert blind.report.vehicles[0].localisation is None
    assert seeing.report.figures["time"] < 1.05 * blind.report.figures["time"]
    assert seeing.report.figures["legs_p95"] < 0.1


def test_a_robot_localises_by_its_lidar(mow) -> None:
    """Among obstacles the particle filter knows the place to a few centimetres, and the mission passes on its word
    alone.
    """
    run = simulate(mow("husky", spacing=5.0, length=40.0, obstacles=yard()), sensing=Sensing(amcl=True), seed=3)
    assert run.report.passed, run.report.reasons
    place = run.report.vehicles[0].localisation
    assert place.p95 < 0.15
    assert place.lidar > 0.9
    assert run.report.settings["amcl"]
    jsonschema.validate(json.loads(run.report.to_json()), report_schema())


def test_where_there_is_nothing_to_see_gnss_takes_over(mow) -> None:
    """On an empty field a lidar tells nothing: the robot lives by GNSS, and by dead reckoning when that fails too."""
    mission = mow("husky", spacing=5.0, length=20.0)
    place = (
        simulate(mission, sensing=Sensing(gnss="rtk", amcl=True), limits={"outside": 99}).report.vehicles[0].localisation
    )
    assert place.gnss > 0.8
    assert place.p95 < 0.3
    deaf = simulate(mission, sensing=Sensing(gnss="rtk", amcl=True), faults=["gnss:husky-1@0"], duration=60.0)
    assert deaf.report.vehicles[0].localisation.dead > 0.8


def test_a_robot_that_comes_back_to_what_it_knows_lives_by_its_lidar_again(mow) -> None:
    """Between two groups of boxes 115 m apart it sees nothing, and is bounded by a poor receiver without taking over its
    errors; at the next boxes the lidar has it again.
    """
    boxes = [*yard(), *(Obstacle(f"far-{o.id}", affinity.translate(o.polygon, 155.0)) for o in yard())]
    mission = mow("husky", spacing=5.0, length=200.0, obstacles=boxes)
    run = simulate(mission, sensing=Sensing(amcl=True), seed=1, sample=1.0)
    place = run.report.vehicles[0].localisation
    assert 0.02 < place.gnss < 0.6
    assert place.p95 < 0.6
    assert run.report.passed, run.report.reasons


def test_gnss_errors_show_in_the_track_and_not_only_in_the_belief(mow) -> None:
    """The report measures where the vessel was: cross-track errors are about the receiver's, RTK's smaller."""
    mission, errors = mow("otter", spacing=40.0), []
    for gnss in ("rtk", "single"):
        report = simulate(mission, sensing=Sensing(gnss=gnss), seed=2).report
        errors.append((report.vehicles[0].localisation.p95, report.vehicles[0].legs.p95))
    assert errors[0][0] < 0.1 < 0.5 < errors[1][0]
    assert errors[0][1] < errors[1][1]
    assert errors[1][1] > 0.4


def test_without_gnss_a_vessel_reckons_on_and_is_off(mow) -> None:
    """It knows its place until the receiver fails; from then on the error grows; when it is back the error is gone."""
    report = simulate(mow("otter", spacing=40.0), faults=["gnss:otter-1@30-100"], limits={"coverage_loss": 1}).report
    place = report.vehicles[0].localisation
    assert place.max > 0.5
    assert 0.1 < place.dead < 0.6
    assert report.vehicles[0].finished


def test_an_unmapped_obstacle_is_hit_blind_and_rounded_seeing(mow) -> None:
    """A crate on the way that the plan does not know: lidar and potential field go round it and finish."""
    mission, crate = mow("husky", spacing=5.0, length=30.0), Obstacle("crate", box(14, -0.4, 15.5, 1.0))
    blind = simulate(mission, sensing=Sensing(unmapped=(crate,)), duration=200.0).report
    assert blind.vehicles[0].hits == ("crate",)
    seeing = simulate(
        mission, sensing=Sensing(lidar=True, unmapped=(crate,)), limits={"coverage_loss": 1, "cross_track": 9}
    )
    assert seeing.report.passed, seeing.report.reasons
    assert seeing.report.vehicles[0].clearance > 0.1


def test_the_papers_field_goes_round_nothing_square_in_its_way(mow) -> None:
    """With the published gains the robot stays off the crate as well, but stops before it, until it plans a way around."""
    mission, crate = mow("husky", spacing=5.0, length=30.0), Obstacle("crate", box(14, -1.0, 15.5, 1.0))
    run = simulate(mission, sensing=Sensing(lidar=True, unmapped=(crate,), field="paper"), duration=60.0)
    assert not run.report.figures["collisions"]
    x, pause = run.trace.x[:, 0], 100
    standing = np.abs(x[pause:] - x[:-pause]) < 0.3
    assert ((x[pause:] > 9) & (x[pause:] < 14) & standing).any()
    assert x.max() > 16
    assert run.report.settings["field"] == "paper"


def test_a_blocked_robot_stops_and_says_so(mow) -> None:
    """Before a wall the robot stops short of it, the director is told, once, and it looks along the wall for its end."""
    told = []

    def director(time, states, events, memory):
        from quarterdeck.mission.director import fixed

        told.extend(e for e in events if e.kind == "blocked")
        return fixed(mission)(time, states, events, memory)

    mission, wall = mow("husky", spacing=5.0, length=30.0), Obstacle("wall", box(14, -60, 15, 60))
    sensing = Sensing(lidar=True, unmapped=(wall,))
    run = simulate(mission, director=director, sensing=sensing, duration=80.0)
    assert not run.report.figures["collisions"]
    assert [e.vehicle for e in told] == ["husky-1"]
    assert np.ptp(run.trace.y) > 20
    assert math.hypot(told[0].data["x"] - 14, told[0].data["y"]) < 2.0


def test_the_same_seed_senses_the_same(mow) -> None:
    """Noise, particles and all: the hash of the trace repeats, and another seed's differs."""
    mission, sensing = mow("husky", spacing=5.0, obstacles=yard()), Sensing(amcl=True, gnss="sbas")
    first, again, other = (simulate(mission, sensing=sensing, seed=s, duration=20.0).trace.hash for s in (1, 1, 2))
    assert first == again
    assert first != other


def test_an_unknown_receiver_is_one_line() -> None:
    """The line says which there are."""
    with pytest.raises(InputError, match="known: rtk, sbas, single"):
        Sensing(gnss="glonass")

"""Maps made of scans: what is seen is on them, right, and they serve as a twin."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.occupancy import FREE, OCCUPIED, UNKNOWN, site_occupancy, write_map
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Area, Obstacle, Site
from quarterdeck.mission.assign import assign
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.twin import map_scenario
from quarterdeck.physics.lidar import beam_angles, cast, edge_grid
from quarterdeck.physics.mapping import agreement, fuse, no_evidence
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.simulate import simulate

HALL = Path(__file__).parents[2] / "data" / "inspection_hall.geojson"
ANGLES = beam_angles(180)


@settings(deadline=None, max_examples=25)
@given(
    x=st.floats(1.0, 7.0), y=st.floats(1.0, 9.0), heading=st.floats(-3.1, 3.1), depth=st.floats(0.3, 2.0),
)  # fmt: skip
def test_a_scan_frees_what_it_passes_and_marks_what_it_meets(x: float, y: float, heading: float, depth: float) -> None:
    """No cell inside a box becomes free, none that the beams pass becomes occupied, and what nobody saw stays unknown."""
    thing = box(8.0, 2.0, 8.0 + depth, 8.0)
    site = Site((), MultiPolygon([box(0, 0, 12, 10)]), (Obstacle("thing", thing),))
    evidence, pose = no_evidence(site, 0.1), np.array([x, y, heading])
    ranges = cast(edge_grid([thing]), pose[None], ANGLES, 30.0)[0]
    for _ in range(5):
        fuse(evidence, pose, ANGLES, ranges, 30.0)
    made = evidence.occupancy()
    centres = made.to_metres(np.argwhere(made.cells == FREE) + 0.5)
    assert len(centres) > 500
    assert not any(thing.buffer(-0.08).contains(Point(c)) for c in centres)
    walls = made.to_metres(np.argwhere(made.cells == OCCUPIED) + 0.5)
    assert len(walls) > 10
    assert max(thing.boundary.distance(Point(c)) for c in walls) < 0.08
    behind = np.floor(made.to_cells(np.array([[8.0 + depth + 0.3, y]]))).astype(int)[0]
    if 2.5 < y < 7.5:
        assert made.cells[behind[0], behind[1]] == UNKNOWN


def test_echoes_that_are_lost_free_nothing_behind_a_wall() -> None:
    """Single beams without an echo among others that have one say nothing."""
    wall = box(5, -20, 5.2, 20)
    evidence = no_evidence(Site((), MultiPolygon([box(0, -5, 10, 5)]), (Obstacle("wall", wall),)), 0.1)
    pose, rng = np.array([2.0, 0.0, 0.0]), np.random.default_rng(0)
    clean = cast(edge_grid([wall]), pose[None], ANGLES, 30.0)[0]
    for _ in range(50):
        lost = clean.copy()
        lost[rng.integers(0, 90, 2) * 2] = np.inf
        fuse(evidence, pose, ANGLES, np.where(np.isfinite(clean), lost, np.inf), 30.0)
    made = evidence.occupancy()
    assert (made.cells[:, 55:] != FREE).mean() > 0.99


def test_a_map_of_the_truth_agrees_with_it() -> None:
    """The site's own occupancy as a map is right everywhere."""
    site = read_scenario(HALL).site
    figures = agreement(site_occupancy(site, "ground", 0.1), site)
    assert figures["map_free_iou"] > 0.999
    assert figures["map_known"] == 1.0


def test_a_hall_is_mapped_and_the_map_is_a_twin(tmp_path: Path) -> None:
    """Robots that know of nothing drive lines over the hall and draw it; tasks assigned on that map are served by robots
    that localise on it, in the true hall.
    """
    pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    hall = read_scenario(HALL)
    bare = replace(hall, site=Site((Area("floor", hall.site.operating),), hall.site.operating), tasks=())
    drive = plan_lines(bare, spacing=2.0)
    drawn = simulate(drive, sensing=Sensing(lidar=True, world=hall.site.obstacles, mapping=True), sample=1.0)
    assert not drawn.report.figures["collisions"]
    assert drawn.report.figures["map_known"] > 0.98
    assert drawn.report.figures["map_free_iou"] > 0.98
    assert drawn.report.figures["map_walls_right"] > 0.98
    assert drawn.map is not None
    path = write_map(drawn.map, tmp_path / "hall.yaml")
    unmapped = replace(hall, site=replace(hall.site, obstacles=()))
    scenario, twin = map_scenario(unmapped, path)
    mission = assign(scenario, twin=twin, iterations=10)
    run = simulate(mission, sensing=Sensing(amcl=True, world=hall.site.obstacles))
    assert run.report.passed, run.report.reasons
    assert run.report.figures["tasks_served"] == 5
    assert run.report.vehicles[0].localisation is not None
    assert run.report.vehicles[0].localisation.p95 < 0.25


def test_a_map_needs_eyes() -> None:
    """One line says that robots without lidar draw no map."""
    with pytest.raises(InputError, match="lidar"):
        Sensing(mapping=True)

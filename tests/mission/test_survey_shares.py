"""Areas of a higher priority are surveyed first, whoever's they would be."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.cover import cover, roadmaps
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.sharing import line_of
from quarterdeck.mission.survey_shares import shared

BORDER = 100.0  # m east: what is beyond is urgent


def scenario(shares, battery=None):
    """Return two areas side by side, the eastern one urgent, and three rovers south of the western one."""
    west, east = shapely.box(0, 0, BORDER, 60), shapely.box(BORDER, 0, 140, 60)
    site = Site(
        (Area("west", as_multipolygon(west)), Area("east", as_multipolygon(east), 2)),
        as_multipolygon(shapely.box(-10, -10, 150, 70)),
    )
    model = load_model("husky")
    fleet = [Vehicle(f"v{i}", model, (2.0 + 10 * i, -5.0), share=s, clearance=0.5) for i, s in enumerate(shares)]
    fleet = [replace(v, battery=battery or v.battery) for v in fleet]
    return Scenario("two areas", Frame(8.0, 54.0), site, tuple(fleet), spacing=5.0)


def level(given):
    """Return the scenario with areas of one priority."""
    return replace(given, site=replace(given.site, areas=tuple(replace(a, priority=0) for a in given.site.areas)))


def ways(mission):
    """Return of each route the metres surveyed in the east, in the west, and in the east after the first in the west."""
    found = []
    for route in mission.routes:
        xy = route.xyz[:, :2]
        metres = np.hypot(*np.diff(xy, axis=0).T) * route.survey[1:]
        east = (xy[1:, 0] + xy[:-1, 0]) / 2 > BORDER
        first = np.flatnonzero(~east & (metres > 0))[0]
        found.append((metres[east].sum(), metres[~east].sum(), metres[first:][east[first:]].sum()))
    return np.array(found)


@pytest.mark.parametrize("plan", [cover, plan_lines])
@pytest.mark.parametrize("shares", [(None,) * 3, (0.5, 0.3, 0.2)])
def test_the_urgent_area_is_surveyed_first_and_as_much_is_covered(plan, shares):
    """Nobody comes back to the urgent area; without shares all take part in it; what is covered stays as it was."""
    urgent, plain = plan(scenario(shares)), plan(level(scenario(shares)))
    east, west, late = ways(urgent).T
    assert urgent.feasible
    assert late.max() < 1.0
    assert ways(plain)[:, 2].max() > 10.0
    assert urgent.figures["poc"] == pytest.approx(plain.figures["poc"], abs=0.005)
    assert east.sum() + west.sum() == pytest.approx(ways(plain)[:, :2].sum(), rel=0.01)
    if shares[0] is None:
        assert east.max() < 1.3 * east.min()


def test_a_plan_beyond_the_energy_leaves_nothing_out():
    """Where the energy does not suffice that is told, and all of the area stays planned: `--sorties` may split it."""
    poor = cover(scenario((None,) * 3, battery=5.0))
    assert not poor.feasible
    assert {r.kind for r in poor.reasons} == {"energy"}
    assert poor.figures["poc"] > 0.98


@pytest.mark.parametrize("battery", [1e-3, 6.0, 12.0])
def test_lines_are_cut_where_the_energy_ends_and_crumbs_too(battery):
    """What is left out is what there is no energy for; even a crumb of a line goes where nothing can be paid."""
    given = level(scenario((None,) * 3, battery))
    roads = roadmaps(given)
    able = np.ones(3, dtype=bool)
    own = [
        [line_of(np.array([[x, 2.0], [x, 2.0 + size]]), able) for x, size in ((5.0, 55.0), (10.0, 0.3), (15.0, 55.0))]
    ] * 3
    survey = shared(given, roads, own, [], np.full(3, 1.0), 5.0)
    assert not survey.reasons
    metres = sum(np.hypot(*np.diff(r.xyz[:, :2], axis=0).T)[r.survey[1:]].sum() for r in survey.routes)
    assert metres + sum(x.length for x in survey.left) == pytest.approx(3 * 110.3, rel=1e-6)
    assert survey.left
    if battery == 1e-3:
        assert metres == 0.0
    else:
        assert all(r.energy > 0.9 * 0.8 * battery for r in survey.routes)

"""Shares: those given, or those with which all come home together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from quarterdeck.coverage.shares import even_shares
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover

DATA = Path(__file__).parents[2] / "data"
positive = st.floats(0.1, 10)


@given(st.lists(st.tuples(positive, st.floats(0, 50)), min_size=1, max_size=8), st.floats(1000, 1e5))
def test_all_come_home_together(fleet, length):
    """With time enough, ways and surveys take everybody equally long."""
    speeds, away = np.array(fleet).T
    shares = even_shares(length, speeds, away, np.full(len(fleet), np.inf))
    times = away + shares * length / speeds
    assert np.isclose(shares.sum(), 1.0)
    assert np.ptp(times[shares > 2e-3 / len(fleet)]) < 0.02 * times.max()


def test_a_limit_caps_a_share():
    """Who can be out for a tenth of the time does no more than that allows."""
    shares = even_shares(1000.0, np.ones(2), np.zeros(2), np.array([100.0, np.inf]))
    assert np.allclose(shares, [0.1, 0.9], atol=1e-6)


def test_a_slow_or_weak_vehicle_gets_less():
    """Without given shares, half the speed and a small battery both make the region smaller, and the plan feasible."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    one, other = scenario.vehicles
    slow = cover(replace(scenario, vehicles=(one, replace(other, speed=0.5))))
    assert 0.25 < slow.figures["shares"][1] < 0.42
    weak = cover(replace(scenario, vehicles=(one, replace(other, battery=60.0))))
    assert weak.figures["shares"][1] < 0.4
    assert weak.feasible

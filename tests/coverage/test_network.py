"""The network that robots move on, from where they stand."""

import numpy as np
import pytest
import shapely

from quarterdeck.coverage.network import network
from quarterdeck.geo.scenario import as_multipolygon


@pytest.mark.parametrize("start", [(5.0, -1e-9), (10.0 + 1e-9, 10.0 + 1e-9), (3.0, 3.0)])
def test_robots_enter_from_beside_the_border_too(start):
    """Who stands outside by rounding, at an edge or a corner, enters where one does that stands inside."""
    reach = as_multipolygon(shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6)))
    guards = np.array([[2.0, 2.0], [8.0, 8.0]])
    inside = np.clip(start, 1e-6, 10.0 - 1e-6)
    net, beside = (network(reach, guards, np.array([at])) for at in (start, inside))
    assert net.entries.tolist() == beside.entries.tolist()
    assert np.allclose(net.access[0], beside.access[0], atol=1e-5)

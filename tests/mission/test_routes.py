"""Routes along survey lines."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.cover import roadmaps
from quarterdeck.mission.routes import line_routes, survey_lines

SEA = as_multipolygon(shapely.box(-200, -200, 200, 200))


@settings(max_examples=20, deadline=None)
@given(part=st.floats(0.1, 0.9), angle=st.floats(0.0, 6.28))
def test_a_line_in_two_pieces_is_driven_whole(part, angle):
    """Pieces that follow one another, as lines that were shared out again do, are one line of the route."""
    boat = Vehicle("v1", load_model("wam-v"), (-100.0, -100.0), turn_radius=8.0, clearance=8.0)
    scenario = Scenario("sea", Frame(8.0, 54.0), Site((Area("sea", SEA),), SEA), (boat,), spacing=25.0)
    way = np.array([np.cos(angle), np.sin(angle)])
    line = np.array([-40.0 * way, 40.0 * way])
    cut = line[0] + part * (line[1] - line[0])
    routes, missing = line_routes((boat,), [[np.array([line[0], cut]), np.array([cut, line[1]])]], roadmaps(scenario))
    driven = shapely.union_all([shapely.LineString(x) for x in survey_lines(routes)])
    assert not missing
    assert shapely.LineString(line).difference(driven.buffer(0.1)).length < 1.0

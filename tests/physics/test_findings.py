"""What robots see that the map does not have: put on one map by those who are heard, on their own by those who are not."""

import numpy as np
from shapely import MultiPolygon, box

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Obstacle, Site, Vehicle
from quarterdeck.physics.findings import Findings
from quarterdeck.physics.lidar import beam_angles, cast, edge_grid


def test_a_robot_that_is_not_heard_keeps_what_it_saw_until_it_is():
    """Its own map has the door, the common one does not, until it is heard again."""
    walls, door = (box(9.9, 0, 10.1, 1), box(9.9, 3, 10.1, 7), box(9.9, 9, 10.1, 10)), box(9.95, 1, 10.05, 3)
    site = Site((), MultiPolygon([box(0, 0, 20, 10)]), tuple(Obstacle(f"w{n}", w) for n, w in enumerate(walls)))
    model = load_model("jackal")
    vehicles = [Vehicle(f"r{n}", model, (2.0, 2.0), speed=1.0, clearance=0.45, battery=model.battery) for n in (1, 2)]
    findings, angles = Findings(site, vehicles, np.array([0, 1])), beam_angles(180)
    pose = np.array([[6.0, 2.0, 0.0], [2.0, 9.0, 0.0]])
    ranges = cast(edge_grid([*walls, door]), pose, angles, 30.0)
    ranges[1] = np.inf
    sure = present = np.ones(2, bool)
    assert not len(findings.found(0))

    def look(mute):
        for _ in range(3):
            findings.look(pose, sure, angles, ranges, 30.0, np.array([mute, False]), present)

    look(True)
    assert len(findings.found(0)) > 5
    assert not len(findings.found(1))
    ranges[:] = np.inf
    look(False)
    assert len(findings.found(1)) > 5
    assert np.allclose(findings.found(1)[:, 0], 10.0, atol=0.2)

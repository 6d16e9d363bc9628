"""A small plan and studies of it."""

from collections.abc import Callable
from pathlib import Path

import pytest
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Site, Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.planfile import plan_text


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A PLAN of two rovers, each on one survey leg of 12 m and back."""
    kind, vehicles, routes = load_model("husky"), [], []
    area = box(-2, -2, 14, 12)
    for i in range(2):
        y = 8.0 * i
        vehicles.append(Vehicle(f"ugv-{i + 1}", kind, (0.0, y), speed=1.0, clearance=0.8, battery=kind.battery))
        points = ((0.0, "start", 0.0), (12.0, "survey", 12.0), (0.0, "transit", 27.0))
        routes.append(Route(f"ugv-{i + 1}", tuple(Waypoint(x, y, leg=leg, speed=1.0, time=t) for x, leg, t in points)))
    site = Site((Area("a", MultiPolygon([area])),), MultiPolygon([area.buffer(20)]))
    path = tmp_path_factory.mktemp("plan") / "plan.geojson"
    mission = Mission("yard", Frame(8.0, 47.0), site, tuple(vehicles), tuple(routes), "by hand", spacing=2.0)
    path.write_text(plan_text(mission), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def study(plan: Path) -> Callable[[str], Path]:
    """Return a writer of study files beside the plan."""

    def write(text: str) -> Path:
        path = plan.with_name("study.toml")
        path.write_text(f'plan = "{plan.name}"\n{text}', encoding="utf-8")
        return path

    return write

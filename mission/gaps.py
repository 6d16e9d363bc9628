"""What a mission left uncovered, as a site that can be planned again."""

from dataclasses import replace

import shapely
from shapely import MultiPolygon
from shapely.geometry.base import BaseGeometry

from quarterdeck.geo.scenario import Area, Scenario, Site, as_multipolygon
from quarterdeck.mission.guards import least_range
from quarterdeck.mission.mission import Mission

SLIVER = 0.5  # spacings: what is narrower is not worth a track


def gap_site(mission: Mission, missed: BaseGeometry) -> tuple[Scenario, MultiPolygon]:
    """Return the scenario that covers `missed`, metres, and what of it was dropped, for it is narrower than SLIVER.

    The operating area, the obstacles and the vehicles are the plan's. Shares are left to follow from speeds.
    """
    width = SLIVER * (least_range(mission) if mission.spacing is None else mission.spacing)
    wide = shapely.buffer(shapely.buffer(missed, -width / 2, join_style="mitre"), width / 2, join_style="mitre")
    worth = as_multipolygon(shapely.intersection(wide, missed))
    parts = sorted(worth.geoms, key=lambda p: (-p.area, p.bounds))
    areas = tuple(Area(f"gap-{i}", MultiPolygon([part])) for i, part in enumerate(parts, 1))
    site = Site(areas, mission.site.operating, mission.site.obstacles)
    vehicles = tuple(replace(v, share=None) for v in mission.vehicles)
    name = f"{mission.name}: gaps"
    scenario = Scenario(name, mission.frame, site, vehicles, spacing=mission.spacing, input_hash=mission.input_hash)
    return scenario, as_multipolygon(shapely.difference(missed, worth))

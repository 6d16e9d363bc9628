"""A rerun recording: the plan on a map and in metres, and the run over it where there is one.

Columns are sent whole: a call for each row would cost some 90 microseconds (measured with rerun 0.41).
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import shapely
from shapely.geometry.base import BaseGeometry

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import file_stems
from quarterdeck.geo.palette import colours
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.trace import Trace

TIMELINE = "mission_time"
CURVES = {"speed": "speed, m/s", "energy": "energy used, Wh", "cross": "off track, m"}

SAMPLES = 20_000  # of a vehicle at the most: a day at sea every few seconds, a flight of half an hour at 10 Hz


def files(mission: Mission, settings: Settings) -> dict[str, bytes]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>.rrd` with the plan."""
    return {f"{file_stems(mission)[0]}.rrd": recording(mission)}


def recording(mission: Mission, trace: Trace | None = None) -> bytes:
    """Return the bytes of a .rrd file: the site, every route, and each vehicle as it moves.

    With a `trace` vehicles move as they were driven, with speeds, energies and errors as curves; without, by the plan's
    times. The map view is in degrees, the other one in metres of the mission's frame.
    """
    stream = rr.RecordingStream("quarterdeck", recording_id=mission.input_hash[:32] or mission.name, send_properties=False)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mission.rrd"
        stream.save(path, default_blueprint=_blueprint(curves=trace is not None))
        _site(stream, mission)
        for i, (route, colour) in enumerate(zip(mission.routes, colours(len(mission.routes)), strict=True)):
            rgb = [int(colour[n : n + 2], 16) for n in (1, 3, 5)]
            _line(stream, mission, f"plan/{route.vehicle}", route.xyz, rgb)
            if trace is None:
                times = np.array([w.time for w in route.waypoints])
                _moving(stream, mission, f"vehicles/{route.vehicle}", times, route.xyz, rgb)
            else:
                _driven(stream, mission, trace, i, rgb)
        stream.flush()
        stream.disconnect()
        return path.read_bytes()


def _driven(stream: rr.RecordingStream, mission: Mission, trace: Trace, i: int, rgb: list[int]) -> None:
    name = trace.vehicles[i]
    kept = slice(None, None, max(1, -(-len(trace.time) // SAMPLES)))
    xyz = np.column_stack([trace.x[kept, i], trace.y[kept, i], trace.z[kept, i] + trace.ground[kept, i]])
    _line(stream, mission, f"driven/{name}", xyz, rgb)
    _moving(stream, mission, f"vehicles/{name}", trace.time[kept], xyz, rgb)
    index = [rr.TimeColumn(TIMELINE, duration=trace.time[kept])]
    for curve in CURVES:
        values = getattr(trace, curve)[kept, i].astype(float)
        stream.send_columns(f"curves/{curve}/{name}", indexes=index, columns=rr.Scalars.columns(scalars=values))
        stream.log(f"curves/{curve}/{name}", rr.SeriesLines(colors=[rgb], names=[name]), static=True)


def _blueprint(*, curves: bool) -> rrb.Blueprint:
    maps = rrb.Horizontal(rrb.MapView(origin="/map", name="Map"), rrb.Spatial3DView(origin="/metres", name="Metres"))
    plots = [rrb.TimeSeriesView(origin=f"/curves/{curve}", name=name) for curve, name in CURVES.items()]
    layout = rrb.Vertical(maps, rrb.Horizontal(*plots), row_shares=[3, 1]) if curves else maps
    return rrb.Blueprint(layout, rrb.TimePanel(timeline=TIMELINE), collapse_panels=True)


def _site(stream: rr.RecordingStream, mission: Mission) -> None:
    for name, geometry, colour in (
        ("operating", mission.site.operating, [85, 85, 85]),
        ("areas", mission.site.area, [100, 160, 200]),
        ("obstacles", shapely.MultiPolygon([o.polygon for o in mission.site.obstacles]), [127, 0, 0]),
    ):
        rings = _rings(geometry)
        if not rings:
            continue
        stream.log(f"metres/site/{name}", rr.LineStrips3D([_flat(ring) for ring in rings], colors=colour), static=True)
        lines = [_lat_lon(mission, ring) for ring in rings]
        stream.log(f"map/site/{name}", rr.GeoLineStrings(lat_lon=lines, colors=colour), static=True)


def _line(stream: rr.RecordingStream, mission: Mission, entity: str, xyz: np.ndarray, rgb: list[int]) -> None:
    stream.log(f"metres/{entity}", rr.LineStrips3D([xyz], colors=rgb), static=True)
    stream.log(f"map/{entity}", rr.GeoLineStrings(lat_lon=[_lat_lon(mission, xyz)], colors=rgb), static=True)


def _moving(
    stream: rr.RecordingStream, mission: Mission, entity: str, times: np.ndarray, xyz: np.ndarray, rgb: list[int]
) -> None:
    index = [rr.TimeColumn(TIMELINE, duration=times)]
    stream.log(f"metres/{entity}", rr.Points3D.from_fields(colors=rgb, radii=rr.Radius.ui_points(6.0)), static=True)
    stream.log(f"map/{entity}", rr.GeoPoints.from_fields(colors=rgb, radii=rr.Radius.ui_points(6.0)), static=True)
    stream.send_columns(f"metres/{entity}", indexes=index, columns=rr.Points3D.columns(positions=xyz))
    stream.send_columns(f"map/{entity}", indexes=index, columns=rr.GeoPoints.columns(positions=_lat_lon(mission, xyz)))


def _rings(geometry: BaseGeometry) -> list[np.ndarray]:
    return [shapely.get_coordinates(ring) for part in geometry.geoms for ring in (part.exterior, *part.interiors)]


def _flat(xy: np.ndarray) -> np.ndarray:
    return np.column_stack([xy[:, :2], np.zeros(len(xy))])


def _lat_lon(mission: Mission, xyz: np.ndarray) -> np.ndarray:
    # A line over the antimeridian must not run around the world: longitudes go on from the first instead of wrapping.
    lonlat = mission.frame.to_degrees(xyz[:, :2])
    return np.column_stack([lonlat[:, 1], np.unwrap(lonlat[:, 0], period=360.0)])

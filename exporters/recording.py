"""A rerun recording: the plan on a map and in metres, and the run over it where there is one.

Columns are sent whole: a call for each row would cost some 90 microseconds (measured with rerun 0.41).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import shapely
from shapely.geometry.base import BaseGeometry

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.map_furniture import clock
from quarterdeck.exporters.places import file_stems
from quarterdeck.geo.palette import CASUALTY, SITE, TASK
from quarterdeck.mission.layers import drawn, fleet_colours
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.moments import WORDS, Moment
from quarterdeck.physics.trace import Trace

TIMELINE = "mission_time"
CURVES = {"speed": "speed, m/s", "energy": "energy used, Wh", "cross": "off track, m"}

SAMPLES = 20_000  # of a vehicle at the most: a day at sea every few seconds, a flight of half an hour at 10 Hz


def files(mission: Mission, settings: Settings) -> dict[str, bytes]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>.rrd` with the plan."""
    return {f"{file_stems(mission)[0]}.rrd": recording(mission)}


def recording(mission: Mission, trace: Trace | None = None, *, moments: Sequence[Moment] = ()) -> bytes:
    """Return the bytes of a .rrd file: all that the picture has, in its colours, and each vehicle as it moves.

    With a `trace` vehicles move as they were driven, with speeds, energies and errors as curves; without, by the plan's
    times. The map view is in degrees, the other one in metres of the mission's frame. `moments`, who was lost or told a
    new route, appear where and when they happened, and in a log.
    """
    stream = rr.RecordingStream("quarterdeck", recording_id=mission.input_hash[:32] or mission.name, send_properties=False)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mission.rrd"
        stream.save(path, default_blueprint=_blueprint(curves=trace is not None, log=bool(moments)))
        palette = fleet_colours(mission)
        _site(stream, mission)
        _layers(stream, mission, palette)
        _happened(stream, mission, moments, palette)
        for i, route in enumerate(mission.routes):
            rgb = _rgb(palette[route.vehicle])
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


def _blueprint(*, curves: bool, log: bool) -> rrb.Blueprint:
    maps = rrb.Horizontal(rrb.MapView(origin="/map", name="Map"), rrb.Spatial3DView(origin="/metres", name="Metres"))
    plots = [rrb.TimeSeriesView(origin=f"/curves/{curve}", name=name) for curve, name in CURVES.items()]
    plots += [rrb.TextLogView(origin="/happened", name="What happened")] if log else []
    layout = rrb.Vertical(maps, rrb.Horizontal(*plots), row_shares=[3, 1]) if curves else maps
    return rrb.Blueprint(layout, rrb.TimePanel(timeline=TIMELINE), collapse_panels=True)


def _site(stream: rr.RecordingStream, mission: Mission) -> None:
    for name, geometry, role in (
        ("operating", mission.site.operating, "operating"),
        ("areas", mission.site.area, "area"),
        ("obstacles", shapely.MultiPolygon([o.polygon for o in mission.site.obstacles]), "obstacle"),
    ):
        rings = _rings(geometry)
        if rings:
            _lines(stream, mission, f"site/{name}", rings, [_rgb(SITE[role])] * len(rings))
    tasks, hurt = mission.tasks, mission.casualties
    _points(stream, mission, "tasks", [t.position for t in tasks], [_rgb(TASK)] * len(tasks), [t.id for t in tasks])
    seen = [_rgb(CASUALTY[c.colour]) for c in hurt]
    _points(stream, mission, "casualties", [c.position for c in hurt], seen, [f"{c.id}, {c.colour}" for c in hurt])


def _layers(stream: rr.RecordingStream, mission: Mission, palette: Mapping[str, str]) -> None:
    """Log outlines, lines and points of the plan's layers, each in its own colour or its vehicle's."""
    for layer in drawn(mission):
        points, lines = [], []
        for shape, properties in zip(layer.geometries, layer.properties, strict=True):
            rgb = _rgb(properties.get("stroke") or palette.get(properties.get("vehicle", ""), TASK))
            for part in getattr(shape, "geoms", [shape]):
                if part.geom_type == "Point":
                    points.append(((part.x, part.y), rgb))
                else:
                    rings = (part.exterior, *part.interiors) if part.geom_type == "Polygon" else (part,)
                    lines += [(shapely.get_coordinates(ring), rgb) for ring in rings if not ring.is_empty]
        name = f"layers/{rr.escape_entity_path_part(layer.name)}"
        _points(stream, mission, name, [xy for xy, _ in points], [rgb for _, rgb in points])
        if lines:
            _lines(stream, mission, name, [xy for xy, _ in lines], [rgb for _, rgb in lines])


def _happened(stream: rr.RecordingStream, mission: Mission, moments: Sequence[Moment], palette: Mapping[str, str]) -> None:
    for number, moment in enumerate(moments):
        words, place = f"{moment.vehicle} {WORDS[moment.what]}", np.array([[moment.x, moment.y]])
        entity = f"{moment.what}/{rr.escape_entity_path_part(moment.vehicle)}/{number}"
        look: dict[str, Any] = {"colors": _rgb(palette[moment.vehicle]), "radii": rr.Radius.ui_points(9.0)}
        stream.log(f"metres/{entity}", rr.Points3D.from_fields(labels=words, **look), static=True)
        stream.log(f"map/{entity}", rr.GeoPoints.from_fields(**look), static=True)
        when = [rr.TimeColumn(TIMELINE, duration=[moment.time])]
        stream.send_columns(f"metres/{entity}", indexes=when, columns=rr.Points3D.columns(positions=_flat(place)))
        degrees = rr.GeoPoints.columns(positions=_lat_lon(mission, place))
        stream.send_columns(f"map/{entity}", indexes=when, columns=degrees)
    if moments:
        lines = [f"{clock(m.time)} {m.vehicle} {WORDS[m.what]}" for m in moments]
        levels = [rr.TextLogLevel.INFO if m.what == "told" else rr.TextLogLevel.WARN for m in moments]
        index = [rr.TimeColumn(TIMELINE, duration=[m.time for m in moments])]
        stream.send_columns("happened", indexes=index, columns=rr.TextLog.columns(text=lines, level=levels))


def _points(
    stream: rr.RecordingStream,
    mission: Mission,
    entity: str,
    places: Sequence[tuple[float, float]],
    rgb: Sequence[list[int]],
    labels: Sequence[str] | None = None,
) -> None:
    if places:
        xy, radius = np.array(places), rr.Radius.ui_points(5.0)
        stream.log(f"metres/{entity}", rr.Points3D(_flat(xy), colors=rgb, labels=labels, radii=radius), static=True)
        stream.log(f"map/{entity}", rr.GeoPoints(lat_lon=_lat_lon(mission, xy), colors=rgb, radii=radius), static=True)


def _lines(
    stream: rr.RecordingStream, mission: Mission, entity: str, lines: Sequence[np.ndarray], rgb: Sequence[list[int]]
) -> None:
    stream.log(f"metres/{entity}", rr.LineStrips3D([_flat(line) for line in lines], colors=rgb), static=True)
    degrees = [_lat_lon(mission, line) for line in lines]
    stream.log(f"map/{entity}", rr.GeoLineStrings(lat_lon=degrees, colors=rgb), static=True)


def _rgb(colour: str) -> list[int]:
    return [int(colour[n : n + 2], 16) for n in (1, 3, 5)]


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

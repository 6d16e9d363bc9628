"""Electronic navigational charts (S-57) to a site: where there is surely water enough, and what stands in it.

What is not known is dangerous: a depth area, rock, wreck or obstruction without a depth, and all that lies outside the
chart's coverage. Object classes and attributes: IHO S-57 edition 3.1, Appendix A. It is for planning, not for navigation:
what a chart does not show, a survey vessel finds.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.errors import ShapelyError
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.s57 import Layer, read_layers
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Vehicle, as_multipolygon

DEPTHS = ("DEPARE", "DRGARE")
LAND = ("LNDARE", "UNSARE", "FLODOC", "HULKES", "PONTON", "LOKBSN", "DRYDOC", "CAUSWY", "DAMCON")
DANGERS = ("OBSTRN", "WRECKS", "UWTROC")
SOLID = ("SLCONS", "MORFAC", "PILPNT", "OFSPLF", "FSHFAC", "MARCUL", "PYLONS", "LOGPON", "ICEARE", "OILBAR")
MARKS = ("BCN", "BOY")  # the classes that begin so
SPAN = 200_000.0  # m: as far as a site may reach from its centre
LEAST_PART = 100.0  # m2: smaller patches of water are no place to work


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell's objects: by class, the geometries (lon, lat) and each one's depth in metres below chart datum, nan unknown.

    `scale` is the denominator of the compilation scale, `update` the number of the last update that was applied.
    """

    name: str
    scale: float
    edition: str
    update: str
    objects: dict[str, tuple[tuple[BaseGeometry, float], ...]]


def read_cell(path: str | Path) -> Cell:
    """Return a cell from its .000 file, updates beside it (.001 and on) applied.

    Raises InputError if it is no S-57 cell or looks encrypted (S-63), UnavailableError without the extra `charts`.
    """
    if find_spec("pyogrio") is None:
        raise UnavailableError("reading charts needs pyogrio: pip install 'quarterdeck[charts]'")
    _check_leader(Path(path))
    layers = read_layers(path)
    head = layers["DSID"].fields
    objects = {name: _objects(name, layer) for name, layer in layers.items() if name != "DSID" and name.isupper()}
    scale = float(head["DSPM_CSCL"][0])
    return Cell(Path(path).name, scale if scale > 0 else float("inf"), head["DSID_EDTN"][0], head["DSID_UPDN"][0], objects)


def _check_leader(path: Path) -> None:
    """An ISO 8211 file begins with a record length of five digits and a leader identifier `L`."""
    try:
        with path.open("rb") as file:
            leader = file.read(24)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if leader[:5].isdigit() and leader[6:7] == b"L":
        return
    if leader and sum(32 <= byte < 127 or byte in b"\t\r\n" for byte in leader) < 0.8 * len(leader):
        raise InputError(f"{path}: looks encrypted (S-63); decrypt it with your permit first, we read open S-57 cells")
    raise InputError(f"{path}: is no S-57 cell; give the .000 file of an ENC")


def _objects(name: str, layer: Layer) -> tuple[tuple[BaseGeometry, float], ...]:
    wanted = {"SOUNDG": "DEPTH", "M_COVR": "CATCOV"}.get(name, "DRVAL1" if name in DEPTHS else "VALSOU")
    shapes = shapely.from_wkb(layer.geometries, on_invalid="ignore")  # None: damaged
    values = np.asarray(layer.fields.get(wanted, np.full(len(shapes), np.nan)), dtype=float)
    return tuple((g, float(v)) for g, v in zip(shapes, values, strict=True) if g is not None and not g.is_empty)


def chart_site(
    cells: Sequence[Cell],
    *,
    depth: float,
    margin: float = 10.0,
    avoid: Sequence[str] = (),
    bounds: tuple[float, float, float, float] | None = None,
    vehicles: Sequence[tuple[str, float, float]] = (),
) -> tuple[Scenario, tuple[str, ...]]:
    """Return the navigable water of the cells as a site, and what was used and ignored, a line each.

    `depth` is the water needed below chart datum in metres, `margin` the metres kept from dangers, `avoid` more classes
    that may not be entered (such as RESARE), `bounds` west, south, east, north degrees to cut to, `vehicles` (id, lon, lat)
    of surface vehicles' starts: only water that they can reach is kept. Where cells overlap, depths are those of the
    larger scale, dangers everybody's. Raises InputError if no water is known to be deep enough, or a start lies outside.
    """
    frame = _frame(cells, bounds)
    covered: BaseGeometry = Polygon()
    safe: list[BaseGeometry] = []
    notes: list[str] = []
    for cell in sorted(cells, key=lambda c: c.scale):
        cover, said = _coverage(cell, frame)
        water = _water(cell, frame, depth).intersection(cover).difference(covered)
        safe.append(water)
        covered = covered.union(cover)
        notes.append(f"{cell.name} (edition {cell.edition}, update {cell.update}, 1:{cell.scale:.0f}): {said}")
    water = unary_union(safe)
    if bounds is not None:
        box = shapely.segmentize(shapely.box(*bounds), 0.01)
        water = water.intersection(shapely.transform(box, frame.to_metres))
    used: Counter[str] = Counter()
    ignored: Counter[str] = Counter()
    dangers = [d for cell in cells for d in _dangers(cell, frame, depth, margin, tuple(avoid), used, ignored)]
    obstacles = unary_union(dangers)
    notes.append("used: " + (", ".join(f"{n} {c}" for c, n in sorted(used.items())) or "no dangers"))
    notes += [_absent(name, cells) for name in avoid if not any(cell.objects.get(name) for cell in cells)]
    notes.append("ignored: " + (", ".join(f"{n} {c}" for c, n in sorted(ignored.items())) or "nothing"))
    if water.is_empty:
        raise InputError(
            f"the chart knows no water of at least {depth:g} m; lessen --draught or --clearance, or allow for --tide"
        )
    starts = [(name, *frame.to_metres(np.array([[lon, lat]]))[0]) for name, lon, lat in vehicles]
    kept = _reachable(as_multipolygon(water), obstacles, starts, notes)
    parts = as_multipolygon(obstacles.intersection(kept.buffer(margin)))
    found = tuple(Obstacle(f"danger-{i}", p) for i, p in enumerate(sorted(parts.geoms, key=lambda p: p.bounds), 1))
    site = Site((Area("water", kept),), kept, found)
    spots = _spots(cells, frame, kept)
    notes.append(f"soundings: {len(spots)} in the water that is left, for the swath of a multibeam sonar")
    return Scenario("chart", frame, site, tuple(_vehicle(*s) for s in starts), soundings=spots), tuple(notes)


def _absent(name: str, cells: Sequence[Cell]) -> str:
    near = get_close_matches(name, sorted({n for cell in cells for n in cell.objects}), n=1)
    return f"avoided: there is no {name} in the chart" + (f"; did you mean {near[0]}?" if near else "")


def _spots(cells: Sequence[Cell], frame: Frame, water: BaseGeometry) -> tuple[tuple[float, float, float], ...]:
    """Return x, y and depth of all cells' SOUNDG spots in the water; where cells have the same one it is there once."""
    found = {
        (round(x, 2), round(y, 2), round(depth, 2))
        for cell in cells
        for shape, depth in cell.objects.get("SOUNDG", ())
        for x, y in shapely.get_coordinates(_metres(frame, shape)).tolist()
        if np.isfinite(depth)
    }
    return tuple(spot for spot in sorted(found) if water.covers(shapely.Point(spot[:2])))


def _frame(cells: Sequence[Cell], bounds: tuple[float, float, float, float] | None) -> Frame:
    shapes = [g for cell in cells for name in ("M_COVR", *DEPTHS) for g, _ in cell.objects.get(name, ())]
    if not any(cell.objects.get(name) for cell in cells for name in DEPTHS):
        names = ", ".join(cell.name for cell in cells)
        raise InputError(f"{names}: no depth areas (DEPARE, DRGARE) with a shape, so no water is known; give another cell")
    west, south, east, north = bounds or shapely.total_bounds(shapes)
    if not (-180 <= west <= east <= 180 and -90 <= south <= north <= 90):
        raise InputError(f"{', '.join(cell.name for cell in cells)}: reaches beyond the earth's degrees; get the cell anew")
    frame = Frame(float(west + east) / 2, float(south + north) / 2)
    reach = np.hypot(*frame.to_metres(np.array([[west, south], [east, north]])).T).max()
    if reach > SPAN:
        raise InputError(
            f"the cells reach {reach / 1000:.0f} km from their centre; cut them with --bounds WEST,SOUTH,EAST,NORTH"
        )
    return frame


def _metres(frame: Frame, geometry: BaseGeometry) -> BaseGeometry:
    try:
        return shapely.make_valid(shapely.transform(shapely.force_2d(geometry), frame.to_metres))
    except ShapelyError as error:
        raise InputError(f"the chart has a damaged {geometry.geom_type} ({error}); get the cell anew") from None


def _polygons(geometry: BaseGeometry) -> bool:
    return geometry.geom_type in ("Polygon", "MultiPolygon")


def _coverage(cell: Cell, frame: Frame) -> tuple[BaseGeometry, str]:
    areas = [_metres(frame, g) for g, category in cell.objects.get("M_COVR", ()) if category == 1 and _polygons(g)]
    if areas:
        return unary_union(areas), "coverage by M_COVR, outside it is unknown"
    group = [_metres(frame, g) for name in (*DEPTHS, "LNDARE") for g, _ in cell.objects.get(name, ()) if _polygons(g)]
    return unary_union(group), "no M_COVR: what its depth and land areas cover, the rest is unknown"


def _water(cell: Cell, frame: Frame, depth: float) -> BaseGeometry:
    areas = [(_metres(frame, g), d) for name in DEPTHS for g, d in cell.objects.get(name, ()) if _polygons(g)]
    deep = unary_union([g for g, d in areas if d >= depth])
    shallow = [g for g, d in areas if not d >= depth]
    land = [_metres(frame, g) for name in LAND for g, _ in cell.objects.get(name, ()) if _polygons(g)]
    return deep.difference(unary_union([*shallow, *land]))


def _dangers(
    cell: Cell,
    frame: Frame,
    depth: float,
    margin: float,
    avoid: tuple[str, ...],
    used: Counter[str],
    ignored: Counter[str],
) -> list[BaseGeometry]:
    found = []
    for name, objects in cell.objects.items():
        if name in DEPTHS or name == "M_COVR":
            used[name] += len(objects)
            continue
        solid = name in LAND or name in SOLID or name.startswith(MARKS) or name in avoid
        for geometry, known in objects:
            shoal = (name in DANGERS or name == "SOUNDG") and not known >= depth  # unknown is dangerous
            if not (solid or shoal):
                ignored[name] += 1
                continue
            used[name] += 1
            found.append(_metres(frame, geometry).buffer(margin, quad_segs=4))
    return found


def _reachable(
    water: MultiPolygon, obstacles: BaseGeometry, starts: list[tuple[str, float, float]], notes: list[str]
) -> MultiPolygon:
    """The parts of the water where vehicles start, or all that are large enough to work in."""
    parts = [p for p in water.geoms if p.area >= LEAST_PART]
    if not starts:
        return MultiPolygon(parts)
    free = [p for p in as_multipolygon(water.difference(obstacles)).geoms if p.area >= LEAST_PART]
    for name, x, y in starts:
        away = min((p.distance(shapely.Point(x, y)) for p in free), default=float("inf"))
        if away > 0:
            raise InputError(
                f"{name} starts {away:,.0f} m from the nearest water that is safe; move it, or give the cell it is in"
            )
    points = [shapely.Point(x, y) for _, x, y in starts]
    kept = [p for p in parts if any(p.intersects(point) for point in points)]
    if len(kept) < len(parts):
        notes.append(f"{len(parts) - len(kept)} parts of the water that no vehicle can reach were left out")
    return MultiPolygon(kept)


def _vehicle(name: str, x: float, y: float) -> Vehicle:
    from quarterdeck.geo.models import DEFAULT_MODEL, load_model

    model = load_model(DEFAULT_MODEL["surface"])
    return Vehicle(
        name, model, (float(x), float(y)), speed=model.speed, turn_radius=model.turn_radius, clearance=model.clearance,
        battery=model.battery,
    )  # fmt: skip

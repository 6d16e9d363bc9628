"""A mission's layers as a PLAN and a picture have them: those for the eye, and those that replanning starts from."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from shapely import LineString, Point

from quarterdeck.geo.palette import colours_of
from quarterdeck.mission.mission import Guard, Layer, Mission

LEFT_OUT = {"stroke": "#d62728"}
SURVEYED = {"stroke": "#999999", "stroke-width": 1}


def drawn(mission: Mission) -> tuple[Layer, ...]:
    """Return all layers of a mission, its guards and lines among them."""
    guards = [
        {"guard": i, "range": g.range, "vehicle": g.vehicle, "turn": g.turn, "seen": g.seen}
        for i, g in enumerate(mission.guards)
    ]
    kept = (
        Layer("guards", tuple(Point(g.x, g.y) for g in mission.guards), tuple(guards)),
        Layer("left out", mission.left_out, (LEFT_OUT,) * len(mission.left_out)),
        *mission.layers,
        Layer("surveyed", mission.surveyed, (SURVEYED,) * len(mission.surveyed)),
    )
    return tuple(layer for layer in kept if layer.geometries)


def left_undone(mission: Mission) -> Mission:
    """Return the mission with no layers but those of what it leaves undone."""
    return replace(mission, guards=(), surveyed=(), layers=tuple(x for x in mission.layers if x.name == "undone"))


def fleet_colours(mission: Mission) -> dict[str, str]:
    """Return each vehicle's colour by its id; those who were given up have theirs, so that the others keep their own."""
    ids = [v.id for v in (*mission.vehicles, *mission.lost)] + [r.vehicle for r in mission.routes]
    return colours_of(ids, casualties=bool(mission.casualties))


def undrawn(layers: Mapping[str, Sequence[tuple[Any, Mapping[str, Any]]]]) -> dict[str, Any]:
    """Return the fields of a mission that `layers`, by name each shape in metres with its properties, were drawn from.

    Raises TypeError, ValueError or KeyError where they were not drawn so.
    """
    guards = []
    for i, (place, p) in enumerate(layers.get("guards", ())):
        if p["guard"] != i or not isinstance(place, Point) or place.is_empty:
            raise ValueError("a guard is not what it must be")
        guards.append(Guard(place.x, place.y, p["range"], p["vehicle"], p["turn"], p["seen"]))
    lines = {name: tuple(line for line, _ in layers.get(name, ())) for name in ("left out", "surveyed")}
    if not all(isinstance(line, LineString) and not line.is_empty for own in lines.values() for line in own):
        raise TypeError("its survey lines are not what they must be")
    return {
        "guards": tuple(guards),
        "left_out": lines["left out"],
        "surveyed": lines["surveyed"],
        "layers": tuple(
            Layer(name, tuple(shape for shape, _ in items), tuple(p for _, p in items))
            for name, items in layers.items()
            if name not in ("guards", *lines)
        ),
    }

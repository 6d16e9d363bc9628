"""Who waits where at a rendezvous, with bodies: UGVs on a ring, UAVs in its middle with nobody below, and the rendezvous
itself, where persons stand, in a gap of the ring.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.mission.triage.records import XY

_APART = 4.2  # lengths between UGVs that wait side by side, so that one passes between two others
_CLEAR = 1.2  # m on the plan between a UAV and a person at the rendezvous: two bodies, and how far it may drift
_ABREAST = 0.9  # m on the plan between two UAVs, where they hover
_HEARD = 0.2  # m by which all who wait are nearer to each UAV than it is heard
_TURNS = (0, 1, -1, 2, -2, 3, -3, 4)  # eighths by which the ring is turned where something is in its way


class Berths(NamedTuple):
    """Metres east and north: `middle` of the ring from the rendezvous, then each UGV's and each UAV's place from it."""

    middle: XY
    ugvs: Sequence[XY]
    uavs: Sequence[XY]


def berths(
    site: Site,
    ground: MultiPolygon,
    ugvs: Sequence[Vehicle],
    paths: Sequence[np.ndarray],
    uavs: Sequence[Vehicle],
    homes: Sequence[Sequence[tuple[float, XY]]],
    talk: float,
) -> Berths:
    """Return the places of UGVs that search along `paths`, each near its section, and of UAVs whose rendezvous are `homes`.

    `ground` is where UGVs may be, `talk` how far one is heard, metres. What is tried first is taken, but where it is in
    an obstacle or outside the site, what is least so.
    """
    places = np.array(sorted({xy for home in homes for _, xy in home}))
    sky = site.navigable("aerial", max(u.model.length for u in uavs))

    def off(found: Berths) -> float:
        aloft, below = (
            shapely.points((places[:, None] + found.middle + np.array(who)).reshape(-1, 2))
            for who in (found.uavs, found.ugvs)
        )
        return float(sum(shapely.distance(a, b).sum() for a, b in ((ground, aloft), (ground, below), (sky, aloft))))

    tried: list[tuple[float, Berths]] = []
    for found in _ways_to_stand(ugvs, paths, places[0], homes, talk):
        tried.append((off(found), found))
        if tried[-1][0] < 1e-6:
            return found
    return min(tried, key=lambda t: t[0])[1]


def _ways_to_stand(
    ugvs: Sequence[Vehicle],
    paths: Sequence[np.ndarray],
    rendezvous: np.ndarray,
    homes: Sequence[Sequence[tuple[float, XY]]],
    talk: float,
) -> Iterator[Berths]:
    count, seats = len(ugvs), max(len(ugvs), 2)
    heard = max(talk - _HEARD, talk / 2)
    room = heard - _ABREAST / 2 * any(homes.count(h) > 1 for h in homes)
    radius = min(_APART * max(u.model.length for u in ugvs) / (2 * np.sin(np.pi / seats)), max(room, heard / 2))
    away = np.array([p.mean(axis=0) for p in paths]) - rendezvous
    wanted = np.arctan2(away[:, 1], away[:, 0])
    even = np.empty(count)
    even[np.argsort(wanted, kind="stable")] = 2 * np.pi * np.arange(count) / seats
    angles = even + np.angle(np.exp(1j * (wanted - even)).mean())
    for turn, angle in product(_TURNS, angles):
        ring = radius * _towards(angles + turn * np.pi / 4)
        gap = _towards(angle + turn * np.pi / 4 + np.pi / seats)
        rows = [_in_line(homes, line, ring, heard) for line in (gap @ [[0, 1], [-1, 0]], gap)]
        hover = max(rows, key=lambda row: np.linalg.norm(row[:, None] - ring, axis=-1).min())
        middle = -(min(_CLEAR, heard) + (hover @ gap).max()) * gap
        yield Berths(_xy(middle), [_xy(p) for p in ring], [_xy(p) for p in hover])


def _towards(angle: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _in_line(homes: Sequence[Sequence[tuple[float, XY]]], line: np.ndarray, ring: np.ndarray, heard: float) -> np.ndarray:
    """Return (k, 2) how far from the middle UAVs hover: those of a rendezvous in a line, all UGVs within `heard`."""
    along = np.abs(ring @ line)
    room = max(0.0, float((np.sqrt(np.maximum(heard**2 - (ring**2).sum(axis=1), 0.0) + along**2) - along).min()))
    places = []
    for i, home in enumerate(homes):
        before, others = homes[:i].count(home), homes.count(home) - 1
        places.append((before - others / 2) * min(_ABREAST, 2 * room / max(others, 1)))
    return np.outer(places, line)


def _xy(point: np.ndarray) -> XY:
    return float(point[0]), float(point[1])

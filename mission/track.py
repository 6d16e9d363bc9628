"""A vehicle's track: where it was and when, when it set off and when it had come home."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Route

NEAR = 4.0  # lengths: so near its start or end a vehicle is there
MOMENT, CREEP = 5.0, 0.03  # s, m: who moves less in that time, but for the receiver's noise, is at rest


@dataclass(frozen=True, slots=True)
class Track:
    """Where a vehicle was. Arrays are (n,), in the order of `time`, seconds since the mission's start.

    `x`, `y`, `z` metres in the frame, z above where it was launched; `heading` radians counter-clockwise from east, `speed`
    m/s, `energy` Wh used since the mission's start: NaN where the log does not say. `broken`: how it came there from the
    place before is not known. `arrived` is when it had come home for good, inf if it never did.
    """

    vehicle: str
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    energy: np.ndarray
    broken: np.ndarray
    arrived: float = float("inf")

    @property
    def xy(self) -> np.ndarray:
        """(n, 2) metres."""
        return np.column_stack([self.x, self.y])


def since(track: Track, zero: float) -> Track:
    """Return a track on the mission's clock from its start on, heights and energy counted from there."""
    first = max(int(np.searchsorted(track.time, zero, side="right")) - 1, 0)  # the last place before the start is kept
    cut = {n: getattr(track, n)[first:] for n in ("x", "y", "z", "heading", "speed", "energy", "broken")}
    for name in ("z", "energy"):
        known = np.flatnonzero(np.isfinite(cut[name]))
        cut[name] = cut[name] - cut[name][known[0]] if len(known) else cut[name]
    return Track(track.vehicle, np.maximum(track.time[first:] - zero, 0.0), **cut)


def until_home(vehicle: Vehicle, route: Route, track: Track) -> Track:
    """Return a track with the time at which the vehicle had come to its route's end for good, and nothing after it."""
    if not route.waypoints:
        return track
    end = route.xyz[-1, :2]
    there = np.hypot(track.x - end[0], track.y - end[1]) <= NEAR * vehicle.model.length
    if not there[-1] or there.all():
        return track
    first = len(there) - int(np.argmin(there[::-1]))
    arrived = at_rest(track, slice(first, len(there)), last=False)
    stays = track.time <= arrived
    cut = {n: getattr(track, n)[stays] for n in ("time", "x", "y", "z", "heading", "speed", "energy", "broken")}
    return Track(track.vehicle, **cut, arrived=arrived)


def set_off(vehicle: Vehicle, track: Track) -> float:
    """Return when the vehicle first left its start; where it never was there, when its track begins."""
    near = np.hypot(track.x - vehicle.start[0], track.y - vehicle.start[1]) <= NEAR * vehicle.model.length
    if not near.any():
        return float(track.time[0])
    first = int(np.argmax(near))
    out = first + int(np.argmin(np.r_[near[first:], False]))  # the first after it that is not near
    return at_rest(track, slice(first, out), last=True)


def at_rest(track: Track, stay: slice, *, last: bool) -> float:
    """Return when in a stay the vehicle was last at rest, or first to stay so to its end; its border if it never was.

    Where positions scatter, by their second differences, means over MOMENT are looked at, and as much scatter is no motion.
    """
    xyz, time = np.column_stack([track.x, track.y, np.nan_to_num(track.z)])[stay], track.time[stay]
    if last:  # seen backwards, it is to come to rest
        xyz, time = xyz[::-1], -time[::-1]
    bend = np.diff(xyz[:, :2], n=2, axis=0)
    scatter = 1.5 * float(np.median(np.abs(bend))) / np.sqrt(6.0) if len(bend) else 0.0
    if scatter > CREEP:
        count = min(max(3, round(MOMENT / float(np.median(np.diff(time))))), len(time))
        xyz = uniform_filter1d(xyz, count, axis=0, mode="nearest")
        scatter *= np.sqrt(2.0 / count)
    later = np.minimum(np.searchsorted(time, time + MOMENT), len(time) - 1)
    moving = np.flatnonzero(np.linalg.norm(xyz[later] - xyz, axis=1) >= CREEP + 6.0 * scatter)
    at = min(int(moving[-1]) + 1, len(time) - 1) if len(moving) else 0
    return -float(time[at]) if last else float(time[at])


def pace(track: Track) -> np.ndarray:
    """Return (n,) speeds in m/s: as logged, or else over MOMENT."""
    sure = np.isfinite(track.speed)
    if sure.any():
        return np.interp(track.time, track.time[sure], track.speed[sure])
    before, after = track.time - MOMENT / 2, track.time + MOMENT / 2
    x, y = (np.interp(after, track.time, a) - np.interp(before, track.time, a) for a in (track.x, track.y))
    return np.hypot(x, y) / np.maximum(np.minimum(after, track.time[-1]) - np.maximum(before, track.time[0]), 1e-9)


def energy_used(vehicle: Vehicle, track: Track) -> np.ndarray:
    """Return (n,) Wh used since the mission's start: as logged, or else what the model draws at its pace."""
    sure = np.isfinite(track.energy)
    if sure.any():
        return np.interp(track.time, track.time[sure], track.energy[sure])
    power = vehicle.model.power(pace(track))
    return np.r_[0.0, np.cumsum(power[1:] * np.diff(track.time))] / 3600.0

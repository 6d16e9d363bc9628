"""Guidance: from where a vehicle is and its path to what its controllers are to hold.

Vessels: integral line of sight (Borhaug, Pavlov & Pettersen 2008; Fossen 2021, section 12.5) on the velocity over
ground, the drift by current and wind taken off the course; turns begin at the wheel-over point. Ground: pure pursuit
(Coulter 1992), corners turned on the spot. Aerial: a reference point that runs along the path within speed,
acceleration and climb limits.
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.physics.braking import LOOK
from quarterdeck.physics.legs import (
    CORNER,
    SIDEWAYS,
    arrive,
    corner,
    depart,
    keep_aside,
    leg_of,
    step_aside,
    stops,
    to_stop,
    wrapped,
)
from quarterdeck.physics.paths import HOLD, IDLE, ROTATE, SAIL

ARRIVED = 1.0  # m: a vessel this near its waypoint has reached it
CUT = 0.3  # m: how far inside a corner a multirotor may pass


@njit(cache=True)
def guide_vessels(
    time: float,
    step: float,
    pose: np.ndarray,
    velocity: np.ndarray,
    rate: np.ndarray,
    limits: np.ndarray,
    tracks: np.ndarray,
    table: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
) -> None:
    """Set `heading` (k,) radians and `speed` (k,) m/s through the water; tracks move on to their next legs.

    `pose` (k, 3) x, y, heading and `velocity` (k, 2) over ground as known to the vehicles, (k, 2) ahead and to port
    through the water in `velocity`'s columns 2 and 3; `rate` (k,) of turn; `step` is seconds since the last call.
    """
    for i in range(len(tracks)):
        t, lim = tracks[i], limits[i]
        x, y, psi = pose[i, 0], pose[i, 1], pose[i, 2]
        _observe_drift(t, psi, velocity[i], rate[i], step)
        ground, before = np.hypot(velocity[i, 0], velocity[i, 1]), t.leg
        if t.mode == HOLD and time >= t.until:
            depart(t)
        if t.mode == SAIL:
            _, _, length, along, _ = leg_of(t, table, x, y)
            remaining = length - along
            stop = stops(t, table, time)
            if stop and (remaining <= ARRIVED):
                arrive(t, table, time)
            elif not stop and remaining <= _wheel_over(t, table, lim, max(ground, 0.3), length):
                t.leg += 1
                t.integral = 0.0
        if t.leg != before:
            keep_aside(t, table, x, y)
        if t.mode == SAIL:
            tx, ty, length, along, cross = leg_of(t, table, x, y)
            remaining = length - along
            wanted = min(table[t.leg].speed, max(t.slow, 0.0))
            if stops(t, table, time):
                wanted = min(wanted, max(np.sqrt(2 * 0.5 * lim.accel * max(remaining - ARRIVED / 2, 0.0)), 0.2))
            step_aside(t, lim.speed, step)
            ahead = max(2.5 * lim.length, 1.5 * lim.speed)
            t.cross, t.turning = cross, along < lim.zone or remaining < lim.zone or t.aside != 0
            cross += t.aside
            kappa = 0.05 * lim.speed
            if abs(cross) < 2 * ahead and wanted > 0.1:
                t.integral += step * ahead * cross / (ahead**2 + (cross + kappa * t.integral) ** 2)
            course = np.arctan2(ty, tx) - np.arctan2(cross + kappa * t.integral, ahead)
            wx, wy = wanted * np.cos(course) - t.driftx, wanted * np.sin(course) - t.drifty
        else:
            course = psi
            px, py = table[t.leg].x - x, table[t.leg].y - y
            away = np.hypot(px, py)
            gain = min(0.15, 0.5 / max(away, 1e-9))
            wx, wy = gain * px - t.driftx, gain * py - t.drifty
            t.cross, t.turning = 0.0, True
            if away < ARRIVED and np.hypot(wx, wy) < 0.2:  # near enough in slack water: rest
                heading[i], speed[i] = psi, 0.0
                continue
        if t.mode == SAIL and t.slow < 0.0:  # astern
            heading[i], speed[i] = psi, t.slow
            continue
        if np.hypot(wx, wy) < 0.1:
            heading[i], speed[i] = course if t.mode == SAIL else psi, 0.0
            continue
        heading[i] = np.arctan2(wy, wx)
        # Without way on it turns on the spot, until it faces where it is to go.
        if t.mode == SAIL and (ground < 0.3 or speed[i] == 0.0) and abs(wrapped(heading[i] - psi)) > 1.0:
            speed[i] = 0.0
            continue
        # Far off its heading it slows down, to as little as half: the turn is the tighter.
        ease = min(max(1.5 - 0.625 * abs(wrapped(heading[i] - psi)), 0.5), 1.0)
        speed[i] = min(np.hypot(wx, wy), lim.max_speed) * ease


@njit(cache=True)
def guide_rovers(
    time: float,
    step: float,
    pose: np.ndarray,
    velocity: np.ndarray,
    limits: np.ndarray,
    tracks: np.ndarray,
    table: np.ndarray,
    speed: np.ndarray,
    turn: np.ndarray,
) -> None:
    """Set `speed` (k,) m/s and `turn` (k,) rad/s; `pose` (k, 3) x, y, heading, `velocity` (k,) m/s as known to the
    vehicles.
    """
    for i in range(len(tracks)):
        t, lim = tracks[i], limits[i]
        x, y, psi, before = pose[i, 0], pose[i, 1], pose[i, 2], t.leg
        if t.mode == HOLD and time >= t.until:
            depart(t)
            if t.mode == SAIL:
                t.mode = ROTATE
        near = 0.03 + 0.02 * lim.speed
        if t.mode == SAIL:
            _, _, length, along, _ = leg_of(t, table, x, y)
            if stops(t, table, time):
                if length - along <= near:
                    arrive(t, table, time)
            elif abs(corner(t, table)) > CORNER:
                if length - along <= near:
                    t.leg += 1
                    t.mode = ROTATE
            elif length - along <= 0:
                t.leg += 1
        if t.leg != before:
            keep_aside(t, table, x, y)
        speed[i] = turn[i] = 0.0
        if t.mode == HOLD or t.mode == IDLE:
            t.cross, t.turning = 0.0, True
            continue
        tx, ty, length, along, cross = leg_of(t, table, x, y)
        step_aside(t, lim.speed, step)
        t.cross, t.turning = cross, along < lim.zone or length - along < lim.zone or t.aside != 0
        cross += t.aside
        if t.slow < 0.0:  # astern
            speed[i] = t.slow
            continue
        if t.mode == ROTATE:
            error = wrapped(np.arctan2(ty, tx) - psi)
            if abs(error) < 0.02 or length < near:
                t.mode = SAIL
            else:
                turn[i] = min(max(3.0 * error, -lim.rate), lim.rate)
                continue
        wanted = min(table[t.leg].speed, t.slow)
        rest = to_stop(t, table, time, length - along, velocity[i] ** 2 / lim.accel)
        wanted = min(wanted, _rover_nearing(lim.accel, max(rest - near, 0.0)))
        ahead = max(0.5 * lim.length, 0.8 * abs(velocity[i]))
        bearing = wrapped(np.arctan2(ty * ahead - tx * cross, tx * ahead + ty * cross) - psi + t.bias)
        if abs(bearing) > (1.0 if t.slow > 0.0 else 0.1):  # pushed off its path, or held: face it first
            turn[i] = min(max(2.0 * bearing, -lim.rate), lim.rate)
            continue
        speed[i] = wanted
        turn[i] = min(max(2 * wanted * np.sin(bearing) / ahead, -lim.rate), lim.rate)


@njit(cache=True)
def nearing_rovers(limits: np.ndarray, tracks: np.ndarray, table: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return (k,) m/s that rovers, `rest` (k,) metres from the ends of their legs, go at most if they stop there."""
    speed = np.full(len(tracks), np.inf)
    for i in range(len(tracks)):
        t = tracks[i]
        if t.leg >= t.last or table[t.leg].hold > 0 or abs(corner(t, table)) > CORNER:
            speed[i] = _rover_nearing(limits[i].accel, rest[i])
    return speed


@njit(cache=True)
def _rover_nearing(accel: float, rest: float) -> float:
    """Return the speed, m/s, from which a rover comes to a stop within `rest` metres, with something to spare."""
    return max(np.sqrt(2 * 0.7 * accel * rest), 0.05)


@njit(cache=True)
def guide_multirotors(
    time: float,
    step: float,
    position: np.ndarray,
    limits: np.ndarray,
    tracks: np.ndarray,
    table: np.ndarray,
    reference: np.ndarray,
) -> None:
    """Set `reference` (k, 7): position, velocity, heading; `position` (k, 3) as known to the vehicles. `reach` is
    metres along the leg.
    """
    for i in range(len(tracks)):
        t, lim, ref = tracks[i], limits[i], reference[i]
        if t.mode == HOLD and time >= t.until:
            depart(t)
            t.reach = t.pace = 0.0
        if t.mode == SAIL:
            _run_along(t, lim, table, ref, position[i], time, step)
        if t.mode == SAIL:
            _refer(t, lim, table, ref, position[i], step)
        else:
            b = table[t.leg]
            ref[0], ref[1], ref[2] = b.x, b.y, b.z
            ref[3] = ref[4] = ref[5] = 0.0
            t.cross, t.turning = 0.0, True


@njit(cache=True)
def _run_along(
    t: Any, lim: Any, table: np.ndarray, ref: np.ndarray, position: np.ndarray, time: float, step: float
) -> None:
    """Let the reference run on along its leg within the limits, and onto the next one at its end.

    How far the vehicle at `position` (3,) trails its reference `ref` (7,) holds that back.
    """
    b = table[t.leg]
    _, _, dz, length = _way_of(t, table)
    gap = np.sqrt((ref[0] - position[0]) ** 2 + (ref[1] - position[1]) ** 2 + (ref[2] - position[2]) ** 2)
    wanted = min(b.speed, max(t.slow, 0.0)) * min(max(2.0 - gap / 2.0, 0.0), 1.0)
    if t.slow < 0.5 * b.speed and t.aside != t.want:  # first out of the other's way
        wanted = 0.0
    rate = lim.climb if dz > 0 else lim.sink
    if length > 0 and abs(dz) / length * wanted > rate:
        wanted = rate * length / abs(dz)
    leave = 0.0 if stops(t, table, time) else _corner_speed(t, table, lim.accel)
    wanted = min(wanted, np.sqrt(leave**2 + 2 * 0.7 * lim.accel * max(length - t.reach, 0.0)))
    t.pace = min(max(wanted, t.pace - lim.accel * step), t.pace + 0.7 * lim.accel * step)
    t.reach += max(t.pace, min(0.05, wanted)) * step
    if t.slow < 0.0:  # astern
        t.pace, t.reach = 0.0, max(t.reach + t.slow * step, 0.0)
    if t.reach < length:
        return
    if stops(t, table, time):
        t.reach, t.pace = length, 0.0
        if gap < 0.5 and abs(t.aside) < 0.2 * lim.length:  # back on its path
            arrive(t, table, time)
        return
    t.reach -= length
    t.leg += 1
    dx, dy, _, _ = _way_of(t, table)
    if t.aside != 0.0 and np.hypot(dx, dy) > 0.1:  # it stays where it is, to starboard of another leg
        turn = np.arctan2(dy, dx) - ref[6]
        t.reach -= t.aside * np.sin(turn)
        t.aside *= np.cos(turn)


@njit(cache=True)
def _refer(t: Any, lim: Any, table: np.ndarray, ref: np.ndarray, position: np.ndarray, step: float) -> None:
    """Set the reference `ref` (7,) to where the track has come to on its leg, and as far aside as is wanted."""
    a, b = table[max(t.leg - 1, t.first)], table[t.leg]
    dx, dy, dz, length = _way_of(t, table)
    s, v = (min(t.reach, length) / length, t.pace / length) if length > 0 else (1.0, 0.0)
    ref[0], ref[1], ref[2] = a.x + s * dx, a.y + s * dy, a.z + s * dz
    ref[3], ref[4], ref[5] = v * dx, v * dy, v * dz
    if np.hypot(dx, dy) > 0.1:
        ref[6] = np.arctan2(dy, dx)
    before, sin, cos = t.aside, np.sin(ref[6]), np.cos(ref[6])
    # Here the shift is the motion: no faster than it gains in a look, and can stop.
    most = min(LOOK * lim.accel, np.sqrt(lim.accel * abs(t.want - t.aside))) / SIDEWAYS
    step_aside(t, min(b.speed, max(t.slow, 0.0), most), step)
    shift = (t.aside - before) / step
    ref[0] += t.aside * sin
    ref[1] -= t.aside * cos
    ref[3] += shift * sin
    ref[4] -= shift * cos
    px, py, pz = position[0] - a.x, position[1] - a.y, position[2] - a.z
    along = (px * dx + py * dy + pz * dz) / max(length, 1e-9)
    t.cross = np.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))
    t.turning = along < lim.zone or length - along < lim.zone or t.aside != 0


@njit(cache=True)
def _way_of(t: Any, table: np.ndarray) -> tuple[float, float, float, float]:
    """Return how far the leg goes in x, y and z, and its length, metres."""
    a, b = table[max(t.leg - 1, t.first)], table[t.leg]
    dx, dy, dz = b.x - a.x, b.y - a.y, b.z - a.z
    return dx, dy, dz, np.sqrt(dx * dx + dy * dy + dz * dz)


@njit(cache=True)
def _observe_drift(t: Any, psi: float, velocity: np.ndarray, rate: float, step: float) -> None:
    """Track what the water and the wind add to the course steered; in turns the hull slips, so it is left as it was."""
    if abs(rate) > 0.08:
        return
    cos, sin = np.cos(psi), np.sin(psi)
    gain = step / 5.0
    t.driftx += gain * (velocity[0] - cos * velocity[2] - t.driftx)
    t.drifty += gain * (velocity[1] - sin * velocity[2] - t.drifty)


@njit(cache=True)
def _wheel_over(t: Any, table: np.ndarray, lim: Any, ground: float, length: float) -> float:
    """Return how far before the waypoint the turn begins: that of a circle touching both legs, and the time to swing."""
    half = abs(corner(t, table)) / 2
    radius = max(ground / lim.rate, lim.radius * ground / lim.speed)
    turn = radius * min(np.tan(min(half, 1.5)), 2.0) + 0.5 * ground * min(2 * half, 1.0)
    b, c = table[t.leg], table[t.leg + 1]
    return min(turn, 0.5 * length, 0.5 * np.hypot(c.x - b.x, c.y - b.y))


@njit(cache=True)
def _corner_speed(t: Any, table: np.ndarray, accel: float) -> float:
    """Return the speed at which the corner can be rounded within CUT metres of it at the acceleration limit."""
    a, b, c = table[max(t.leg - 1, t.first)], table[t.leg], table[min(t.leg + 1, t.last)]
    px, py, pz, qx, qy, qz = b.x - a.x, b.y - a.y, b.z - a.z, c.x - b.x, c.y - b.y, c.z - b.z
    size = np.sqrt((px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz))
    if size < 1e-12:
        return 0.0
    half = np.arccos(min(max((px * qx + py * qy + pz * qz) / size, -1.0), 1.0)) / 2
    if half > 1.3:  # about back: stop
        return 0.0
    return np.sqrt(accel * CUT / max(1 / np.cos(half) - 1, 1e-6))

"""What goes wrong in a run, and when: vehicles lost, GNSS lost, a thruster at half power, nobody heard."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.mission import world

KINDS = {
    "lost": "no power from then on: a vessel drifts, a rover stands, a multirotor falls",
    "gnss": "no position fixes",
    "thruster": "one actuator at half power: the port propeller, the left wheels, one rotor",
    "comms": "neither heard nor told anything new",
}
# With one actuator at half power, the part of a vehicle's speed along a survey: see tests/physics/test_recovered.py.
HALF_POWER = {"ground": 0.57, "surface": 0.93}
FAILURE = re.compile(r"(?:(?P<kind>[a-z]+):)?(?P<vehicle>.+)@(?P<start>[0-9.]+)(?:-(?P<end>[0-9.]+))?")


@dataclass(frozen=True, slots=True)
class Fault:
    """One of KINDS that befalls `vehicle` at `start` and is over at `end`, seconds since the mission's start."""

    kind: str
    vehicle: str
    start: float
    end: float = math.inf

    def __str__(self) -> str:
        """Return it as `parse_fault` reads it."""
        kind = "" if self.kind == "lost" else f"{self.kind}:"
        return f"{kind}{self.vehicle}@{self.start:g}" + (f"-{self.end:g}" if math.isfinite(self.end) else "")


def in_fast_world(faults: Sequence[Fault], domains: Mapping[str, str]) -> list[world.Fault]:
    """Return the faults as the fast world knows them, of vehicles of these `domains`: all but of position fixes.

    Who has an actuator at half power is slower by what was measured in PyBullet (HALF_POWER); a multirotor falls.
    """
    found = []
    for f in faults:
        pace = HALF_POWER.get(domains[f.vehicle])
        if f.kind == "lost" or (f.kind == "thruster" and pace is None):
            found.append(world.Fault(f.vehicle, f.start))
        elif f.kind == "comms":
            found.append(world.Fault(f.vehicle, f.start, "mute", f.end))
        elif f.kind == "thruster" and pace is not None:
            found.append(world.Fault(f.vehicle, f.start, "slow", f.end, pace))
    return found


def read_faults(texts: Sequence[str], vehicles: Sequence[str], duration: float, seed: int) -> tuple[Fault, ...]:
    """Return the faults that `texts` tell of, in order of time; `random:N` draws N of them within `duration` seconds.

    Raises InputError for what cannot be read and for a vehicle that is not among `vehicles`.
    """
    faults: list[Fault] = []
    for text in texts:
        if text.startswith("random:") and "@" not in text:
            count = text.removeprefix("random:")
            if not count.isdecimal() or int(count) > 10_000:
                raise InputError(f"fault {text!r}: expected random:N with a whole number, such as random:3")
            faults += draw(int(count), vehicles, duration, seed)
        else:
            faults.append(parse_fault(text, vehicles))
    return tuple(sorted(faults, key=lambda f: (f.start, f.vehicle, f.kind)))


def parse_fault(text: str, vehicles: Sequence[str]) -> Fault:
    """Return the fault in `[KIND:]VEHICLE@START[-END]`, such as usv-2@600 or gnss:usv-1@300-420.

    Raises InputError as `read_faults` does.
    """
    match = FAILURE.fullmatch(text.strip())
    if not match:
        raise InputError(
            f"fault {text!r}: expected [KIND:]VEHICLE@SECONDS[-SECONDS], such as usv-2@600 or gnss:usv-1@300-420"
        )
    kind, vehicle = match["kind"] or "lost", match["vehicle"]
    if match["kind"] and f"{kind}:{vehicle}" in vehicles:  # an id with a colon
        kind, vehicle = "lost", f"{kind}:{vehicle}"
    if kind not in KINDS:
        near = get_close_matches(kind, KINDS, n=1)
        raise InputError(f"fault {text!r}: unknown kind {kind!r}; {_hint(near, KINDS)}")
    if vehicle not in vehicles:
        near = get_close_matches(vehicle, vehicles, n=1)
        raise InputError(f"fault {text!r}: the plan has no vehicle {vehicle!r}; {_hint(near, vehicles)}")
    try:
        start, end = float(match["start"]), float(match["end"] or math.inf)
    except ValueError:
        raise InputError(f"fault {text!r}: times must be seconds, such as 600 or 300-420") from None
    if end <= start:
        raise InputError(f"fault {text!r}: it ends at {end:g} s, before it begins")
    if kind == "lost" and math.isfinite(end):
        raise InputError(f"fault {text!r}: a vehicle that is lost does not come back; leave the end out")
    return Fault(kind, vehicle, start, end)


def _hint(near: Sequence[str], known: Sequence[str] | dict[str, str]) -> str:
    names = list(known)
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names[:8])}{' ...' if len(names) > 8 else ''}"


def draw(count: int, vehicles: Sequence[str], duration: float, seed: int) -> list[Fault]:
    """Return `count` faults of any kind, on any vehicle, at any time; one vehicle at least is not lost."""
    random = np.random.default_rng([seed, 0xFA])
    lost: set[str] = set()
    faults = []
    for _ in range(count):
        kind, vehicle = str(random.choice(list(KINDS))), str(random.choice(list(vehicles)))
        start, span = round(random.uniform(0, duration), 1), round(random.uniform(30, 300), 1)
        if kind == "lost" and (vehicle in lost or len(lost) == len(vehicles) - 1):
            kind = "thruster"
        if kind == "lost":
            lost.add(vehicle)
        faults.append(Fault(kind, vehicle, start, math.inf if kind in ("lost", "thruster") else round(start + span, 1)))
    return faults


def active(faults: Sequence[Fault], vehicles: Sequence[str], time: float) -> dict[str, np.ndarray]:
    """Return, for each of KINDS, which of `vehicles` (k,) suffer from it at `time`."""
    out = {kind: np.zeros(len(vehicles), bool) for kind in KINDS}
    for fault in faults:
        if fault.start <= time < fault.end:
            out[fault.kind][vehicles.index(fault.vehicle)] = True
    return out


def next_change(faults: Sequence[Fault], time: float) -> float:
    """Return when, after `time`, a fault next begins or ends; infinity for never."""
    return min((t for f in faults for t in (f.start, f.end) if t > time), default=math.inf)

"""What happened: every vehicle's motion, sampled."""

import hashlib
import io
from dataclasses import dataclass, fields

import numpy as np

from quarterdeck.geo.frame import Frame
from quarterdeck.mission.track import Track

UNKNOWN = -1  # kind of a leg: where the vehicle was is not known (a gap in its log)


@dataclass(frozen=True, slots=True)
class Trace:
    """Time series of a run. `time` is (t,) seconds; all else is (t, k), a column a vehicle, in the order of `vehicles`.

    `x`, `y`, `z` metres in the frame, `heading` radians counter-clockwise from east, `speed` m/s over ground, `energy`
    Wh used, `leg` the number of the waypoint made for, in the last command (the route's, where nothing was changed),
    `kind` its code in `paths.LEGS` or UNKNOWN, `cross` metres to port of the leg (aerial: off it, in any direction),
    `turning` near a corner or holding, `underway` clear of the places where it is launched and recovered, `contact`
    touching an obstacle or another vehicle. `z` is above the ground, whose height `ground` is metres in the terrain's
    datum (0 without one, and where it is not known); `pitch` radians, nose up, is that of a ground vehicle on its slope.
    """

    vehicles: tuple[str, ...]
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    energy: np.ndarray
    cross: np.ndarray
    leg: np.ndarray
    kind: np.ndarray
    turning: np.ndarray
    underway: np.ndarray
    contact: np.ndarray
    ground: np.ndarray
    pitch: np.ndarray

    @property
    def hash(self) -> str:
        """SHA-256 of everything that happened: the same run on the same machine has the same."""
        digest = hashlib.sha256("\n".join(self.vehicles).encode())
        for field in fields(self)[1:]:
            digest.update(np.ascontiguousarray(getattr(self, field.name)).tobytes())
        return digest.hexdigest()

    def to_bytes(self, frame: Frame) -> bytes:
        """Return all of it as NPZ, with the `origin` (longitude, latitude) of the frame; `geo.logs` reads it as a log."""
        buffer = io.BytesIO()
        columns = {field.name: getattr(self, field.name) for field in fields(self)[1:]}
        np.savez(buffer, vehicles=np.array(self.vehicles), origin=np.array([frame.lon, frame.lat]), **columns)
        return buffer.getvalue()

    def tracks(self) -> tuple[Track, ...]:
        """Return it as the tracks of its vehicles."""
        nothing = np.zeros(len(self.time), bool)
        columns = ("x", "y", "z", "heading", "speed", "energy")
        return tuple(
            Track(vehicle, self.time, **{n: getattr(self, n)[:, i] for n in columns}, broken=nothing)
            for i, vehicle in enumerate(self.vehicles)
        )

    def known(self, column: int) -> list[slice]:
        """Return the unbroken runs of samples at which it is known where the vehicle in `column` was."""
        sure = self.kind[:, column] != UNKNOWN
        edges = np.flatnonzero(np.diff(np.r_[0, sure.astype(np.int8), 0])).reshape(-1, 2)
        return [slice(int(first), int(last)) for first, last in edges]


COLUMNS = {
    "x": np.float64,
    "y": np.float64,
    "z": np.float64,
    "heading": np.float64,
    "speed": np.float64,
    "energy": np.float64,
    "cross": np.float32,
    "leg": np.int32,
    "kind": np.int8,
    "turning": np.bool_,
    "underway": np.bool_,
    "contact": np.bool_,
    "ground": np.float64,
    "pitch": np.float32,
}


class TraceBuilder:
    """Collects samples in blocks, so that a run of unknown length costs no copying."""

    def __init__(self, vehicles: tuple[str, ...], block: int = 1024) -> None:
        self.vehicles, self.block, self.used = vehicles, block, block
        self.times: list[np.ndarray] = []
        self.blocks: list[dict[str, np.ndarray]] = []

    def add(self, time: float, **columns: np.ndarray) -> None:
        """Add one sample: a (k,) array for each of COLUMNS."""
        if self.used == self.block:
            self.times.append(np.empty(self.block))
            self.blocks.append({name: np.empty((self.block, len(self.vehicles)), dtype) for name, dtype in COLUMNS.items()})
            self.used = 0
        self.times[-1][self.used] = time
        for name, array in self.blocks[-1].items():
            array[self.used] = columns[name]
        self.used += 1

    def trace(self) -> Trace:
        """Return what was collected."""
        count = (len(self.blocks) - 1) * self.block + self.used
        series = {}
        for name in COLUMNS:
            series[name] = np.concatenate([block.pop(name) for block in self.blocks])[:count]
        return Trace(vehicles=self.vehicles, time=np.concatenate(self.times)[:count], **series)

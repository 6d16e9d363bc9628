"""How much of the area each vehicle covers."""

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle


def shares(vehicles: tuple[Vehicle, ...], even: np.ndarray | None = None) -> np.ndarray:
    """Return (k,) shares that sum to 1: those given, else `even` (see `even_shares`), else in proportion to speed.

    Raises InputError if some are given and some not, one is not positive, or they do not sum to 1 within 1e-9
    (ecdis-sa-darp, eq. 14).
    """
    given = [v.share for v in vehicles]
    if all(s is None for s in given):
        weights = np.array([v.speed for v in vehicles], dtype=float)
        return weights / weights.sum() if even is None else even
    without = [v.id for v in vehicles if v.share is None]
    if without:
        raise InputError(f"vehicle {without[0]!r} has no share and others have; give every vehicle a share, or none")
    array = np.array(given, dtype=float)
    for vehicle, share in zip(vehicles, array, strict=True):
        if not share > 0:
            raise InputError(f"vehicle {vehicle.id!r}: share {share} must be positive")
    if abs(array.sum() - 1.0) > 1e-9:
        raise InputError(f"the vehicles' shares sum to {array.sum():.12g}; they must sum to 1")
    return array


def even_shares(length: float, speeds: np.ndarray, away: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Return the (k,) shares of `length` metres of tracks with which all come home at the same time, as far as they can.

    `speeds` m/s on survey, turns counted; `away` seconds on the way out and home; `limits` seconds that each can be out.
    Nobody's share is nothing: the least is a thousandth of an equal one.
    """
    k = len(speeds)
    least = 1e-3 / k

    def metres(time: float) -> np.ndarray:
        return speeds * np.maximum(np.minimum(time, limits) - away, 0.0)

    low, high = 0.0, float((away + length / speeds).max())  # by then each could do all of it alone
    if metres(high).sum() <= length:  # they cannot do it all: each as much as it can
        done = metres(high)
    else:
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if metres(middle).sum() < length else (low, middle)
        done = metres(high)
    total = done.sum()
    even = np.maximum(done / total if total > 0 else np.full(k, 1.0 / k), least)
    return even / even.sum()

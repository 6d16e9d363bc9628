"""How much of the area each vehicle covers."""

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle


def shares(vehicles: tuple[Vehicle, ...]) -> np.ndarray:
    """Return (k,) shares that sum to 1: those given, or in proportion to speed where none is.

    Raises InputError if some are given and some not, one is not positive, or they do not sum to 1 within 1e-9
    (ecdis-sa-darp, eq. 14).
    """
    given = [v.share for v in vehicles]
    if all(s is None for s in given):
        weights = np.array([v.speed for v in vehicles], dtype=float)
        return weights / weights.sum()
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

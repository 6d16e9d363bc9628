"""Angles in radians."""

import numpy as np


def wrap(angle: np.ndarray) -> np.ndarray:
    """Return angles, radians of any shape, in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi

"""The colours: apart from one another, and a vehicle's own for good."""

from itertools import combinations

import numpy as np
import pytest

from quarterdeck.geo.palette import CASUALTY, colours, colours_of

# Machado et al. 2009, severity 1: what who has no red or no green cones sees of linear RGB.
SIGHTS = {
    "all": np.eye(3),
    "no red": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
    "no green": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]),
}


def lab(colour, sight):
    """Return CIELAB of a colour as it is seen."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = sight @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(to_xyz @ linear.clip(1e-4, 1) / (0.95047, 1.0, 1.08883))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def nearest(found, sight):
    """Return the least distance of two of some colours."""
    seen = [lab(colour, SIGHTS[sight]) for colour in found]
    return min(np.linalg.norm(a - b) for a, b in combinations(seen, 2))


@pytest.mark.parametrize(("count", "least"), [(10, 26.0), (50, 14.0)])
def test_vehicles_can_be_told_apart(count, least):
    """No two of ten or fifty look alike; two to three units of CIELAB are what an eye just tells apart side by side."""
    assert nearest(colours(count), "all") >= least


@pytest.mark.parametrize("sight", ["no red", "no green"])
def test_ten_vehicles_can_be_told_apart_by_the_colour_blind(sight):
    """The first ten differ in brightness too."""
    assert nearest(colours(10), sight) >= 14.0


def test_no_robot_looks_like_a_casualty():
    """The first five colours beside casualties are far from all of theirs."""
    theirs = [lab(c, SIGHTS["all"]) for c in CASUALTY.values()]
    own = [lab(c, SIGHTS["all"]) for c in colours(5, casualties=True)]
    assert min(np.linalg.norm(a - b) for a in own for b in theirs) >= 27.0


def test_who_is_left_keeps_the_colour_whatever_the_order():
    """Colours go by name, 2 before 10, and not by the order in a file."""
    assert colours_of(["usv10", "usv2", "usv1"]) == dict(zip(["usv1", "usv2", "usv10"], colours(3), strict=True))


def test_names_of_the_same_number_have_an_order_of_their_own():
    """uav01 and uav1 have the same colours in every process."""
    names = ["uav0001", "uav001", "uav01", "uav1"]
    assert colours_of(reversed(names)) == dict(zip(names, colours(4), strict=True))

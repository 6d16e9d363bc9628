"""The proof that guards see everything, whole and in boxes."""

import numpy as np
import pytest

from quarterdeck.coverage.guards import certificate
from quarterdeck.coverage.guards.space import Space
from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.reproduce.guard_maps import random_room


def test_in_boxes_as_much_is_uncovered_as_in_one(monkeypatch) -> None:
    """Many views are united box by box; what they leave is what one union leaves."""
    room = random_room(100, 1)
    places = np.random.default_rng(0).uniform(0, 100, (40, 2))
    views = visibility_polygons(triangulate(room), places, 15.0)
    space = Space(room, room, room)
    whole = certificate.uncovered(space, views)
    monkeypatch.setattr(certificate, "MANY", 10)
    monkeypatch.setattr(certificate, "A_BOX", 4)
    boxed = certificate.uncovered(space, views)
    assert boxed.area == pytest.approx(whole.area)
    assert boxed.symmetric_difference(whole).area < 1e-6
    assert whole.area > 1.0

"""What is added to a mission under way is read into that mission's frame."""

import json
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.reader import read_additions, read_obstacles

RING = [[5.0, 52.0], [5.001, 52.0], [5.001, 52.001], [5.0, 52.001], [5.0, 52.0]]


def write(tmp_path: Path, role: str) -> Path:
    """Write one square feature of a role."""
    feature = {"type": "Feature", "id": "x", "properties": {"role": role}}
    document = {
        "type": "FeatureCollection",
        "features": [feature | {"geometry": {"type": "Polygon", "coordinates": [RING]}}],
    }
    path = tmp_path / "new.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_an_obstacle_alone_is_enough(tmp_path):
    """No area is required, and places are those of the given frame."""
    frame = Frame(5.01, 52.0)
    added = read_additions(write(tmp_path, "obstacle"), frame)
    assert not added.site.areas
    corner = frame.to_metres(np.array([RING[0]]))[0]
    assert np.abs(np.array(added.site.obstacles[0].polygon.exterior.coords) - corner).sum(axis=1).min() < 1e-6


def test_obstacles_are_required_where_asked_for(tmp_path):
    """A file without obstacles is refused where obstacles are what is wanted."""
    with pytest.raises(InputError, match="obstacle"):
        read_obstacles(write(tmp_path, "area"), Frame(5.0, 52.0))

"""What a file is: kinds are told by content, whatever surrounds them."""

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.geojson import opened
from quarterdeck.geo.kinds import CELL, CHANGES, FATES, MODEL, PLAN, REPORT, SITE, STUDY, TRACE, kind_of


def collection(*properties: dict) -> bytes:
    """Return a FeatureCollection of features without geometry."""
    features = [{"type": "Feature", "properties": p, "geometry": None} for p in properties]
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (collection({"role": "area"}, {"role": "plan"}), PLAN),
        (collection({"role": "area"}), SITE),
        (b"\xef\xbb\xbf" + collection({"role": "task"}), SITE),
        (collection({"role": "area", "change": "remove"}), CHANGES),
        (collection({"role": "triage"}, {"role": "casualty"}), FATES),
        (collection({"role": 3}, {}), None),
        (b'{"type": "quarterdeck-report"}', REPORT),
        (b"[1]", None),
        (b"{", None),
        (b'runs = 3\nplan = "plan.geojson"\n', STUDY),
        (b'name = "x"\ndomain = "surface"\n', MODEL),
        (b"time,lon,lat\n1,2,3\n", None),
        (b"00123" + b"3LE1", CELL),
        (b"", None),
    ],
)
def test_kinds(data: bytes, kind: str | None) -> None:
    """Each kind, and what is none of them."""
    assert kind_of(data) == kind


def test_a_trace_is_no_other_archive() -> None:
    """An NPZ is told from a KMZ."""
    file = io.BytesIO()
    np.savez(file, time=np.zeros(3))
    assert kind_of(file.getvalue()) == TRACE
    assert kind_of(b"PK\x03\x04doc.kml") is None


def test_a_damaged_collection_is_told_what_is_wrong_with_it(tmp_path) -> None:
    """That it is a site helps nobody who gave a site."""
    path = tmp_path / "site.geojson"
    path.write_bytes(collection({"role": "area", "spacing": float("nan")}))
    with pytest.raises(InputError, match="NaN is no number"):
        opened(path)


@given(st.binary() | st.text().map(str.encode))
def test_anything_has_an_answer(data: bytes) -> None:
    """No bytes make it fail."""
    kind_of(data)

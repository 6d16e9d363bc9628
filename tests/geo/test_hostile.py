"""Files made to harm: what grows when it is read, reaches out, nests without end or overflows is one line and cheap."""

import io
import json
import struct
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.occupancy import read_map
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.terrain import read_terrain

KML = """<?xml version="1.0"?>{doctype}<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>{name}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
10,54 10.01,54 10.01,54.01 10,54.01 10,54</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
</Document></kml>"""
LAUGHS = '<!ENTITY l0 "lol">' + "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
SITE = {
    "type": "FeatureCollection",
    "features": [{
        "type": "Feature",
        "properties": {"role": "area", "spacing": 5},
        "geometry": {"type": "Polygon", "coordinates": [[[10, 54], [10.01, 54], [10.01, 54.01], [10, 54]]]},
    }],
}  # fmt: skip


@pytest.fixture(autouse=True)
def little():
    """Hold a test to 5 CPU seconds and, where Linux tells, 200 MB more than there were."""
    forget = Path("/proc/self/clear_refs")
    if forget.exists():
        forget.write_text("5")  # the peak so far, else what ran before hides what is taken here
    start, held = time.process_time(), memory("VmRSS")
    yield
    assert time.process_time() - start < 5
    assert memory("VmHWM") - held < 200e6


def memory(kind):
    """Return the bytes that Linux tells of this process, now (VmRSS) or at most (VmHWM); 0 elsewhere."""
    told = Path("/proc/self/status")
    return int(told.read_text().split(f"{kind}:")[1].split()[0]) * 1024 if told.exists() else 0


def refused(read, path, data):
    """Write the data, read it and return the one line of refusal."""
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 1000
    return str(error.value)


def test_entities_of_xml_do_not_grow(tmp_path):
    """A billion laughs in KML is refused, or stays the three letters that it is."""
    path = tmp_path / "site.kml"
    path.write_text(KML.format(doctype=f"<!DOCTYPE kml [{LAUGHS}]>", name="&l11;"))
    try:
        scenario = read_scenario(path)
    except InputError:
        return
    assert all(len(area.id) < 100 for area in scenario.site.areas)


def test_entities_of_xml_do_not_reach_out(tmp_path):
    """No file and no network is read for an entity."""
    secret = tmp_path / "secret"
    secret.write_text("open sesame")
    path = tmp_path / "site.kml"
    path.write_text(KML.format(doctype=f'<!DOCTYPE kml [<!ENTITY x SYSTEM "{secret.as_uri()}">]>', name="&x;"))
    try:
        told = str(read_scenario(path))
    except InputError as error:
        told = str(error)
    assert "sesame" not in told


def test_a_kmz_that_unpacks_to_a_flood(tmp_path):
    """100 MB of spaces in 100 kB are not unpacked."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", b"<kml>" + b" " * 100_000_000)
    assert "unpacks to more than" in refused(read_scenario, tmp_path / "site.kmz", packed.getvalue())


def test_an_npz_that_unpacks_to_a_flood(tmp_path):
    """Terrain of 300 MB in 300 kB is not unpacked, nor one that only says that it is large."""
    frame, bounds = Frame(10.0, 54.0), (0.0, 0.0, 100.0, 100.0)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**7, 10**7)})
    for content, count in ((header.getvalue() + bytes(1000), 1), (bytes(1_000_000), 300)):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in ("origin.npy", "cell.npy"):
                made = io.BytesIO()
                np.save(made, np.zeros(2) if name == "origin.npy" else np.ones(()))
                archive.writestr(name, made.getvalue())
            with archive.open("heights.npy", "w", force_zip64=True) as file:
                for _ in range(count):
                    file.write(content)
        refused(lambda path: read_terrain(str(path), frame, bounds), tmp_path / "terrain.npz", packed.getvalue())


@pytest.mark.parametrize("text", ["[", '{"a":', '{"type": "FeatureCollection", "features": ['])
def test_json_that_nests_without_end(tmp_path, text):
    """Brackets by the hundred thousand."""
    assert "nested too deeply" in refused(read_scenario, tmp_path / "site.geojson", text * 100_000)


def test_xml_that_nests_without_end(tmp_path):
    """Folders in folders in folders."""
    refused(read_scenario, tmp_path / "site.kml", "<kml>" + "<Folder>" * 100_000)


def test_toml_that_nests_without_end(tmp_path):
    """Lists in lists."""
    refused(lambda path: load_model(str(path)), tmp_path / "own.toml", "a = " + "[" * 100_000)


@pytest.mark.parametrize("number", ["1e400", "-1e400", "9" * 400, "9" * 10_000, "1e308"])
def test_numbers_beyond_all_numbers(tmp_path, number):
    """As a coordinate and as a property."""
    text = json.dumps(SITE)
    refused(read_scenario, tmp_path / "a.geojson", text.replace("10.01", number, 1))
    refused(read_scenario, tmp_path / "b.geojson", text.replace('"spacing": 5', f'"spacing": {number}'))


def test_yaml_whose_aliases_grow(tmp_path):
    """A map's origin of 10^9 numbers, in ten lines, is told in a few words."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    refused(read_map, tmp_path / "map.yaml", "\n".join([*lines, "image: map.pgm", "resolution: 1", "origin: *a9"]))


def test_yaml_that_nests_without_end(tmp_path):
    """Lists in lists."""
    refused(read_map, tmp_path / "map.yaml", "origin: " + "[" * 20_000)


def test_a_picture_that_is_larger_than_it_looks(tmp_path):
    """A PNG of 100,000 x 100,000 white cells in a few hundred bytes is not unpacked."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    for side in (5_000, 13_000, 100_000):
        head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
        body = zlib.compress(b"\0" * 1000)
        (tmp_path / "map.png").write_bytes(
            b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
        )
        told = refused(read_map, tmp_path / "map.yaml", "image: map.png\nresolution: 1\norigin: [0, 0, 0]\n")
        assert "cells, more than" in told or "cannot be read" in told

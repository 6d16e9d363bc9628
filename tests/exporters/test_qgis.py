"""QGIS layers: one kind of geometry a layer, and styles that only ask for what features have. QGIS itself is not run."""

import json
import re

from lxml import etree

from quarterdeck.exporters.export import export


def test_styles_fit_their_layers(quads, tmp_path):
    """Each .qml is sound, for its layer's kind of geometry, and names only properties that every feature has."""
    paths = {p.name: p for p in export(quads, "qgis", tmp_path)}
    kinds = {"routes": ("LineString", "1", "SimpleLine"), "site": ("Polygon", "2", "SimpleFill")}
    for layer, (geometry, code, symbol) in kinds.items():
        features = json.loads(paths[f"field_survey_{layer}.geojson"].read_text())["features"]
        assert features
        assert {f["geometry"]["type"].removeprefix("Multi") for f in features} == {geometry}
        style = etree.fromstring(paths[f"field_survey_{layer}.qml"].read_bytes())
        assert style.findtext("layerGeometryType") == code
        assert style.find(".//layer").get("class") == symbol
        for option in style.iterfind(".//Option[@name='expression']"):
            used = set(re.findall(r'"([\w-]+)"', option.get("value")))
            required = used - ({"fill"} if "coalesce" in option.get("value") else set())
            assert used
            assert all(required <= set(f["properties"]) for f in features)

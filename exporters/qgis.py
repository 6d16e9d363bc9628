"""Two GeoJSON layers, routes and site, each with the QGIS style (.qml) of the same name, which QGIS applies by itself.

A style belongs to one kind of geometry, so lines and polygons are apart. Colours and widths come from the features' own
simplestyle properties, so a layer that is edited or joined with another plan's keeps them.
"""

import json
from typing import Any

from lxml import etree

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.geojson import route_features, site_features
from quarterdeck.exporters.places import file_stems
from quarterdeck.mission.mission import Mission

DOCTYPE = "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>"
_DATA_DEFINED = "3"  # QgsProperty: an expression
_LINE = {"outlineColor": '"stroke"', "outlineWidth": '"stroke-width" * 0.25'}
_FILL = {
    "outlineColor": '"stroke"',
    "fillColor": "set_color_part(coalesce(\"fill\", '#ffffff'), 'alpha', 255 * \"fill-opacity\")",
}


def files(mission: Mission, settings: Settings) -> dict[str, str]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>_routes` and `<mission>_site`, each as .geojson and .qml."""
    stem, _ = file_stems(mission)
    routes = [f for f in route_features(mission) if "LineString" in f["geometry"]["type"]]
    site = [f for f in site_features(mission) if "Polygon" in f["geometry"]["type"]]
    return {
        f"{stem}_routes.geojson": _collection(routes),
        f"{stem}_routes.qml": _style("line", "SimpleLine", "1", _LINE),
        f"{stem}_site.geojson": _collection(site),
        f"{stem}_site.qml": _style("fill", "SimpleFill", "2", _FILL),
    }


def _collection(features: list[dict[str, Any]]) -> str:
    return json.dumps({"type": "FeatureCollection", "features": features}, ensure_ascii=False, allow_nan=False) + "\n"


def _style(kind: str, symbol: str, geometry: str, expressions: dict[str, str]) -> str:
    root = etree.Element("qgis", version="3.22.0", styleCategories="Symbology")
    renderer = etree.SubElement(root, "renderer-v2", type="singleSymbol", symbollevels="0", forceraster="0")
    symbols = etree.SubElement(etree.SubElement(renderer, "symbols"), "symbol", type=kind, name="0", alpha="1")
    layer = etree.SubElement(symbols, "layer", {"class": symbol}, enabled="1", locked="0", **{"pass": "0"})
    defined = etree.SubElement(etree.SubElement(layer, "data_defined_properties"), "Option", type="Map")
    etree.SubElement(defined, "Option", type="QString", name="name", value="")
    properties = etree.SubElement(defined, "Option", type="Map", name="properties")
    for name, expression in expressions.items():
        entry = etree.SubElement(properties, "Option", type="Map", name=name)
        etree.SubElement(entry, "Option", type="bool", name="active", value="true")
        etree.SubElement(entry, "Option", type="QString", name="expression", value=expression)
        etree.SubElement(entry, "Option", type="int", name="type", value=_DATA_DEFINED)
    etree.SubElement(defined, "Option", type="QString", name="type", value="collection")
    etree.SubElement(root, "layerGeometryType").text = geometry
    return str(etree.tostring(root, doctype=DOCTYPE, pretty_print=True, encoding="unicode"))

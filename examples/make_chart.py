"""Write data/sample_chart.000 and its update .001: a harbour that is nowhere, as S-57 edition 3.1 cells of our own making.

    python examples/make_chart.py data/sample_chart

IHO S-57 edition 3.1, Part 3 and Appendix B.1 (ENC product specification); ISO/IEC 8211:1994. Every area has a boundary edge
of its own, from one connected node round to it.
"""

import struct
import sys
from collections.abc import Sequence
from pathlib import Path

UNIT, FIELD = b"\x1f", b"\x1e"
COMF, SOMF = 10_000_000, 10  # coordinates are ten millionths of a degree, depths decimetres
CODES = {"DEPARE": 42, "LNDARE": 71, "OBSTRN": 86, "RESARE": 112, "SLCONS": 122, "SOUNDG": 129, "UWTROC": 153}
CODES |= {"WRECKS": 159, "BOYLAT": 17, "M_COVR": 302}
ATTRIBUTES = {"DRVAL1": 87, "DRVAL2": 88, "VALSOU": 179, "CATCOV": 18, "WATLEV": 187}
POINT, LINE, AREA = 1, 2, 3

# tag: (control, name, subfields, formats); control 1600 is one set, 2600 and 2500 are sets that repeat
DEFINITIONS = {
    "0001": ("0500", "ISO/IEC 8211 Record Identifier", "", "(b12)"),
    "DSID": (
        "1600",
        "Data set identification field",
        "RCNM!RCID!EXPP!INTU!DSNM!EDTN!UPDN!UADT!ISDT!STED!PRSP!PSDN!PRED!PROF!AGEN!COMT",
        "(b11,b14,2b11,3A,2A(8),R(4),b11,2A,b11,b12,A)",
    ),
    "DSSI": (
        "1600",
        "Data set structure information field",
        "DSTR!AALL!NALL!NOMR!NOCR!NOGR!NOLR!NOIN!NOCN!NOED!NOFA",
        "(3b11,8b14)",
    ),
    "DSPM": (
        "1600",
        "Data set parameter field",
        "RCNM!RCID!HDAT!VDAT!SDAT!CSCL!DUNI!HUNI!PUNI!COUN!COMF!SOMF!COMT",
        "(b11,b14,3b11,b14,4b11,2b14,A)",
    ),
    "VRID": ("1600", "Vector record identifier field", "RCNM!RCID!RVER!RUIN", "(b11,b14,b12,b11)"),
    "VRPT": ("2600", "Vector record pointer field", "*NAME!ORNT!USAG!TOPI!MASK", "(B(40),4b11)"),
    "SG2D": ("2500", "2-D coordinate field", "*YCOO!XCOO", "(2b24)"),
    "SG3D": ("2500", "3-D coordinate (sounding array) field", "*YCOO!XCOO!VE3D", "(3b24)"),
    "FRID": ("1600", "Feature record identifier field", "RCNM!RCID!PRIM!GRUP!OBJL!RVER!RUIN", "(b11,b14,2b11,2b12,b11)"),
    "FOID": ("1600", "Feature object identifier field", "AGEN!FIDN!FIDS", "(b12,b14,b12)"),
    "ATTF": ("2600", "Feature record attribute field", "*ATTL!ATVL", "(b12,A)"),
    "FSPT": ("2600", "Feature record to spatial record pointer field", "*NAME!ORNT!USAG!MASK", "(B(40),3b11)"),
}
TREE = "0001DSID DSIDDSSI 0001DSPM 0001VRID VRIDVRPT VRIDSG2D VRIDSG3D 0001FRID FRIDFOID FRIDATTF FRIDFSPT".replace(" ", "")

Place = tuple[float, float]


def record(fields: list[tuple[str, bytes]], leader: bytes) -> bytes:
    """Return one ISO 8211 record: leader, directory, fields; lengths and positions have five digits."""
    directory, area = b"", b""
    for tag, content in fields:
        directory += tag.encode() + b"%05d%05d" % (len(content) + 1, len(area))
        area += content + FIELD
    base = 24 + len(directory) + 1
    return b"%05d" % (base + len(area)) + leader % base + directory + FIELD + area


def description() -> bytes:
    """Return the data descriptive record."""
    fields = [("0000", b"0000;&   " + UNIT + TREE.encode())]
    for tag, (control, name, subfields, formats) in DEFINITIONS.items():
        text = f"{control};&   {name}".encode() + UNIT + subfields.encode() + UNIT + formats.encode()
        fields.append((tag, text))
    return record(fields, b"3LE1 09%05d ! 5504")


class Cell:
    """Collects the records of a cell, numbers them, writes them."""

    def __init__(self, name: str, edition: str, update: str) -> None:
        self.records: list[list[tuple[str, bytes]]] = []
        self.name, self.edition, self.update = name, edition, update
        self.numbers = {110: 0, 120: 0, 130: 0, 100: 0}

    def vector(self, kind: int, *fields: tuple[str, bytes]) -> bytes:
        """Add an isolated (110) or connected (120) node or an edge (130); return its name."""
        self.numbers[kind] += 1
        number = self.numbers[kind]
        self.records.append([("VRID", struct.pack("<BIHB", kind, number, 1, 1)), *fields])
        return struct.pack("<BI", kind, number)

    def feature(self, code: str, primitive: int, pointers: bytes, **attributes: float) -> None:
        """Add a feature object with its attributes."""
        self.numbers[100] += 1
        number = self.numbers[100]
        group = 1 if code in ("DEPARE", "LNDARE") and primitive == AREA else 2
        fields = [
            ("FRID", struct.pack("<BIBBHHB", 100, number, primitive, group, CODES[code], 1, 1)),
            ("FOID", struct.pack("<HIH", 65535, number, 1)),
        ]
        if attributes:
            pairs = [struct.pack("<H", ATTRIBUTES[name]) + f"{value:g}".encode() for name, value in attributes.items()]
            fields.append(("ATTF", b"".join(pair + UNIT for pair in pairs)))
        self.records.append([*fields, ("FSPT", pointers)])

    def point(self, code: str, lon: float, lat: float, **attributes: float) -> None:
        """Add a point feature."""
        node = self.vector(110, ("SG2D", places([(lon, lat)])))
        self.feature(code, POINT, node + bytes((255, 255, 255)), **attributes)

    def line(self, code: str, *corners: Place, **attributes: float) -> None:
        """Add a line feature."""
        self.feature(code, LINE, self.edge(corners[0], corners[-1], corners[1:-1]) + bytes((1, 255, 2)), **attributes)

    def area(self, code: str, *rings: list[Place], **attributes: float) -> None:
        """Add an area feature: an outer ring, then holes."""
        pointers = b""
        for i, ring in enumerate(rings):
            pointers += self.edge(ring[0], ring[0], ring[1:]) + bytes((1, 1 if i == 0 else 2, 2))
        self.feature(code, AREA, pointers, **attributes)

    def edge(self, first: Place, last: Place, between: Sequence[Place]) -> bytes:
        """Add an edge from node to node; return its name."""
        begin = self.vector(120, ("SG2D", places([first])))
        end = begin if first == last else self.vector(120, ("SG2D", places([last])))
        ends = begin + bytes((255, 255, 1, 255)) + end + bytes((255, 255, 2, 255))
        return self.vector(130, ("VRPT", ends), *([("SG2D", places(between))] if between else []))

    def soundings(self, *spots: tuple[float, float, float]) -> None:
        """Add one sounding array."""
        array = b"".join(places([(lon, lat)]) + struct.pack("<i", round(depth * SOMF)) for lon, lat, depth in spots)
        self.feature("SOUNDG", POINT, self.vector(110, ("SG3D", array)) + bytes((255, 255, 255)))

    def to_bytes(self) -> bytes:
        """Return the file's bytes."""
        new = self.update == "0"
        head = struct.pack("<BIBB", 10, 1, 1 if new else 3, 5)
        head += b"".join(text.encode() + UNIT for text in (self.name, self.edition, self.update))
        head += b"2026010120260101" + b"03.1" + struct.pack("<B", 1) + UNIT + b"2.0" + UNIT
        head += struct.pack("<BH", 1 if new else 2, 65535) + b"Quarterdeck sample, not for navigation" + UNIT
        n = self.numbers
        counts = struct.pack("<BBB8I", 2, 1, 1, 0, 0, n[100], 0, n[110], n[120], n[130], 0)
        base = [[("DSID", head), ("DSSI", counts)]]
        if new:  # WGS 84; 1:10 000; depths and heights in metres, positions in degrees
            base.append([("DSPM", struct.pack("<BIBBBIBBBBII", 20, 1, 2, 16, 16, 10_000, 1, 1, 1, 1, COMF, SOMF) + UNIT)])
        whole = description()
        for number, fields in enumerate([*base, *self.records], 1):
            whole += record([("0001", struct.pack("<H", number)), *fields], b" D     %05d   5504")
        return whole


def places(corners: Sequence[Place]) -> bytes:
    """Return latitudes and longitudes as pairs of 32-bit numbers."""
    return b"".join(struct.pack("<ii", round(lat * COMF), round(lon * COMF)) for lon, lat in corners)


def box(west: float, south: float, east: float, north: float) -> list[Place]:
    """Return a rectangle's corners, clockwise as outer boundaries are."""
    return [(west, south), (west, north), (east, north), (east, south)]


def harbour() -> Cell:
    """A bay open to the south: a shelving shore, an islet, a breakwater, rocks, wrecks and a closed anchorage."""
    cell = Cell("QD5HARB1.000", "1", "0")
    cell.area("M_COVR", box(5.0, 58.0, 5.04, 58.02), CATCOV=1)
    cell.area("LNDARE", box(5.0, 58.017, 5.04, 58.02))
    cell.area("DEPARE", box(5.0, 58.014, 5.04, 58.017), DRVAL1=0, DRVAL2=2)
    cell.area("DEPARE", box(5.0, 58.01, 5.04, 58.014), DRVAL1=2, DRVAL2=5)
    cell.area("DEPARE", box(5.0, 58.0, 5.04, 58.01), box(5.01, 58.004, 5.012, 58.005)[::-1], DRVAL1=5, DRVAL2=10)
    cell.area("LNDARE", box(5.01, 58.004, 5.012, 58.005))
    cell.line("SLCONS", (5.02, 58.017), (5.02, 58.012), (5.022, 58.011))
    cell.area("RESARE", box(5.033, 58.002, 5.037, 58.005))
    cell.point("UWTROC", 5.006, 58.012, WATLEV=3)
    cell.point("OBSTRN", 5.016, 58.006, VALSOU=0.6)
    cell.point("WRECKS", 5.028, 58.007, VALSOU=8.5)
    cell.point("WRECKS", 5.03, 58.012, VALSOU=1.1)
    cell.point("BOYLAT", 5.024, 58.009)
    cell.soundings((5.004, 58.002, 9.1), (5.02, 58.003, 6.2), (5.026, 58.003, 1.4), (5.03, 58.009, 5.4))
    return cell


def update() -> Cell:
    """The first update: a rock was found."""
    cell = Cell("QD5HARB1.001", "1", "1")
    cell.numbers = dict.fromkeys(cell.numbers, 900)
    cell.point("UWTROC", 5.034, 58.008, WATLEV=4)
    return cell


if __name__ == "__main__":
    stem = Path(sys.argv[1])
    stem.with_suffix(".000").write_bytes(harbour().to_bytes())
    stem.with_suffix(".001").write_bytes(update().to_bytes())

"""What autopilots' boards hold: mission items and fence vertices.

ArduPilot 4.7-dev: `libraries/StorageManager/StorageManager.cpp` gives each kind its bytes by the board's storage. A
command takes 15 after 4 of header (`AP_Mission.h`); a fence takes 8 a vertex, 2 a polygon and 5 in all, at most 255
vertices a polygon (`AC_PolyFence_loader.cpp`). The 724 items of a Pixhawk that are still quoted are of before the last
kilobyte went to CAN. PX4: `navigator/navigation.h` (NUM_MISSIONS_SUPPORTED) and `dataman.h` (DM_KEY_FENCE_POINTS_MAX, 64
with the one that counts them).
"""

from collections.abc import Sequence

from shapely import Polygon

from quarterdeck.exporters.export import Settings

# kB of storage, most boards have 16: bytes for missions and for fences of boats and rovers, of copters
BYTES = {
    4: ((2506, 160), (2422, 48)),
    8: ((4638, 416), (4554, 304)),
    15: ((4638, 416), (4554, 304)),
    16: ((9842, 672), (9758, 560)),
    32: ((19684, 672), (19600, 560)),
}
PX4_ITEMS, PX4_VERTICES = 500, 63


def most_items(domain: str, settings: Settings) -> int:
    """Return how many mission items the board of a vehicle of the domain holds, home among them."""
    if settings.autopilot == "px4":
        return PX4_ITEMS + 1  # home is none of them
    return (BYTES[settings.storage][domain == "aerial"][0] - 4) // 15


def fence_fits(polygons: Sequence[Polygon], domain: str, settings: Settings) -> bool:
    """Return whether the board of a vehicle of the domain holds a fence of these polygons."""
    counts = [len(p.exterior.coords) - 1 for p in polygons]
    if settings.autopilot == "px4":
        return sum(counts) <= PX4_VERTICES
    return 5 + sum(2 + 8 * n for n in counts) <= BYTES[settings.storage][domain == "aerial"][1] and max(counts) <= 255


def board(settings: Settings) -> str:
    """Return the board in words."""
    return "PX4" if settings.autopilot == "px4" else f"ArduPilot with {settings.storage} kB of storage"

"""Quarterdeck plans, proves and exports missions for fleets on land, at sea and in the air."""

from typing import TYPE_CHECKING, Any

from quarterdeck.geo.version import VERSION as __version__

if TYPE_CHECKING:
    from quarterdeck.api import assign, export, plan, read_plan, read_scenario, simulate, write_plan

__all__ = ["__version__", "assign", "export", "plan", "read_plan", "read_scenario", "simulate", "write_plan"]


def __getattr__(name: str) -> Any:
    """Import the library's functions when they are first asked for: the command line's `--help` needs none."""
    if name in __all__:
        from quarterdeck import api

        return getattr(api, name)
    raise AttributeError(f"module 'quarterdeck' has no attribute {name!r}")

"""Quarterdeck plans, proves and exports missions for fleets on land, at sea and in the air."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("quarterdeck")
except PackageNotFoundError:  # a clone on the path that was never installed
    __version__ = "0.0.0"

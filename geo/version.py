"""The version of what is installed; plans and reports carry it."""

from importlib.metadata import PackageNotFoundError, version

try:
    VERSION = version("quarterdeck")
except PackageNotFoundError:  # a clone on the path that was never installed
    VERSION = "0.0.0"

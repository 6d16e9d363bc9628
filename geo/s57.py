"""The layers of an S-57 cell, by GDAL's reader (pyogrio) in a process of its own: there are damaged cells that crash it."""

import os
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from quarterdeck.geo.errors import InputError

OPTIONS = {"SPLIT_MULTIPOINT": "YES", "ADD_SOUNDG_DEPTH": "YES"}


class Layer(NamedTuple):
    """A class of objects: (n,) `geometries` as WKB (lon, lat), and each of its `fields` as (n,) values."""

    geometries: np.ndarray
    fields: dict[str, np.ndarray]


def read_layers(path: str | Path) -> dict[str, Layer]:
    """Return the layers of a .000 file by name, updates beside it (.001 and on) applied.

    Raises InputError if it cannot be read as an S-57 cell.
    """
    here = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-P", "-c", f"from {__name__} import tell_layers; tell_layers()", os.fspath(path)]
    read = subprocess.run(command, env=here, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if read.returncode:
        said = read.stderr.decode(errors="replace").strip().splitlines() if read.returncode > 0 else []
        why = said[-1].partition(": ")[2] or said[-1] if said else "it crashes the reader"
        raise InputError(f"{path}: cannot be read as an S-57 cell ({why[:120]}); is it damaged?")
    layers: dict[str, Layer] = pickle.loads(read.stdout)
    return layers


def tell_layers() -> None:
    """Write the layers of the file that the command line names to standard output, pickled."""
    import pyogrio

    path, layers = sys.argv[1], {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # empty attributes, which are unknown, are said to be odd numbers
        for name, _ in pyogrio.list_layers(path):
            meta, _, geometries, values = pyogrio.raw.read(path, layer=name, **OPTIONS)
            fields: dict[str, np.ndarray] = dict(zip(meta["fields"], values, strict=True))
            layers[name] = Layer(np.empty(0, object) if geometries is None else geometries, fields)
    if "DSID" not in layers:
        raise ValueError("it has no DSID record")
    sys.stdout.buffer.write(pickle.dumps(layers))

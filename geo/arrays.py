"""Arrays in NPZ files that anybody may have made: read whole or refused, whatever is in them."""

import io
import zipfile
from collections.abc import Iterable

import numpy as np

MOST_BYTES = 200_000_000  # that a file may unpack to, or ten times its own size


def load_arrays(data: bytes, names: Iterable[str], texts: Iterable[str] = ()) -> dict[str, np.ndarray]:
    """Return arrays of an NPZ file by name: those of `names` as floats, those of `texts` as they are.

    Raises KeyError for a name that is not in it; ValueError if it is damaged, holds what are no real numbers, or is a
    flood.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > max(MOST_BYTES, 10 * len(data)):
            raise ValueError(f"it unpacks to more than {MOST_BYTES // 1_000_000} MB")
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            numbers = {name: file[name].astype(float, casting="safe", copy=False) for name in names}
            return numbers | {name: file[name] for name in texts}
    except (KeyError, ValueError):
        raise
    except Exception as error:  # zipfile's, zlib's and the tokenizer's: whatever they meet in a damaged file
        raise ValueError(" ".join(str(error).split())) from None

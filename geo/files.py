"""Writing files: beside, then renamed, so that none is ever half written."""

import os
import tempfile
from pathlib import Path

from quarterdeck.geo.errors import InputError


def write_file(path: Path, content: bytes | str, *, force: bool = False) -> Path:
    """Write `content` to `path` whole or not at all, and return the path; text is UTF-8 with LF.

    Folders are made as needed. Raises InputError if the file exists and not `force`, or it cannot be written.
    """
    if path.exists() and not force:
        raise InputError(f"{path} exists; give --force to overwrite it, or another name")
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place with -o") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        umask = os.umask(0)
        os.umask(umask)
        Path(beside).chmod(0o666 & ~umask)
        Path(beside).replace(path)
    except OSError as error:
        Path(beside).unlink(missing_ok=True)
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place with -o") from None
    return path

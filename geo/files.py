"""Reading files, and standard input; writing them beside, then renamed, so that none is ever half written; safe names."""

import errno
import os
import re
import sys
import tempfile
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path

from quarterdeck.geo.errors import InputError


def read_bytes(source: str | Path) -> bytes:
    """Return the bytes of a file, or of standard input for `-`. Raises InputError if it cannot be read."""
    if str(source) == "-":
        return sys.stdin.buffer.read()
    try:
        return Path(source).read_bytes()
    except (OSError, ValueError) as error:
        raise _unreadable(source, error) from None


def refuse_missing(source: str | Path) -> None:
    """Raise InputError if nothing is at `source`; `-` is standard input."""
    try:
        if str(source) != "-":
            Path(source).stat()
    except (OSError, ValueError) as error:
        raise _unreadable(source, error) from None


def refuse_existing(path: Path, *, force: bool) -> None:
    """Raise InputError if a file is at `path` and not `force`, or can be no path here (a name that is too long)."""
    try:
        exists = path.is_file()  # a folder cannot be overwritten: writing refuses it; devices and pipes take what comes
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place with -o") from None
    if exists and not force:
        raise InputError(f"{path} exists; give --force to overwrite it, or another name")


def _unreadable(source: str | Path, error: OSError | ValueError) -> InputError:
    return InputError(f"{source}: cannot be read ({getattr(error, 'strerror', None) or error}); give the path of a file")


def write_file(path: Path, content: bytes | str, *, force: bool = False) -> Path:
    """Write `content` to `path` whole or not at all, and return the path; text is UTF-8 with LF.

    Folders are made as needed. Raises InputError if the file exists and not `force`, or it cannot be written.
    """
    return write_files({path: content}, force=force)[0]


def write_files(contents: Mapping[Path, bytes | str], *, force: bool = False) -> list[Path]:
    """Write files that belong together, all or none: none is put in its place before all are written beside theirs.

    Returns their paths. Raises InputError as `write_file` does.
    """
    for path in contents:
        refuse_existing(path, force=force)
    written: dict[Path, Path] = {}
    try:
        for path, content in contents.items():
            data = content.encode("utf-8") if isinstance(content, str) else content
            if _takes_a_stream(path):
                path.write_bytes(data)
            else:
                written[path] = _beside(path, data)
        for path, beside in written.items():
            beside.replace(path.resolve())  # through a link, not over it
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place with -o") from None
    finally:
        for beside in written.values():
            beside.unlink(missing_ok=True)
    return list(contents)


def _takes_a_stream(path: Path) -> bool:
    """Devices and pipes, such as /dev/null: a file renamed over them would replace them."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _beside(path: Path, data: bytes) -> Path:
    """Write a file beside where it is to stand, under a name of its own, and return that. Raises OSError."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    path = path.resolve()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, f"{path.parent} is a file") from None
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(0o666 & ~umask)
    except BaseException:  # a full disk, Ctrl-C
        Path(name).unlink(missing_ok=True)
        raise
    return Path(name)


def safe_names(names: Iterable[str]) -> dict[str, str]:
    """Return a file name's stem for each name: letters and digits of any script, `-`, `_` and `.`, no two alike.

    Names that only differ in what cannot stand in a file name, or in case, are numbered. A name stays within 100 bytes, its
    number apart, and is none that Windows reserves.
    """
    taken: set[str] = set()
    stems: dict[str, str] = {}
    for name in names:
        stem = plain = _stem(name)
        number = 1
        while stem.casefold() in taken:
            number += 1
            stem = f"{plain}-{number}"
        taken.add(stem.casefold())
        stems[name] = stem
    return stems


_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def _stem(name: str) -> str:
    stem = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", name)).strip("._-")
    stem = stem.encode("utf-8")[:100].decode("utf-8", "ignore").rstrip("._-") or "unnamed"
    return f"_{stem}" if _RESERVED.fullmatch(stem) else stem

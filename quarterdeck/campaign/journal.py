"""The journal of a campaign: one line a run, written when the run is done, so that nothing done is ever done again."""

import fcntl
import json
import os
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.version import VERSION


class Journal:
    """`runs.jsonl` in a folder: a header, then a row a run. Locked while open; `rows` are those of earlier sessions too.

    Raises InputError on opening if another campaign has it open, or it belongs to another study and not `force`.
    """

    def __init__(self, folder: Path, study_hash: str, *, force: bool = False) -> None:
        path = folder / "runs.jsonl"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.file: BinaryIO = path.open("a+b")
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); choose another folder with -o") from None
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self.file.close()
            raise InputError(
                f"{folder}: another campaign is writing there; wait for it, or choose another folder"
            ) from None
        header = {"study": study_hash, "version": VERSION}
        found, self.rows = self._read()
        if found is not None and found != header and not force:
            self.file.close()
            raise InputError(
                f"{folder} holds the runs of another study, plan or version; give --force to start anew, or another folder"
            )
        if found != header:
            self.file.truncate(0)
            self.rows = {}
            try:
                self._append(header)
            except InputError:
                self.__exit__(None, None, None)
                raise

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Close and unlock."""
        with suppress(OSError):  # what could not be written was told by `add`
            self.file.close()

    def add(self, row: dict[str, Any]) -> None:
        """Keep the row of a run that is done; it is on the disk when this returns. Raises InputError if it cannot be."""
        if row["number"] not in self.rows:
            self.rows[row["number"]] = row
            self._append(row)

    def _read(self) -> tuple[dict[str, Any] | None, dict[int, dict[str, Any]]]:
        """Return the header and the rows; a last line that was cut short, as by a kill, is taken off."""
        self.file.seek(0)
        data = self.file.read()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            self.file.truncate(whole)
        try:
            lines = [json.loads(line) for line in data[:whole].splitlines()]
            return (lines[0] if lines else None), {row["number"]: row for row in lines[1:]}
        except (ValueError, KeyError, TypeError):
            return {}, {}

    def _append(self, document: dict[str, Any]) -> None:
        try:
            self.file.seek(0, os.SEEK_END)
            self.file.write(json.dumps(document, separators=(",", ":")).encode() + b"\n")
            self.file.flush()
            os.fsync(self.file.fileno())
        except OSError as error:
            raise InputError(
                f"{self.file.name} cannot be written ({error.strerror}); give the same command once it can: no run is lost"
            ) from None

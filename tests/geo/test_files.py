"""Writing files: whole or not at all, all or none, never where they do not belong."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import safe_names, write_file, write_files


def test_files_that_belong_together_are_written_all_or_none(tmp_path):
    """When the last of three cannot be written none is there, nothing is left beside, and what stood stands."""
    (tmp_path / "a").write_text("old")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="folder cannot be written"):
        write_files({tmp_path / "a": "new", tmp_path / "b": "new", tmp_path / "folder": "new"}, force=True)
    assert (tmp_path / "a").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "folder"]


def test_one_that_stands_already_stops_all(tmp_path):
    """Without force nothing is written where one of them exists."""
    (tmp_path / "b").write_text("old")
    with pytest.raises(InputError, match="--force"):
        write_files({tmp_path / "a": "new", tmp_path / "b": "new"})
    assert not (tmp_path / "a").exists()


def test_a_disk_that_is_full_leaves_nothing(tmp_path, monkeypatch):
    """An error in the middle of writing takes the half-written file away, and tells its name."""
    path = tmp_path / "a"
    path.write_text("old")

    class Full:
        def __init__(self, handle, mode):  # noqa: ARG002
            os.close(handle)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def write(self, data):  # noqa: ARG002
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("quarterdeck.geo.files.os.fdopen", Full)
    with pytest.raises(InputError, match="No space left"):
        write_file(path, "new", force=True)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


@given(st.lists(st.text(max_size=150), min_size=1, max_size=6, unique=True))
@settings(deadline=None, max_examples=300)
def test_no_name_leads_out_of_its_folder(names):
    """Whatever a vehicle is called, its file is in the folder, its name fits, and no two share one."""
    stems = safe_names(names)
    assert len({stem.casefold() for stem in stems.values()}) == len(names)
    for stem in stems.values():
        path = Path("/out") / f"{stem}.gpx"
        assert path.parent == Path("/out")
        assert path.resolve() == path
        assert stem not in ("", ".", "..")
        assert len(stem.encode()) <= 110


def test_a_pipe_is_written_into_not_over(tmp_path):
    """What is no file, such as /dev/null, takes what is written, stays what it is, and needs no force."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool:
        heard = pool.submit(pipe.read_bytes)
        write_file(pipe, "words")
    assert heard.result() == b"words"
    assert pipe.is_fifo()


def test_a_link_is_written_through(tmp_path):
    """A link to a file stays a link; the file that it names is the one overwritten."""
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "file").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real" / "file")
    write_file(tmp_path / "link", "new", force=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "file").read_text() == "new"

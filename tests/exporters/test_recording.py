"""The recording, as rerun's own tools read it."""

import subprocess
import sys
from pathlib import Path

import pytest

from quarterdeck.exporters.recording import recording

RERUN = Path(sys.executable).with_name("rerun")


@pytest.mark.skipif(not RERUN.exists(), reason="rerun's command is not installed")
def test_rerun_verifies_it_and_finds_the_same_twice(boats, tmp_path):
    """`rerun rrd verify` accepts it, and `compare` finds two recordings of one mission alike."""
    paths = [tmp_path / f"{i}.rrd" for i in (1, 2)]
    for path in paths:
        path.write_bytes(recording(boats))
    for command in (["verify", paths[0]], ["compare", "--unordered", *paths]):
        done = subprocess.run([RERUN, "rrd", *command], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

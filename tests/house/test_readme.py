"""The README and the documents: every command in them runs."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md"]


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a language in a page."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def run(command: list[str] | str, folder: Path) -> subprocess.CompletedProcess:
    """Run a command in a folder that has the sample sites in data/, with `quarterdeck` on the path."""
    tools = folder / "bin"
    tools.mkdir(exist_ok=True)
    script = tools / "quarterdeck"
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m quarterdeck "$@"\n')
    script.chmod(0o755)
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    shell = isinstance(command, str)
    return subprocess.run(
        command, cwd=folder, shell=shell, capture_output=True, text=True, check=False, env={**os.environ, "PATH": path}
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_every_command_runs(page, tmp_path):
    """Each quarterdeck command of a page, in order, ends with status 0, and each Python block runs."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    commands = [c for b in blocks(page, "sh") for c in b.replace("\\\n", " ").splitlines() if c.startswith("quarterdeck ")]
    assert commands
    for command in commands:
        done = run(command, tmp_path)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    for code in blocks(page, "python"):
        done = run([sys.executable, "-c", code], tmp_path)
        assert done.returncode == 0, f"{code}\n{done.stderr}"


def test_every_target_is_in_the_makefile():
    """Each `make` target that a document names exists."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    for page in [*PAGES, ROOT / "CONTRIBUTING.md"]:
        named = set(re.findall(r"`make ([a-z-]+)`", page.read_text(encoding="utf-8")))
        named |= {m for b in blocks(page, "sh") for m in re.findall(r"^make ([a-z-]+)", b, flags=re.MULTILINE)}
        assert named <= targets, f"{page.name}: {named - targets}"

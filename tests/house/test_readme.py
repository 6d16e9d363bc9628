"""What the README and CONTRIBUTING have `make` do exists; the README's own commands are run in test_docs.py."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a language in a page."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_every_target_is_in_the_makefile():
    """Each `make` target that a document names exists."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    for page in PAGES:
        named = set(re.findall(r"`make ([a-z-]+)`", page.read_text(encoding="utf-8")))
        named |= {m for b in blocks(page, "sh") for m in re.findall(r"^make ([a-z-]+)", b, flags=re.MULTILINE)}
        assert named <= targets, f"{page.name}: {named - targets}"

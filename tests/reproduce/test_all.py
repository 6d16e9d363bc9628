"""docs/reproduce.md is what the commands print."""

from pathlib import Path

from click.testing import CliRunner

from quarterdeck.cli import group
from quarterdeck.reproduce.all import PAPERS, section
from quarterdeck.reproduce.ecdis import command as ecdis

PAGE = (Path(__file__).parents[2] / "docs" / "reproduce.md").read_text(encoding="utf-8")


def test_the_page_has_what_the_command_prints() -> None:
    """The study without clocks and chance, to the letter; and a table of another."""
    words, text, status = section("inspection")
    assert status == 0
    assert f"    {words}\n\n```text\n{text}```\n" in PAGE
    table = CliRunner().invoke(ecdis, ["--table", "delta"]).stdout
    assert "\n".join(line.rstrip() for line in table.strip().splitlines()) in PAGE


def test_all_papers_are_on_the_page_and_in_the_command() -> None:
    """Four headings, each over the command of its study; `reproduce all` is a command."""
    for paper, title in PAPERS.items():
        assert f"## {title}\n\n    quarterdeck reproduce {paper}\n" in PAGE
    assert CliRunner().invoke(group, ["reproduce", "all", "--help"]).exit_code == 0


def test_the_claims_of_the_page_hold() -> None:
    """No claim that we make failed when the page was made."""
    assert "DOES NOT HOLD" not in PAGE
    assert "FAILS" not in PAGE
    assert PAGE.count("holds: ") >= 5

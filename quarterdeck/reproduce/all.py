"""`quarterdeck reproduce all`: every table of the four papers beside ours, one study after another.

`docs/generate.py` makes docs/reproduce.md of the same sections.
"""

import contextlib
import io
from importlib import import_module

import click

PAPERS = {
    "ecdis": "Simulated Annealing-Based Optimization for the Coverage Path Planning of Multiple USVs in ECDIS (Li et al.)",
    "guards": "Fault-Tolerant Multi-Robot Area Coverage with Limited Visibility (Fazli et al.)",
    "inspection": "Evolutionary-based Coordination of Multi-Robot Systems with Dynamic Constraints (U. of Virginia)",
    "triage": "Toward Robotic Triage: a Distributed Task and Motion Planning Framework (Weaver et al. 2025)",
}


@click.command(short_help="All four papers, one after another.")
def command() -> int:
    """Print every table of the four papers beside ours, with what matches, what does not and why.

    Takes about a minute of one core. Exit status 1 if a claim that we make does not hold.
    """
    worst = 0
    for paper, title in PAPERS.items():
        words, text, status = section(paper)
        click.echo(f"== {title}\n$ {words}\n\n{text}")
        worst = max(worst, status)
    return worst


def section(paper: str) -> tuple[str, str, int]:
    """Run a paper's study with its defaults; return its command, what it prints and its exit status."""
    study: click.Command = import_module(f"quarterdeck.reproduce.{paper}").command
    with contextlib.redirect_stdout(io.StringIO()) as out:
        status = study.main([], prog_name=paper, standalone_mode=False)
    text = "\n".join(line.rstrip() for line in out.getvalue().strip().splitlines())
    return f"quarterdeck reproduce {paper}", text + "\n", status or 0

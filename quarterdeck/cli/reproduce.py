"""`quarterdeck reproduce`: the papers' tables beside ours."""

import click

from quarterdeck.cli import LazyGroup

PAPERS: dict[str, str] = {
    "all": "All four papers, one after another.",
    "inspection": "Case studies of tasks with priority, time and precedence.",
    "ecdis": "Coverage by several USVs beside an ECDIS.",
    "guards": "Limited visibility, any failures: figures, properties, theorems, complexities.",
    "triage": "Table I and Figs 6 to 9 of the triage paper.",
}


@click.command(cls=LazyGroup, package="quarterdeck.reproduce", verbs=PAPERS)
def command() -> None:
    """Print a paper's tables beside ours, with what matches, what does not and why."""

"""The three state machines of Weaver et al. 2025, Figs 3 to 5, as tables: (state, event, action, next).

The director looks up what comes next here and nowhere else; the diagrams in the docs are drawn from here. Rows that the
figures do not show keep a reported casualty from being lost when somebody fails, bring a robot home on what its battery
has left, or end the mission: they are `extra`.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Row(NamedTuple):
    """In `state`, on `event`, do `action` and go to `next`."""

    state: str
    event: str
    action: str
    next: str
    extra: bool = False


UGV = (
    Row("explore", "casualty seen", "note it", "explore"),
    Row("explore", "urgent casualty seen", "note it, drive to it", "continued explore"),
    Row("explore", "section searched", "go and report", "deliver"),
    Row("continued explore", "casualty seen", "note it", "continued explore"),
    Row("continued explore", "urgent casualty seen", "note it", "continued explore"),
    Row("continued explore", "N urgent ones gathered", "note it, go and report", "deliver"),
    Row("continued explore", "centre reached, urgent ones left", "drive to the last seen", "continued explore"),
    Row("continued explore", "centre reached, none left", "go and report", "deliver"),
    Row("deliver", "casualty seen", "note it", "deliver"),
    Row("deliver", "handed over", "drive back", "return"),
    Row("deliver", "nobody there", "wait", "wait"),
    Row("deliver", "handed over, receipt due", "wait", "wait", extra=True),
    Row("deliver", "receipt in hand", "stop", "done", extra=True),
    Row("deliver", "nobody to report to", "tell undeliverable", "return", extra=True),
    Row("deliver", "all over, nobody to report to", "tell undeliverable, stop", "done", extra=True),
    Row("wait", "casualty seen", "note it", "wait"),
    Row("wait", "handed over", "drive back", "return"),
    Row("wait", "handed over, receipt due", "wait", "wait", extra=True),
    Row("wait", "receipt in hand", "stop", "done", extra=True),
    Row("wait", "patience over", "look for a medic", "seek", extra=True),
    Row("seek", "casualty seen", "note it", "seek", extra=True),
    Row("seek", "handed over", "drive back", "return", extra=True),
    Row("seek", "handed over, receipt due", "wait", "wait", extra=True),
    Row("seek", "receipt in hand", "stop", "done", extra=True),
    Row("seek", "not found", "search the field", "seek", extra=True),
    Row("seek", "nobody to report to", "tell undeliverable", "return", extra=True),
    Row("seek", "all over, nobody to report to", "tell undeliverable, stop", "done", extra=True),
    Row("done", "section overdue", "take it over", "return", extra=True),
    Row("return", "casualty seen", "note it", "return"),
    Row("return", "urgent casualty seen", "note it, drive to it", "continued explore"),
    Row("return", "back where it left", "resume the path", "explore"),
    *(
        Row(state, "battery low", "drive home, past the rendezvous if it has to report", "home", extra=True)
        for state in ("explore", "continued explore", "deliver", "wait", "seek", "return", "done")
    ),
    Row("home", "casualty seen", "note it", "home", extra=True),
)

UAV = (
    Row("rendezvous", "list received", "fly to the medic", "deliver"),
    Row("rendezvous", "arrived", "hover", "rendezvous"),
    Row("deliver", "list received", "fly to the medic", "deliver"),
    Row("deliver", "all delivered", "fly to the rendezvous", "return"),
    Row("deliver", "delivered, another medic's left", "fly to the medic", "deliver", extra=True),
    Row("deliver", "not found", "search the field", "deliver", extra=True),
    Row("deliver", "given up, another medic left", "fly to the medic", "deliver", extra=True),
    Row("deliver", "nobody to report to", "tell undeliverable", "return", extra=True),
    Row("return", "list received", "fly to the medic", "deliver"),
    Row("return", "arrived", "hover", "rendezvous"),
    *(Row(state, "battery low", "fly home and land", "home", extra=True) for state in ("rendezvous", "deliver", "return")),
)

MEDIC = (
    Row("idle", "casualty learnt", "plan the path", "plan"),
    Row("plan", "path planned", "walk to the first", "go"),
    Row("go", "casualty learnt", "plan the path", "plan"),
    Row("go", "arrived", "treat", "treat"),
    Row("go", "arrived, nobody there", "look around", "go", extra=True),
    Row("go", "looked around in vain", "strike it off", "plan", extra=True),
    Row("go", "arrived, already treated", "strike it off", "plan", extra=True),
    Row("treat", "casualty learnt", "plan the path", "treat"),
    Row("treat", "treated", "strike it off", "plan"),
    Row("plan", "nothing left", "stay", "idle"),
    Row("plan", "nothing left, device dead", "walk to the rendezvous", "fetch", extra=True),
    Row("idle", "device dead", "walk to the rendezvous", "fetch", extra=True),
    Row("fetch", "casualty learnt", "plan the path", "plan", extra=True),
    Row("fetch", "arrived", "take the spare device", "idle", extra=True),
    Row("fetch", "heard again", "stay", "idle", extra=True),
    Row("idle", "section overdue", "walk to a UGV that is done", "call", extra=True),
    Row("call", "casualty learnt", "plan the path", "plan", extra=True),
    Row("call", "device dead", "walk to the rendezvous", "fetch", extra=True),
    Row("call", "arrived", "stay", "idle", extra=True),
)

MACHINES: Mapping[str, tuple[Row, ...]] = MappingProxyType({"ugv": UGV, "uav": UAV, "medic": MEDIC})
START = {"ugv": "explore", "uav": "return", "medic": "idle"}
TITLES = {"ugv": "UGV (Fig. 3)", "uav": "UAV (Fig. 4)", "medic": "Medic (Fig. 5)"}
_LOOKUP = {kind: {(r.state, r.event): r for r in rows} for kind, rows in MACHINES.items()}


def step(kind: str, state: str, event: str) -> Row | None:
    """Return the row of the machine of `kind` (ugv, uav, medic) for an event; None where the event changes nothing."""
    return _LOOKUP[kind].get((state, event))


def as_markdown(kind: str) -> str:
    """Return a machine as a Mermaid state diagram, which GitHub draws, of the figure's rows, and the table of all rows."""
    rows = MACHINES[kind]
    drawn = [r for r in rows if not r.extra]
    key = {s: s.replace(" ", "_") for r in drawn for s in (r.state, r.next)}
    lines = [f"## {TITLES[kind]}", "", "```mermaid", "stateDiagram-v2", f"    [*] --> {key[START[kind]]}"]
    lines += [f'    state "{s}" as {k}' for s, k in key.items() if s != k]
    lines += [f"    {key[r.state]} --> {key[r.next]}: {r.event} / {r.action}" for r in drawn]
    lines += ["```", "", "| state | event | action | next | in the figure |", "|---|---|---|---|---|"]
    lines += [f"| {r.state} | {r.event} | {r.action} | {r.next} | {'no' if r.extra else 'yes'} |" for r in rows]
    return "\n".join(lines) + "\n"

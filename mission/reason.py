"""Why something cannot be done: a line for people; for code the kind of it, and the id that it is about."""

from dataclasses import dataclass
from typing import Literal

from quarterdeck.geo.errors import InputError

Kind = Literal["", "energy", "undone", "late", "task", "vehicle", "end", "track", "plan"]
HEADS: dict[Kind, str] = {
    "": "",  # nothing acts upon it
    "energy": "{}: ",  # a vehicle's energy or time does not suffice for its route
    "undone": "task {!r} can no longer be done: ",
    "late": "task {!r}: ",  # is done after its window
    "task": "task {!r}: ",  # can be done by nobody
    "vehicle": "vehicle {!r}: ",  # cannot get from its start to its end
    "end": "{}: ",  # a vehicle that does not come to its end
    "track": "{}: ",  # there is no log of a vehicle
    "plan": "",  # no new plan could be made
}


@dataclass(frozen=True, slots=True)
class Reason:
    """`why`, and what of: its `kind` and the id that it is `about`. As a text it is one line that names it."""

    why: str
    kind: Kind = ""
    about: str = ""

    def __str__(self) -> str:
        """Return the line for people."""
        return HEADS[self.kind].format(self.about) + self.why


def reason_of(line: str, kind: Kind, about: str) -> Reason:
    """Return the reason whose line is `line`; of no kind where a reason of that kind does not read so."""
    head = HEADS[kind].format(about)
    return Reason(line.removeprefix(head), kind, about) if line.startswith(head) else Reason(line)


class ImpossibleError(InputError):
    """No plan can be made, for a `reason` with which a caller may do something, such as leave a task out."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(str(reason))
        self.reason = reason

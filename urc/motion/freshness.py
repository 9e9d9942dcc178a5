"""The freshness of control inputs, without trust in the clock of a page.

The server sends numbered beats to every page. An input carries the newest beat that its page has
received, the epoch of its lease, and a number of its own. So the server refuses an input that was
buffered, recorded and replayed, or sent under an earlier lease. No clocks are compared.
"""

from collections import deque
from typing import Final, NamedTuple

__all__ = ["OLDEST_S", "DuplicateElimination", "Freshness", "ControlInput"]

OLDEST_S: Final = 0.4
"""Greatest age of the beat that an input echoes, in seconds."""
_KEPT: Final = 64


class ControlInput(NamedTuple):
    """The numbers that a page sends with every tick of a held control."""

    epoch: int
    """Epoch of the lease."""
    number: int
    """Number of the tick; it grows with every tick of this page."""
    echo: int
    """Newest beat of the server that the page has received."""


class Freshness:
    """The beats sent to one page, and its newest input for each control."""

    def __init__(self, first: int = 1) -> None:
        """Begin without beats.

        Args:
            first: number of the first beat. An unpredictable one refuses inputs that were recorded
                before a restart.
        """
        self._issued: deque[float] = deque(maxlen=_KEPT)
        """Times at which the newest beats were sent. Their numbers are consecutive."""
        self._number = first - 1
        self._newest: dict[str, int] = {}

    def issue(self, now: float) -> int:
        """Return the number of a beat that is sent to the page now."""
        self._number += 1
        self._issued.append(now)
        return self._number

    def refusal(self, given: ControlInput, epoch: int, now: float, of: str = "") -> str:
        """Return the reason to refuse an input; accept it and return "" if there is no reason.

        Args:
            given: the numbers that the page sent with the input.
            epoch: epoch of the present lease.
            now: the time.
            of: the control. Each control has an order of its own.
        """
        if given.epoch != epoch:
            return f"it belongs to lease {given.epoch}, and this is {epoch}"
        if given.number <= self._newest.get(of, -1):
            return "it is not newer than the last one"
        back = self._number - given.echo
        if not 0 <= back < len(self._issued):
            return "it answers no tick of this server"
        issued_at = self._issued[-1 - back]
        if now - issued_at > OLDEST_S:
            return f"it is {(now - issued_at) * 1000:.0f} ms old"
        self._newest[of] = given.number
        return ""


class DuplicateElimination:
    """A filter for messages that a page sends twice, on two lines that lose packets independently.

    The first copy counts. The numbers of a page only grow, and each line keeps their order. A
    number that is not above the newest one arrived on the other line already, or a newer message
    overtook it there. A delayed tick must not move a control that was released on the other line.
    """

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def accept(self, about: str, number: int) -> bool:
        """Return whether `number` is the highest so far for `about`, and store it."""
        if number <= self._newest.get(about, 0):
            return False
        self._newest[about] = number
        return True

"""Freshness checks for control inputs, independent of the browser's clock.

The server sends numbered heartbeats to every page. Each input contains the number of the newest
heartbeat received by its page, the epoch of its lease, and a sequence number. The server can
therefore refuse inputs that were buffered, recorded and replayed, or sent under an earlier lease.
The clocks of different machines are never compared. `urc.motion.link_age` contains the limits for
pages of other sites.
"""

from collections import deque
from typing import Final, NamedTuple

from urc.motion import link_age
from urc.motion.link_age import LinkAge

__all__ = ["OLDEST_S", "DuplicateElimination", "Freshness", "ControlInput"]

OLDEST_S: Final = 0.4
"""Maximum age of the heartbeat that an input echoes, in seconds."""
_KEPT: Final = 64


class ControlInput(NamedTuple):
    """The numbers that a page sends with every tick of a held control."""

    epoch: int
    """Epoch of the lease under which the input was sent."""
    number: int
    """Number of the tick, which increases with every tick from this page."""
    echo: int
    """Number of the newest heartbeat that the page has received from the server."""


class Freshness:
    """The heartbeats sent to one page and the page's newest input for each control."""

    def __init__(self, first: int = 1, link: LinkAge | None = None) -> None:
        """Start before the first heartbeat.

        Args:
            first: number of the first heartbeat. If the number is unpredictable, inputs that were
                recorded before a restart are refused.
            link: ages of the inputs of a page of another site; None for a page of this site.
        """
        self.link = link
        self._issued: deque[float] = deque(maxlen=_KEPT)
        """Send times of the newest heartbeats, which have consecutive numbers."""
        self._number = first - 1
        self._newest: dict[str, int] = {}

    def issue(self, now: float) -> int:
        """Return a new heartbeat's number, which the caller must send to the page immediately."""
        self._number += 1
        self._issued.append(now)
        return self._number

    def refusal(self, given: ControlInput, epoch: int, now: float, of: str = "") -> str:
        """Return the reason for refusing an input, or store a valid input's number and return "".

        Args:
            given: the numbers sent with the input.
            epoch: epoch of the current lease.
            now: the current time.
            of: the control. Sequence numbers are checked separately for each control.
        """
        if given.epoch != epoch:
            return f"the input belongs to lease {given.epoch}, but the current lease is {epoch}"
        if given.number <= self._newest.get(of, -1):
            return "the input is not newer than the previous input"
        back = self._number - given.echo
        if not 0 <= back < len(self._issued):
            return "the input does not echo a heartbeat of this server"
        late_s = now - self._issued[-1 - back]
        if self.link is None:
            is_late = late_s > OLDEST_S
        else:
            late_s = self.link.measure(late_s, now)
            is_late = late_s >= link_age.TOO_OLD_S
        if is_late:
            return f"Link too slow: your input arrived {late_s * 1000:.0f} ms late"
        self._newest[of] = given.number
        return ""

    def release(self, number: int, of: str = "") -> None:
        """Store the number of a release, so that earlier inputs for this control no longer count.

        Args:
            number: number of the release, counted together with the inputs; 0 means no number.
            of: the released control.
        """
        self._newest[of] = max(number, self._newest.get(of, 0))


class DuplicateElimination:
    """Drops the second copy of each message that a page sends over two lossy connections.

    Only the first copy of a message takes effect. A page's numbers only increase, and each
    connection preserves their order. A message with a lower or equal number is therefore either a
    copy or outdated. A delayed tick must not reactivate a control that was released over the other
    connection.
    """

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def accept(self, about: str, number: int) -> bool:
        """Return whether `number` is the highest number so far for `about`; if so, store it."""
        if number <= self._newest.get(about, 0):
            return False
        self._newest[about] = number
        return True

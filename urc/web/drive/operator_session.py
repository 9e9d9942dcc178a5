"""The state of one page of a robot: pending ticks, pending notices and lease.

Layer 5.
"""

import secrets
from collections.abc import Callable
from typing import Final, Protocol

from urc.motion.driving_lock import SentImages
from urc.motion.freshness import DuplicateElimination
from urc.motion.lease import LeaseState, Operator
from urc.motion.link_age import LinkState
from urc.motion.rate_limiter import RateLimiter
from urc.runtime.clock import Timer
from urc.web.feed.client_socket import FixedRights, PeerRights
from urc.web.wire import drive as wire

__all__ = ["FLOOD", "OperatorSession", "RedundantLine"]

FLOOD = 4
"""Maximum number of ticks accepted while another tick is pending. Further ticks stay in the
socket's buffer."""


_DRIVES: Final = FixedRights()


class RedundantLine(Protocol):
    """A redundant socket, as seen by a session; see `urc.web.drive.redundant_socket`."""

    def heartbeat(self, number: int, link: LinkState | None) -> None:
        """Send a heartbeat number, and the state of a link from another site, to the page."""

    def end(self) -> None:
        """Close the socket."""


class OperatorSession:
    """The server's state for one page of a robot."""

    def __init__(
        self, client: Operator, wake: Callable[[], None], rights: PeerRights = _DRIVES
    ) -> None:
        self.client = client
        self.own_name = client.name
        """Name from the sign-in, or number of the screen."""
        self.rights = rights
        """The current rights; `client` contains the role from the last check."""
        self.wake = wake
        self.heartbeat: int | None = None
        self.on_role: set[Callable[[], None]] = set()
        """Callbacks that are called after each change of the role in `client`."""
        self.notices: dict[str, str] = {}
        """Newest unsent notice about each control or lease request, keyed by name."""
        self.seen = -1
        """Number of the newest lease sent to the page."""
        self.pending: dict[str, wire.Tick | bytes] = {}
        """Newest pending tick of each control, decoded or as raw bytes."""
        self.paces: dict[str, RateLimiter] = {}
        self.alarms: dict[str, Timer] = {}
        self.moved_s: dict[str, float] = {}
        """Time at which the last tick of each control was applied, in seconds."""
        self.moved_at_s = float("-inf")
        """Time at which the last tick of any control was applied, in seconds."""
        self.images = SentImages()
        """The images that the page has received, for the driving lock."""
        self.key = secrets.token_urlsafe(16)
        """Secret key that a redundant socket needs in order to join the page."""
        self.spare: RedundantLine | None = None
        self.doubled: DuplicateElimination | None = None
        """Filter for duplicate messages, set once the page has opened a redundant socket."""
        self.hold_back: Callable[[bool], None] = _nothing
        """Callback that pauses (True) or resumes (False) reading from the page's socket."""
        self.crowd = 0
        """Number of ticks received since the first pending tick; too many ticks pause the
        socket."""
        self.dropped = 0
        """Number of pending ticks replaced by newer ticks."""

    def notice(self, key: str, text: str) -> None:
        """Queue a notice; it replaces an unsent notice with the same key."""
        self.notices[key] = text
        self.wake()

    def lease(
        self, state: LeaseState, now: float, *, is_confirmed: bool, override_s: float = 0.0
    ) -> str:
        """Return the lease message for the page."""
        left_s = max(0.0, state.asked_until - now) if state.asked_by is not None else 0.0
        return wire.encode_lease(
            state,
            self.client,
            left_s=left_s,
            is_confirmed=is_confirmed,
            spare=self.key,
            override_s=override_s,
        )

    def is_first(self, about: str, number: int) -> bool:
        """Return whether a message is new, according to its number."""
        return self.doubled is None or not number or self.doubled.accept(about, number)

    def forget(self, command: str) -> None:
        """Drop the pending tick of a control."""
        self.pending.pop(command, None)
        alarm = self.alarms.pop(command, None)
        if alarm is not None:
            alarm.cancel()
            self.relax()

    def relax(self) -> None:
        """Resume reading from the page's socket."""
        if self.crowd >= FLOOD:
            self.hold_back(False)
        self.crowd = 0


def _nothing(is_held: bool) -> None:
    """Do nothing, because this socket cannot be paused."""

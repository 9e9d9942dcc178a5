"""One screen at the controls of a robot: what it is to be told, and what of it waits.

Floor 5.
"""

import secrets
from collections.abc import Callable, Mapping
from typing import Protocol

from urc.model.codec import Payload
from urc.model.values import Reading
from urc.motion.fresh import FirstOfTwo
from urc.motion.lease import Client, LeaseState
from urc.motion.pace import Pace
from urc.protocol.events import Replied
from urc.runtime.clock import Alarm
from urc.runtime.hub import Hub
from urc.runtime.motion import Frames, Movers
from urc.web.wire import drive as wire

__all__ = ["FLOOD", "Drivable", "Seat", "SpareLine"]

FLOOD = 4
"""Ticks that come while one waits already; then the rest may wait with it, before it is read."""


class SpareLine(Protocol):
    """A second line of a screen, see `urc.web.drive.spare`."""

    def beat(self, number: int) -> None:
        """Tell it a number."""

    def end(self) -> None:
        """Take nothing more from it."""


class Drivable(Protocol):
    """The part of a session that the controls need."""

    @property
    def frames(self) -> Frames:
        """The engine."""

    @property
    def movers(self) -> Movers | None:
        """Who writes motion; None where the robot has no held command."""

    @property
    def hub(self) -> Hub:
        """Takes what everybody should know."""

    async def command(
        self,
        name: str,
        arguments: Mapping[str, Reading],
        *,
        on_sent: Callable[[Payload], None] | None = None,
    ) -> Replied:
        """Run one command and return its reply; raise `CommandFailed` when there is none."""

    def latch(self, reason: str) -> None:
        """End sequences, and begin nothing that moves by itself; "" lets it be begun again."""


class Seat:
    """One screen at the controls."""

    def __init__(self, client: Client, wake: Callable[[], None]) -> None:
        self.client = client
        self.wake = wake
        self.beat: int | None = None
        self.notices: dict[str, str] = {}
        """Control or verb → the newest line about it."""
        self.seen = -1
        """Number of the lease that it was told."""
        self.pending: dict[str, wire.Tick | bytes] = {}
        """Control → the newest tick that waits to be looked at; read by then, or not."""
        self.paces: dict[str, Pace] = {}
        self.alarms: dict[str, Alarm] = {}
        self.moved_s: dict[str, float] = {}
        """Control → when a tick of it was last taken, ..."""
        self.moved_at_s = float("-inf")
        """... and of any."""
        self.key = secrets.token_urlsafe(16)
        """By which a second line says that it is this screen's."""
        self.spare: SpareLine | None = None
        self.doubled: FirstOfTwo | None = None
        """Which of two comes first, since it had a second line."""
        self.hold_back: Callable[[bool], None] = _nothing
        """Lets nothing more be read from its line for now, or lets it go on."""
        self.crowd = 0
        """Ticks that came since one had to wait; more than a few are a flood."""
        self.dropped = 0
        """Ticks that a newer one took the place of: nothing was made of them."""

    def notice(self, key: str, text: str) -> None:
        """Tell it; a newer line about the same replaces one that was not taken yet."""
        self.notices[key] = text
        self.wake()

    def lease(self, state: LeaseState, now: float, *, is_confirmed: bool) -> str:
        """Return who has the controls, as this screen is told."""
        left_s = max(0.0, state.asked_until - now) if state.asked_by is not None else 0.0
        return wire.encode_lease(
            state, self.client, left_s=left_s, is_confirmed=is_confirmed, spare=self.key
        )

    def is_first(self, about: str, number: int) -> bool:
        """Return whether this was not said on the other line already, or something newer."""
        return self.doubled is None or not number or self.doubled.take(about, number)

    def forget(self, command: str) -> None:
        """Drop what waits of a control."""
        self.pending.pop(command, None)
        alarm = self.alarms.pop(command, None)
        if alarm is not None:
            alarm.cancel()
            self.relax()

    def relax(self) -> None:
        """Let its line be read again."""
        if self.crowd >= FLOOD:
            self.hold_back(False)
        self.crowd = 0


def _nothing(is_held: bool) -> None:
    """Nobody can hold its line back."""

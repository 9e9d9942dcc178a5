"""Detection of remote programs that freeze during motion."""

import asyncio
from collections.abc import Callable
from typing import Final

from urc.guard.send_queue import LaneClock, TimerHandle, why_broken
from urc.motion.liveness import ASKED_EVERY_S, SILENCE_S, Liveness
from urc.transports.arrival_check import ArrivalCheck
from urc.transports.base import SupportsProbe, Transport, TransportError

__all__ = ["LivenessWatch"]

_LOOK_S: Final = ASKED_EVERY_S


class LivenessWatch:
    """Watches whether the remote program of one transport freezes during motion."""

    def __init__(
        self,
        transport: Transport,
        clock: LaneClock,
        *,
        silent_s: float | None,
        is_moving: Callable[[], bool],
        failed: Callable[[str], None],
    ) -> None:
        """Create the watch.

        Args:
            transport: the transport, which is probed if it implements `SupportsProbe`.
            clock: the time source.
            silent_s: maximum silence of an unprobed robot, in seconds; None for no limit.
            is_moving: function that returns whether a control is moving the robot.
            failed: callback for a frozen program; it receives the reason.
        """
        self._transport = transport if isinstance(transport, SupportsProbe) else None
        self._arrivals = ArrivalCheck(transport)
        self._clock = clock
        self._silent_s = silent_s
        self._is_moving = is_moving
        self._failed = failed
        self._liveness = Liveness(silent_s)
        self._is_open = False
        self._alarm: TimerHandle | None = None
        self._asking: asyncio.Task[None] | None = None

    @property
    def is_able(self) -> bool:
        """Whether a freeze can be detected: by probes, or because a maximum silence is set."""
        return self._transport is not None or self._silent_s is not None

    def begin(self) -> None:
        """Record that the connection is open."""
        self._is_open = True
        self._liveness = Liveness(self._silent_s)
        self._arrivals.begin()
        self.note_delivery()

    def end(self) -> None:
        """Record that the connection is closed."""
        self._is_open = False
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        if self._asking is not None:
            self._asking.cancel()
            self._asking = None

    def note_delivery(self) -> None:
        """Record that the transport has delivered data, or that this machine paused reading.

        If the transport counts what arrives, only the count shows whether the program is alive.
        """
        if self._arrivals.is_new():
            self._liveness.note_arrival(self._clock.now())

    def start(self) -> None:
        """Start the watch if a control is moving the robot."""
        if self._alarm is None and self._is_open and self.is_able and self._is_moving():
            self._check()

    def _check(self) -> None:
        self._alarm = None
        if not (self._is_open and self._is_moving()):
            return
        if self._arrivals.is_counted:  # data may have arrived without a delivery
            self.note_delivery()
        now = self._clock.now()
        if now >= self._liveness.deadline:
            ms = 1000 * (SILENCE_S if self._liveness.is_asked else self._silent_s or SILENCE_S)
            self._failed(f"the remote program has sent no data for {ms:.0f} ms during motion")
            return
        if self._transport is not None:
            self._liveness.asked(now)
            if self._asking is None:
                self._asking = asyncio.get_running_loop().create_task(
                    self._send_probe(self._transport)
                )
        at_s = min(now + _LOOK_S, self._liveness.deadline)
        self._alarm = self._clock.call_at(at_s, self._check)

    async def _send_probe(self, transport: SupportsProbe) -> None:
        try:
            await transport.probe()
            self._liveness.note_arrival(self._clock.now())
        except TransportError:
            pass  # the connection's reader reports it
        except Exception as bug:  # supervisor: a third-party transport may raise anything
            why_broken(bug)
        finally:
            if self._asking is asyncio.current_task():
                self._asking = None

"""The movers of a session: its lines behind the guard, and the backend of its `MotionDesk`."""

import logging
from collections.abc import Mapping, Sequence
from typing import Final

from urc.guard import wire
from urc.guard.client import CAN_GUARD, Client, Guard, LineSpec, LocalGuard
from urc.model.codec import Payload, Series
from urc.model.driver import Driver, TransportSpec
from urc.model.values import Value
from urc.motion.hold import Mover, Reason, Terms
from urc.motion.stall import STALLED_S, WAITED_S
from urc.problems import UrcError
from urc.registry import Table
from urc.runtime.clock import Clock
from urc.runtime.held import Frames, is_lossy, period_of
from urc.runtime.lines import Made, make_lines
from urc.transports.base import Transport

__all__ = ["GuardedMovers", "take_reins"]

_DEAR: Final = frozenset(("ssh", "serial", "mqtt", "rosbridge"))
"""Kinds of line that are not reset lightly: opening them afresh takes long, or cannot be done."""

_SOONER: Final = 0.9

log = logging.getLogger(__name__)


class GuardedMovers:
    """What a desk moves and stops; both ways of `Motion`."""

    def __init__(self, driver: Driver, client: Client) -> None:
        """Prepare; nothing runs before `start`.

        Args:
            driver: whose held commands these are.
            client: of the guard.
        """
        self._driver = driver
        self.client = client
        self.tick = client.tick
        self._known: dict[str, Terms] = {}
        """Of every control that was armed or stopped."""

    @property
    def transports(self) -> Mapping[str, Transport]:
        """The lines, for the links of the session."""
        return self.client.transports

    def start(self) -> None:
        """Begin; needs a running loop."""
        self.client.start()

    def stop_all(self, frames: Frames) -> None:
        """Stop what may be moving, with the frames as they are now."""
        stops: dict[str, Payload | Series] = {}
        for name, terms in self._known.items():
            if self.is_stopping(name):
                try:
                    stops[name] = frames.stop_frame(name)
                except UrcError:
                    stops[name] = _stop_in(terms)
        self.stop(stops)

    def is_stopping(self, command: str) -> bool:
        """Return whether `command` may be moving, or its stop may still be repeated."""
        return self.client.is_stopping(command)

    async def finish(self) -> None:
        """Stop what may be moving, close every line, and leave nothing behind."""
        await self.client.finish()

    # -- `urc.runtime.motion.Movers`

    def arm(self, command: str, terms: Terms) -> None:
        """Take ticks of `command` from now on.

        Raises:
            UrcError: nothing would ever stop it under these terms.
        """
        try:
            Mover(terms)
        except ValueError as fault:
            raise UrcError(f"{command}: {fault}") from fault
        self._known[command] = terms
        self.client.arm(self._driver.commands[command].transport, command, terms)

    def renew(self, command: str, stop: Payload | Series) -> None:
        """Let `stop` be what stops `command` from now on; it arms nothing."""
        terms = self._known.get(command)
        if terms is not None:
            self._known[command] = terms.stopped_by(stop)
            self.client.renew(command, stop)

    def release(self, command: str) -> None:
        """Stop `command`, which was let go."""
        self.client.release(command)

    def stop(self, stops: Mapping[str, Payload | Series]) -> None:
        """Stop at once, whatever moves; these are the stop frames of all held commands."""
        if stops:
            self.client.stop([self._stop_of(command, frame) for command, frame in stops.items()])

    def is_open(self, command: str) -> bool:
        """Return whether the line of `command` is connected, by the newest word of the guard."""
        return self.client.transports[self._driver.commands[command].transport].is_open

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        """Wait for the next stop frames that were written: command, and why it stopped."""
        return await self.client.stops()

    def _stop_of(self, command: str, frame: Payload | Series) -> tuple[str, str, Terms]:
        known = self._driver.commands[command]
        terms = self._known.get(command)
        if terms is None:
            lossy = is_lossy(self._driver, known.transport)
            terms = Terms(b"", period_s=period_of(self._driver, known), is_lossy=lossy)
        terms = self._known[command] = terms.stopped_by(frame)
        return known.transport, command, terms


def _stop_in(terms: Terms) -> Payload | Series:
    return Series(terms.stops) if terms.stops else terms.stop


def take_reins(
    driver: Driver,
    settings: Mapping[str, Value],
    table: Table,
    clock: Clock,
    *,
    is_guarded: bool,
) -> GuardedMovers:
    """Return the movers of a robot, with its lines.

    Args:
        driver: as loaded.
        settings: a value for every setting.
        table: the kinds of transport.
        clock: the time, where there is no process of its own.
        is_guarded: whether there is.

    Raises:
        UrcError: a transport cannot be made with these settings.
    """
    lines = [_line(made, driver) for made in make_lines(driver, settings, table).values()]
    if is_guarded and CAN_GUARD:
        return GuardedMovers(driver, Guard(lines))
    if is_guarded:
        log.warning("there is no guard on this system: a server that hangs stops nothing")
    return GuardedMovers(driver, LocalGuard(lines, clock))


def _is_dear(spec: TransportSpec, driver: Driver) -> bool:
    """Return whether a line that takes nothing is waited for, and not reset at once."""
    said = {
        one.hold.on_stall
        for one in driver.commands.values()
        if one.hold is not None and one.transport == spec.name
    }
    if "abort" in said:  # the more careful of two that differ
        return False
    return "wait" in said or spec.type in _DEAR or bool(spec.via)


def _silent_s(spec: TransportSpec) -> float | None:
    """Return after which silence a line is reset while something moves; None: never.

    A little before the engine gives up its motion: what it writes then would wait where the motion
    waits. A line without a connection keeps nothing that a reset could throw away.
    """
    if spec.stale_after_s is None or spec.type in ("udp", "serial"):
        return None
    return spec.stale_after_s * _SOONER


def _line(made: Made, driver: Driver) -> LineSpec:
    setup, spec = made.setup, made.spec
    is_dear = _is_dear(spec, driver)
    make = wire.Make(
        line=setup.name,
        factory=made.factory,
        options=dict(setup.options),
        subscriptions=[(one.topic, dict(one.attributes)) for one in setup.subscriptions],
        via=spec.via,
        stalled_s=WAITED_S if is_dear else STALLED_S,
        is_strict=is_dear,
        silent_s=_silent_s(spec),
    )
    return LineSpec(make, made.transport)

"""Create a session's guard client for the driver's transports and held commands."""

import logging
from collections.abc import Mapping
from functools import partial
from typing import Final

from urc.guard import messages
from urc.guard.channel import GuardedLineSpec
from urc.guard.guard_client import GuardClient, HeldSpec
from urc.guard.local_channel import LocalChannel
from urc.guard.pipe_channel import CAN_GUARD, PipeChannel
from urc.model.driver import Command, Driver, TransportSpec
from urc.model.values import Value
from urc.motion.hold_to_run import HoldTerms
from urc.motion.stall import STALLED_S, WAITED_S
from urc.registry import Table
from urc.runtime.clock import Clock
from urc.runtime.held_commands import is_lossy, period_of, restored_s
from urc.runtime.transport_chain import BuiltTransport, make_lines

__all__ = ["start_guard_client"]

_SLOW_TO_OPEN: Final = frozenset(("ssh", "serial", "mqtt", "zenoh", "ros"))
"""Transport types that are not reset at once when they stall, because reopening is slow or may
fail."""

_SOONER: Final = 0.9

log = logging.getLogger(__name__)


def start_guard_client(
    driver: Driver,
    settings: Mapping[str, Value],
    table: Table,
    clock: Clock,
    *,
    is_guarded: bool,
) -> GuardClient:
    """Return a robot's guard client, with its transports.

    Args:
        driver: the loaded driver.
        settings: a value for every setting.
        table: the available transport types.
        clock: source of time for a guard in this process.
        is_guarded: whether to run the guard in a separate process.

    Raises:
        UrcError: a transport cannot be built with these settings.
    """
    made = make_lines(driver, settings, table).values()
    lines = [_line(one, driver) for one in made if not one.spec.is_camera]
    held = {
        name: _held(one, driver) for name, one in driver.commands.items() if one.hold is not None
    }
    if is_guarded and CAN_GUARD:
        return GuardClient(lines, held, PipeChannel)
    if is_guarded:
        log.warning(
            "this system cannot run a guard process: if the server hangs, robots are not stopped"
        )
    return GuardClient(lines, held, partial(LocalChannel, lines=lines, clock=clock))


def _held(command: Command, driver: Driver) -> HeldSpec:
    line = command.transport
    terms = HoldTerms(
        b"",
        period_s=period_of(driver, command),
        is_lossy=is_lossy(driver, line),
        restored_s=restored_s(driver, line),
    )
    return HeldSpec(line, terms)


def _is_slow_to_open(spec: TransportSpec, driver: Driver) -> bool:
    """Return whether a stalled transport is given extra time instead of being reset at once."""
    said = {
        one.hold.on_stall
        for one in driver.commands.values()
        if one.hold is not None and one.transport == spec.name
    }
    if "abort" in said:  # the safer of two different values
        return False
    return "wait" in said or spec.type in _SLOW_TO_OPEN or bool(spec.tunnel)


def _silent_s(spec: TransportSpec) -> float | None:
    """Return how long a transport may be silent during motion, in seconds; None means no limit.

    The result is slightly shorter than the engine's timeout, so that the engine's output does not
    queue up behind the motion frames. Transports without a connection have no limit, because a
    reset would not discard any unsent data.
    """
    if spec.stale_after_s is None or spec.type in ("udp", "serial"):
        return None
    return spec.stale_after_s * _SOONER


def _line(made: BuiltTransport, driver: Driver) -> GuardedLineSpec:
    setup, spec = made.setup, made.spec
    is_dear = _is_slow_to_open(spec, driver)
    make = messages.MakeTransport(
        line=setup.name,
        factory=made.factory,
        options=dict(setup.options),
        subscriptions=[(one.topic, dict(one.attributes)) for one in setup.subscriptions],
        tunnel=spec.tunnel,
        stalled_s=WAITED_S if is_dear else STALLED_S,
        is_strict=is_dear,
        silent_s=_silent_s(spec),
    )
    return GuardedLineSpec(make, made.transport)

"""Rules for held commands: watchdog, lease, repetition and transport load.

If the URC server loses power, only the robot's own watchdog can stop the robot. Drivers must
therefore declare the robot's watchdog. A lease or period that is at least as long as the watchdog
time is an error, because the watchdog would stop the robot first.
"""

import math
from collections.abc import Iterator
from typing import Final, cast

from urc.config.node import Node, Problems, shown_duration
from urc.expressions import Template, split_template
from urc.model.binary import Item, least_size
from urc.model.driver import Command, Driver, TransportSpec
from urc.model.exchange import Hold
from urc.model.framing import FrameLayout
from urc.model.payload import WriteSpec, each_of

__all__ = ["check_motion", "least_frame_bytes"]

_ASKED: Final = frozenset(("websocket", "ros"))
"""Transport types with a built-in liveness check during held commands."""
LONG_LEASE_S: Final = 0.5
_BITS_OF_A_BYTE: Final = 10
"""Number of bits per byte on a serial line, including the start bit and the stop bit."""
_ROUNDING: Final = 1.000001


def check_motion(part: Node, driver: Driver, problems: Problems) -> None:
    """Report problems with all held commands in the driver at `part`."""
    held = [
        (inner.must("hold"), driver.commands[name], hold)
        for name, inner in part.named("commands").items()
        if (hold := driver.commands[name].hold) is not None
    ]
    for inner, command, hold in held:
        _check_line(inner, driver.transports.get(command.transport), problems)
        if hold.step_s is None:
            _check_watchdog(inner, command, hold, problems)
        else:
            _check_step(inner, hold, hold.step_s, problems)
        _check_lease(inner, hold, problems)
    for name, spec in driver.transports.items():
        on_line = [one for one in held if one[1].transport == name]
        if on_line:
            _check_baud(on_line, spec, problems)
            _check_will(on_line, spec, problems)
            _check_token(on_line, spec, problems)
    is_mute = all(driver.transports[one[1].transport].never_replies for one in held)
    noticed = any(_notices(spec, driver) for spec in driver.transports.values())
    if held and not is_mute and not noticed:
        problems.warn(
            held[0][0],
            "no-loss-detection",
            "the loss of the robot would go unnoticed: no transport has 'stale_after',"
            " and no poll has a reply",
            key=True,
            hint="give the transport 'stale_after', add a poll with a reply, or write replies:"
            " never if the robot never sends anything",
        )
    elif held:
        for name, spec in driver.transports.items():
            streamed = [one for one in held if one[1].transport == name and not one[2].step_s]
            if streamed:
                _check_freeze(streamed[0], spec, problems)


def _check_freeze(one: tuple[Node, Command, Hold], spec: TransportSpec, problems: Problems) -> None:
    """Warn about motion over a transport that cannot detect a frozen robot program."""
    part, command, _ = one
    is_asked = spec.type in _ASKED or spec.never_replies
    if is_asked or spec.stale_after_s is not None or spec.connection == "per_request":
        return
    problems.warn(
        part,
        "no-liveness-check",
        f"while {command.name!r} is held, a frozen robot program would go unnoticed:"
        f" {spec.name!r} has no liveness check",
        key=True,
        hint=f"give {spec.name!r} a 'stale_after' as short as the robot's traffic allows, or"
        " replies: never if the robot never sends anything",
    )


def _check_line(part: Node, spec: TransportSpec | None, problems: Problems) -> None:
    if spec is not None and spec.connection == "per_request":
        problems.error(
            part,
            "motion-unconnected",
            f"a held command needs an open connection, but {spec.name!r} opens a connection for"
            " each request",
            key=True,
            hint="remove 'connection: per_request', or send the command over another transport",
        )


def _check_watchdog(part: Node, command: Command, hold: Hold, problems: Problems) -> None:
    watchdog_s = hold.watchdog_s
    if watchdog_s is None:
        problems.warn(
            part,
            "unknown-watchdog",
            f"the robot's own watchdog time after the last {command.name!r} is unknown",
            key=True,
            hint="write 'watchdog' with the time from the manual, or watchdog: none if the robot"
            " never stops itself",
        )
        return
    if hold.lease_s >= watchdog_s:
        problems.error(
            part.get("lease") or part.must("watchdog"),
            "lease-too-long",
            f"the lease is {shown_duration(hold.lease_s)}, but the robot stops itself after"
            f" {shown_duration(watchdog_s)}",
            hint="make 'lease' shorter than 'watchdog', so that the lease ends first",
        )
    if hold.repeat_s >= watchdog_s:
        problems.error(
            part.must("repeat"),
            "repeat-too-slow",
            f"the command is repeated every {shown_duration(hold.repeat_s)}, but the robot stops"
            f" itself after {shown_duration(watchdog_s)}: the motion would stutter",
            hint="repeat the command three times within this time, so that one value may be lost",
        )


def _check_step(part: Node, hold: Hold, step_s: float, problems: Problems) -> None:
    if hold.repeat_s < step_s / _ROUNDING:
        problems.error(
            part.must("repeat"),
            "step-backlog",
            f"the command is repeated every {shown_duration(hold.repeat_s)}, but a step takes"
            f" {shown_duration(step_s)}: a backlog of steps would move the robot after the release",
            hint="repeat the command at most once per step, or shorten the steps",
        )
    if step_s > LONG_LEASE_S:
        problems.warn(
            part.must("step"),
            "long-step",
            f"the robot may keep moving for up to {shown_duration(step_s)} after the control is"
            " released",
            hint="shorten the steps, because a step cannot be interrupted",
        )


def _check_lease(part: Node, hold: Hold, problems: Problems) -> None:
    if hold.lease_s > LONG_LEASE_S:
        problems.warn(
            part.must("lease"),
            "long-lease",
            f"the robot keeps moving for {shown_duration(hold.lease_s)} after the connection to"
            " its operator is lost",
            hint=f"{shown_duration(0.25)} is usual; {shown_duration(LONG_LEASE_S)} is already long",
        )


def _check_baud(
    held: list[tuple[Node, Command, Hold]], spec: TransportSpec, problems: Problems
) -> None:
    """Report held commands whose traffic exceeds the baud rate of a serial line."""
    baud = spec.options.get("baud")
    if isinstance(baud, bool) or not isinstance(baud, (int, float)) or baud <= 0:
        return
    bits_per_s = sum(
        least_frame_bytes(command.send, spec) * _BITS_OF_A_BYTE / hold.repeat_s
        for _, command, hold in held
    )
    if bits_per_s <= baud * _ROUNDING:
        return
    part, command, _ = min(held, key=lambda one: one[2].repeat_s)
    what = f"{command.name!r} needs" if len(held) == 1 else f"the {len(held)} held commands need"
    problems.error(
        part.must("repeat"),
        "line-too-slow",
        f"{what} {bits_per_s:.0f} bit/s or more, but the serial line carries only {baud:g}",
        hint=f"repeat less often: every {_bearable_ms(bits_per_s / baud, held)}ms or slower",
    )


def _check_will(
    held: list[tuple[Node, Command, Hold]], spec: TransportSpec, problems: Problems
) -> None:
    """Warn about held commands that use an MQTT broker without a will."""
    if spec.type != "mqtt" or spec.options.get("will") is not None:
        return
    part, command, _ = held[0]
    problems.warn(
        part,
        "motion-without-will",
        f"if the connection to the broker is lost, nothing stops the motion of {command.name!r}",
        key=True,
        hint=f"give {spec.name!r} a 'will' with the topic and payload of the stop, for the broker"
        " to publish",
    )


def _check_token(
    held: list[tuple[Node, Command, Hold]], spec: TransportSpec, problems: Problems
) -> None:
    """Warn about a robot behind a Zenoh router that would not notice the loss of URC."""
    if spec.type != "zenoh" or spec.options.get("liveliness") is not None:
        return
    unwatched = [(part, command) for part, command, hold in held if not _stops_itself(hold)]
    for part, command in unwatched[:1]:
        problems.warn(
            part,
            "motion-without-token",
            f"if URC's connection to the router is lost, nothing ends {command.name!r}",
            key=True,
            hint=f"give {spec.name!r} a 'liveliness' key, and let the robot stop when the token of"
            " this key disappears",
        )


def _stops_itself(hold: Hold) -> bool:
    return hold.step_s is not None or (
        hold.watchdog_s is not None and math.isfinite(hold.watchdog_s)
    )


def _bearable_ms(excess: float, held: list[tuple[Node, Command, Hold]]) -> int:
    """Return the shortest period in ms after all periods have grown by the factor `excess`."""
    return math.ceil(min(hold.repeat_s for _, _, hold in held) * excess * 1000 - 1e-6)


def _notices(spec: TransportSpec, driver: Driver) -> bool:
    """Return whether URC would detect a silent robot on a transport."""
    if spec.stale_after_s is not None or spec.timeouts.idle_s is not None:
        return True
    asked = [poll for poll in driver.polls if poll.transport == spec.name]
    if any(poll.reply is not None for poll in asked):
        return True
    keepalive = spec.keepalive
    command = driver.commands.get(keepalive.run) if keepalive is not None else None
    return command is not None and command.reply is not None


def least_frame_bytes(send: WriteSpec, spec: TransportSpec) -> int:
    """Return the minimum size of a frame with its framing, in bytes.

    Each part of variable length counts as one byte. Byte stuffing does not count.
    """
    frames = each_of(send)
    return sum(max(1, sum(_payload_bytes(one))) for one in frames) + len(frames) * _around(spec)


def _payload_bytes(send: WriteSpec) -> Iterator[int]:
    if send.form == "struct":
        yield least_size(cast("tuple[Item, ...]", send.options["items"]))
    for piece in cast("tuple[object, ...]", send.options.get("pieces", ())):
        yield len(piece) if isinstance(piece, bytes) else 1
    template = send.options.get("template")
    if isinstance(template, Template):
        parts = split_template(template.source)
        yield sum(len(text) if expression is None else 1 for _, text, expression in parts)


def _around(spec: TransportSpec) -> int:
    framing = spec.framing.sent or spec.framing
    layout = framing.options.get("layout")
    if isinstance(layout, FrameLayout):
        return layout.head + layout.tail
    tx = framing.options.get("tx")
    return len(tx) if isinstance(tx, bytes) else 0

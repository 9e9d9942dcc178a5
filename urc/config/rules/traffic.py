"""Rules for a transport's traffic, such as late motion and poll rates.

The rules check only values that the document declares, never defaults.
"""

from collections.abc import Mapping

from urc.config.node import Node, Problems, shown_duration
from urc.expressions import Template
from urc.model.driver import Command, Driver, TransportSpec

__all__ = ["check_traffic"]


def check_traffic(part: Node, driver: Driver, problems: Problems) -> None:
    """Report problems with the traffic and motion of the driver at `part`."""
    for name, inner in part.named("commands").items():
        command = driver.commands[name]
        spec = driver.transports.get(command.transport)
        if command.hold is not None and spec is not None:
            _check_pace(inner.must("hold"), command, spec, problems)
            _check_kept(inner.must("send"), command, problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        rate = driver.commands[poll.run].rate_per_s if poll.run in driver.commands else None
        if rate is not None and 1 / poll.every_s > rate:
            problems.warn(
                inner.must("every"),
                "too-many-polls",
                f"the command is polled {1 / poll.every_s:g} times a second, but {poll.run!r} may"
                f" be sent only {rate:g} times",
                hint="poll less often, or increase the command's 'rate_limit'",
            )
    _check_counted(part, driver, problems)
    _check_ports(part, driver, problems)
    for name, inner in part.named("transports").items():
        _check_silence(inner, driver.transports[name], driver, problems)


def _check_counted(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about commands without a reply on a transport that counts the robot's unread bytes."""
    requests = [
        (inner, one.transport, one.reply, one.priority)
        for name, inner in part.named("commands").items()
        if (one := driver.commands[name]).hold is None
    ]
    requests += [
        (inner, one.transport, one.reply, one.priority)
        for inner, one in zip(part.listed("polls"), driver.polls, strict=True)
        if not one.run
    ]
    for inner, transport, reply, priority in requests:
        spec = driver.transports.get(transport)
        is_counted = spec is not None and spec.queue.most_bytes is not None
        if is_counted and reply is None and priority != "realtime":
            problems.warn(
                inner.must("send"),
                "uncounted",
                f"{transport!r} counts the bytes that the robot has not read, but no reply shows"
                " when the robot reads them",
                hint="add the 'reply' of the robot, or priority: realtime if the robot does not"
                " buffer the command",
            )


def _check_ports(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about two transports that listen on the same port of this computer."""
    seen: dict[tuple[str, str, str], str] = {}
    for name, inner in part.named("transports").items():
        options = driver.transports[name].options
        key = "listen" if "listen" in options else "port"
        if key not in options or (key == "port" and options.get("mode") != "listen"):
            continue
        kind = "udp" if driver.transports[name].type == "udp" else "tcp"
        port, address = options[key], options.get("bind", "")
        place = (kind, _written(port), _written(address))
        if place in seen:
            problems.warn(
                inner.must(key),
                "same-port",
                f"{seen[place]!r} also listens on port {place[1]}, but only one transport can",
                hint="give each transport its own port, or use one transport and distinguish the"
                " messages",
            )
        seen.setdefault(place, name)


def _written(value: object) -> str:
    return value.source if isinstance(value, Template) else str(value)


def _check_kept(part: Node, command: Command, problems: Problems) -> None:
    """Report a motion command that a broker or ROS bridge would store or repeat."""
    attributes = command.send.options.get("attributes")
    if not isinstance(attributes, Mapping):
        return
    kept = [("retain", "is kept for later subscribers")] if attributes.get("retain") else []
    kept += [("qos", "is repeated until it is acknowledged")] if attributes.get("qos") else []
    for key, what in kept:
        problems.error(
            part.must("publish"),
            "motion-kept",
            f"{command.name!r} moves the robot, but with '{key}' the command {what}",
            at=key,
            key=True,
            hint=f"remove '{key}': late motion moves a robot without an operator",
        )


def _check_pace(part: Node, command: Command, spec: TransportSpec, problems: Problems) -> None:
    """Warn about a held command that repeats faster than its rate limit allows."""
    if command.hold is None:
        return
    repeat_s = command.hold.repeat_s
    for limit_s, what in (
        (spec.min_gap_s if command.priority != "realtime" else 0.0, "the transport's 'min_gap'"),
        (1 / command.rate_per_s if command.rate_per_s else 0.0, "its 'rate_limit'"),
    ):
        if limit_s > repeat_s * 1.001:  # Tolerance for rounding: 1/20 s and 50 ms are equal.
            problems.warn(
                part.must("repeat"),
                "hold-rate-limited",
                f"the command is repeated every {shown_duration(repeat_s)}, but {what} allows it"
                f" only every {shown_duration(limit_s)}",
                hint="make 'repeat' at least as long as the interval that 'rate_limit' allows",
            )


def _check_silence(part: Node, spec: TransportSpec, driver: Driver, problems: Problems) -> None:
    """Warn about a transport that becomes stale or closes between two polls."""
    if any(one.transport == spec.name for one in driver.messages.values()):
        return  # unsolicited messages arrive at an unknown rate
    periods = [poll.every_s for poll in driver.polls if poll.transport == spec.name and poll.reply]
    keepalive = spec.keepalive
    if keepalive is not None:
        command = driver.commands.get(keepalive.run)
        if command is not None and command.reply is not None:
            periods.append(keepalive.every_s)
    if not periods:
        return
    timeouts = part.get("timeouts")
    for place, key, limit_s, what in (
        (timeouts, "idle", spec.timeouts.idle_s, "closes"),
        (part, "stale_after", spec.stale_after_s, "counts as silent"),
    ):
        if place is not None and limit_s is not None and limit_s <= min(periods):
            problems.warn(
                place.must(key),
                "slow-keepalive",
                f"the connection {what} after {shown_duration(limit_s)}, but the robot is polled"
                f" every {shown_duration(min(periods))}",
                hint="make the time at least two poll periods long, so that one reply may be lost",
            )

"""Rules for traffic: rates, timeouts and secrets.

All rules warn about declared values, never about defaults.
"""

from collections.abc import Iterator

from urc.config.link.steps import steps_of
from urc.config.node import Node, Problems, shown_duration
from urc.config.parse.form import write_form
from urc.config.rules.answers import check_answers
from urc.config.rules.frames import check_frames_apart
from urc.config.rules.motion import check_motion
from urc.config.rules.traffic import check_traffic
from urc.config.rules.unmarked import (
    check_uncancelled,
    check_unguarded,
    check_unmarked,
    check_unmarked_stop,
)
from urc.expressions import digested_settings, split_template
from urc.model.driver import Driver, Poll, Reply, TransportSpec
from urc.model.payload import WriteSpec
from urc.model.sequence import SendStep, Step, UntilStep, WaitStep, all_steps

__all__ = ["check_flow"]

_GOOD_BYE_S = 2.0
"""Time limit for ``on_close`` in seconds, as in `urc.protocol.engine`."""
_BITS_OF_A_BYTE = 10
"""Number of bits per byte on a serial line, including the start bit and the stop bit."""


def check_flow(part: Node, driver: Driver, secrets: frozenset[str], problems: Problems) -> None:
    """Warn if the driver at `part` has excessive traffic, early timeouts or visible secrets.

    `secrets` contains the names of secret settings.
    """
    for name, inner in part.named("transports").items():
        _check_line(inner, driver.transports[name], problems)
        _check_baud(inner, driver, driver.transports[name], problems)
    for name, inner in part.named("commands").items():
        command = driver.commands[name]
        if command.reply is not None and "reply" in inner.data:
            _check_stages(inner.must("reply"), command.reply, command.transport, driver, problems)
        if command.verify is not None:
            _check_haste(inner.must("verify"), driver, name, problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        _check_poll(inner, poll, problems)
    _check_secrets(part, driver, secrets, problems)
    check_answers(part, driver, problems)
    check_traffic(part, driver, problems)
    check_motion(part, driver, problems)
    check_unguarded(part, driver, problems)
    check_uncancelled(part, driver, problems)
    check_unmarked(part, driver, problems)
    check_unmarked_stop(part, driver, problems)
    check_frames_apart(part, driver, problems)


def _check_line(part: Node, spec: TransportSpec, problems: Problems) -> None:
    keepalive = spec.keepalive
    watchdog_s = keepalive.watchdog_s if keepalive is not None else None
    if keepalive is not None and watchdog_s is not None and keepalive.every_s >= watchdog_s:
        problems.warn(
            part.must("keepalive").must("every"),
            "slow-keepalive",
            f"the watchdog of the robot expires first, after {shown_duration(watchdog_s)}",
            hint="send the keepalive at least twice in this time, so that one frame may be lost",
        )
    waits_s = sum(_wait_s(step) for step in all_steps(spec.on_close))
    if waits_s > _GOOD_BYE_S:
        problems.warn(
            part.must("on_close"),
            "long-on-close",
            f"these steps may wait for {shown_duration(waits_s)}, but the limit is"
            f" {shown_duration(_GOOD_BYE_S)} in total",
            key=True,
        )


def _wait_s(step: Step) -> float:
    if isinstance(step, UntilStep):
        return step.timeout_s
    return step.seconds if isinstance(step, WaitStep) else 0.0


def _check_baud(part: Node, driver: Driver, spec: TransportSpec, problems: Problems) -> None:
    """Warn about polls whose traffic exceeds the baud rate of a serial line."""
    baud = spec.options.get("baud")
    if isinstance(baud, bool) or not isinstance(baud, (int, float)) or baud <= 0:
        return
    polls = [poll for poll in driver.polls if poll.transport == spec.name]
    bytes_per_s = sum(_least_bytes(poll) / poll.every_s for poll in polls)
    if bytes_per_s * _BITS_OF_A_BYTE > baud:
        problems.warn(
            part,
            "too-many-polls",
            f"the polls need {bytes_per_s * _BITS_OF_A_BYTE:.0f} bit/s or more, but the line"
            f" carries only {baud:g}",
            at="baud",
        )


def _least_bytes(poll: Poll) -> int:
    """Return the minimum number of bytes in a request and its reply."""
    template = poll.send.options.get("template")
    source = getattr(template, "source", "")
    literal = sum(len(text) for _, text, _ in split_template(source))
    return max(1, literal) + (1 if poll.reply is not None else 0)


def _check_stages(
    part: Node, reply: Reply, transport: str, driver: Driver, problems: Problems
) -> None:
    """Warn about a command whose wait for a later reply stage delays its transport's polls."""
    if not reply.stages or driver.transports[transport].queue.in_flight > 1:
        return
    periods = [poll.every_s for poll in driver.polls if poll.transport == transport]
    longest_s = max((one.timeout_s or 0.0 for one in reply.stages), default=0.0)
    if periods and longest_s > min(periods):
        problems.warn(
            part.must("stages"),
            "stages-block-line",
            f"while this command waits up to {shown_duration(longest_s)} for a later stage, the"
            f" poll that runs every {shown_duration(min(periods))} also waits",
            key=True,
            hint="write queue: { in_flight: 2 } if the robot can reply in between",
        )


def _check_haste(part: Node, driver: Driver, name: str, problems: Problems) -> None:
    """Warn about a verification that ends before its signals are polled again."""
    verify = driver.commands[name].verify
    if verify is None:
        return
    for signal in sorted(verify.condition.names & driver.signals.keys()):
        periods = [poll.every_s for poll in driver.polls if signal in _fields(poll.reply)]
        told = any(signal in one.read.fields for one in driver.messages.values())
        if periods and not told and min(periods) > verify.within_s:
            problems.warn(
                part.must("within"),
                "verify-too-early",
                f"{signal!r} is read only every {shown_duration(min(periods))}",
                hint="make 'within' longer than one period, or poll more often",
            )


def _fields(reply: Reply | None) -> tuple[str, ...]:
    return () if reply is None else reply.read.fields


def _check_poll(part: Node, poll: Poll, problems: Problems) -> None:
    if poll.offline is not None and poll.offline.retry_s < poll.every_s:
        problems.warn(
            part.must("offline").must("retry"),
            "retry-too-early",
            f"an offline device is polled more often than a working device"
            f" (every {shown_duration(poll.every_s)})",
            hint="make 'retry' longer than 'every'",
        )


def _digested(part: Node, send: WriteSpec) -> set[str]:
    """Return the settings that are sent only as part of a hash with a nonce or time."""
    inner, form = write_form(part)
    found = [template for _, template in form.templates(inner, send)]
    digested = {name for one in found for name in digested_settings(one)}
    return digested - {name for one in found for name in one.settings - digested_settings(one)}


def _check_secrets(part: Node, driver: Driver, secrets: frozenset[str], problems: Problems) -> None:
    """Warn about commands that send a secret without `redact`."""
    asked = [
        (inner.must("send"), driver.commands[name].send)
        for name, inner in part.named("commands").items()
    ]
    asked += [
        (inner.must("send"), poll.send)
        for inner, poll in zip(part.listed("polls"), driver.polls, strict=True)
        if "send" in inner.data
    ]
    for place, send in asked:
        used = sorted((send.settings & secrets) - _digested(place, send))
        if used:
            problems.warn(
                place,
                "secret-not-redacted",
                f"the secret {used[0]!r} is visible in the traffic of every request",
                hint="send the secret once, in a step of 'on_connect' or of a sequence, with"
                " redact: true",
            )
    for inner, step in _sends(part, driver):
        used = sorted((step.send.settings & secrets) - _digested(inner.must("send"), step.send))
        if used and not step.is_secret:
            problems.warn(
                inner.must("send"),
                "secret-not-redacted",
                f"the secret {used[0]!r} may appear in messages and logs",
                hint="add redact: true",
            )


def _sends(part: Node, driver: Driver) -> Iterator[tuple[Node, SendStep]]:
    for name, inner in part.named("sequences").items():
        yield from _sends_in(steps_of(inner), driver.commands[name].steps)
    for name, inner in part.named("transports").items():
        spec = driver.transports[name]
        for key, steps in (("on_connect", spec.on_connect), ("on_close", spec.on_close)):
            if steps:
                yield from _sends_in(inner.must(key), steps)


def _sends_in(part: Node, steps: tuple[Step, ...]) -> Iterator[tuple[Node, SendStep]]:
    for inner, step in zip(part.items(), steps, strict=True):
        if isinstance(step, SendStep):
            yield inner, step
        for key, branch in (
            ("repeat", getattr(step, "body", None)),
            ("then", getattr(step, "then", None)),
            ("else", getattr(step, "otherwise", None)),
        ):
            place = inner.get(key)
            if branch and place is not None:
                yield from _sends_in(place, branch)

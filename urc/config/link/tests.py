"""Checks the names in a document's tests."""

from collections.abc import Mapping
from typing import Final

from urc.config.node import Node, Problems
from urc.config.parse.profile import setting_value
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import check_within, fit, fit_argument, fit_hint, known_argument
from urc.model.driver import Command, Driver
from urc.model.profile import DialogueStep, DocumentTest, Expected, ExpectedState, Setting
from urc.model.values import BINARY_TYPES, Signal, Value

__all__ = ["link_test"]


def link_test(
    part: Node,
    test: DocumentTest,
    driver: Driver,
    settings: Mapping[str, Setting],
    problems: Problems,
) -> DocumentTest:
    """Return the test with converted values and the index of its poll; report mistakes."""
    if test.steps:
        _check_polls(part, driver, problems)
        steps = _link_steps(part, test.steps, driver, problems)
    else:
        _check_purpose(part, test, driver, problems)
        steps = ()
    _check_transports(part, driver, problems)
    _check_run(part, test.run, test.arguments, driver, problems, may_fail=test.fails is not None)
    return test._replace(
        expect=_link_expect(part, driver, problems),
        reply_to=_reply_to(part, test, driver, problems),
        settings={
            name: _setting(inner, settings, problems)
            for name, inner in part.named("settings").items()
        },
        steps=steps,
    )


def _check_purpose(part: Node, test: DocumentTest, driver: Driver, problems: Problems) -> None:
    text = ""
    if not test.feed and test.run is None and test.reply_to is None:
        text = "'feed' or 'run' is missing, so this test does nothing"
    elif not (test.expect or test.sent or test.fails is not None or _reads(test, driver)):
        text = "'expect', 'sent' or 'fails' is missing, so this test cannot fail"
    if text:
        problems.error(part, "missing-key", text, key=True)


def _reads(test: DocumentTest, driver: Driver) -> bool:
    """Return whether every fed frame must match a reply or a message."""
    if test.feed and test.run is None and test.reply_to is None:
        return True
    asked = test.run if test.run is not None else test.reply_to
    command = driver.commands.get(asked) if isinstance(asked, str) else None
    return bool(test.feed) and command is not None and command.reply is not None


_COMES: Final = ("message", "response", "feedback")
_GOES: Final = ("publish", "call", "goal", "cancel", "request", "get")
"""Kinds of sent messages that a test may expect."""


def _check_transports(part: Node, driver: Driver, problems: Problems) -> None:
    for key, verbs in (("feed", _COMES), ("sent", _GOES)):
        for name, inner in part.named(key).items():
            _check_transport(name, inner, driver, problems, key=True)
            for one in inner.items() if isinstance(inner.data, list) else [inner]:
                _check_verb(one, verbs, f"cannot be {'fed' if key == 'feed' else key}", problems)


def _check_verb(part: Node, verbs: tuple[str, ...], why_not: str, problems: Problems) -> None:
    if isinstance(part.data, dict):
        for verb in part.data.keys() - {"hex", *verbs}:
            hint = did_you_mean(verb, verbs, "kinds")
            problems.error(
                part, "misplaced-key", f"'{verb}' {why_not}", at=verb, key=True, hint=hint
            )


def _check_transport(
    name: str, part: Node, driver: Driver, problems: Problems, *, key: bool = False
) -> None:
    if name not in driver.transports:
        problems.unknown(part, "unknown-transport", name, driver.transports, key=key)


def _check_polls(part: Node, driver: Driver, problems: Problems) -> None:
    names = [poll.name for poll in driver.polls]
    for inner in part.listed("polls"):
        if inner.data not in names:
            text = f"there is no poll {inner.data!r}"
            hint = did_you_mean(str(inner.data), names, "polls")
            problems.error(inner, "unknown-request", text, hint=hint)


_CHECKS: Final = ("sent", "expect", "reply", "fails", "closed")


def _link_steps(
    part: Node, steps: tuple[DialogueStep, ...], driver: Driver, problems: Problems
) -> tuple[DialogueStep, ...]:
    parts = part.listed("steps")
    if not any(key in inner.data for inner in parts for key in _CHECKS):
        words = ", ".join(f"'{key}'" for key in _CHECKS[:-1])
        text = f"{words} or '{_CHECKS[-1]}' is missing in all steps, so this test cannot fail"
        problems.error(part, "missing-key", text, at="steps", key=True)
    linked = []
    for place, (inner, step) in enumerate(zip(parts, steps, strict=True)):
        after = steps[place + 1] if place + 1 < len(steps) else step
        _check_transports(inner, driver, problems)
        for key in ("connects", "closes", "closed"):
            if key in inner.data:
                named = inner.must(key)
                _check_transport(str(named.data), named, driver, problems)
        spec = driver.transports.get(step.connects)
        if spec is not None and spec.connection == "per_request":
            text = f"{spec.name!r} opens a connection for each request"
            hint = "run a command with a request on this transport"
            problems.error(inner, "wrong-transport", text, at="connects", hint=hint)
        may_fail = bool(step.fails or after.fails)
        _check_run(inner, step.run or None, step.arguments, driver, problems, may_fail=may_fail)
        if step.of and step.of not in driver.commands:
            text = f"there is no command {step.of!r}"
            hint = did_you_mean(step.of, driver.commands, "commands")
            problems.error(inner, "unknown-command", text, at="of", hint=hint)
        linked.append(step._replace(expect=_link_expect(inner, driver, problems)))
    return tuple(linked)


def _link_expect(part: Node, driver: Driver, problems: Problems) -> dict[str, Expected]:
    """Return the expected values, converted to the types of their signals."""
    return {
        name: _state(name, inner, driver, problems) for name, inner in part.named("expect").items()
    }


def _state(name: str, part: Node, driver: Driver, problems: Problems) -> Expected:
    if not isinstance(part.data, dict):
        return _expected(name, part, driver, problems)
    signal = driver.signals.get(name)
    alarm = part.text("alarm")
    if signal is not None and alarm not in ("", "none") and signal.limits.is_empty:
        text = f"signal {name!r} has no limits"
        problems.error(part, "misplaced-key", text, at="alarm", hint="give the signal 'limits'")
    if "value" in part.data and part.text("age") == "never":
        text = "a signal that was never set has no value to compare"
        problems.error(part, "misplaced-key", text, at="value", key=True)
    inner = part.get("value")
    value = _expected(name, inner if inner else part, driver, problems, is_part=inner is None)
    return ExpectedState(
        has_value=inner is not None,
        value=value,
        alarm=None if not alarm else "" if alarm == "none" else alarm,  # type: ignore[arg-type]  # the schema's enum
        age=part.text("age"),  # type: ignore[arg-type]  # as above
    )


def _setting(part: Node, settings: Mapping[str, Setting], problems: Problems) -> Value:
    setting = settings.get(part.name)
    if setting is None:
        problems.unknown(part, "unknown-setting", part.name, settings, key=True)
        return None
    value = setting_value(part, setting.type, setting.choices, problems)
    check_within(value, setting.min, setting.max, part, problems)
    return value


def _expected(
    name: str, part: Node, driver: Driver, problems: Problems, *, is_part: bool = False
) -> Value | tuple[Value, ...]:
    """Return the expected value at `part`; None if it is null or invalid, or with `is_part`."""
    signal = driver.signals.get(name)
    if signal is None:
        problems.unknown(part, "unknown-signal", name, driver.signals, key=True)
        return None
    if part.data is None or is_part:
        return None
    if (signal.type == "array") != isinstance(part.data, list):
        wanted = f"a list of {signal.items}s" if signal.type == "array" else "a single value"
        text = f"signal {name!r} is of type {signal.type}: expected {wanted}"
        problems.error(part, "wrong-type", text)
        return None
    if signal.type == "array":
        return tuple(_fitting(inner, signal, signal.items, problems) for inner in part.items())
    return _fitting(part, signal, signal.type, problems)


def _fitting(part: Node, signal: Signal, kind: str, problems: Problems) -> Value:
    value: Value = part.data
    if value is None or (isinstance(value, str) and value in dict(signal.states).values()):
        return value
    if kind in ("object", "transform_tree", *BINARY_TYPES):
        text = f"signal {signal.name!r}: a value of type {kind} cannot be compared"
        problems.error(
            part,
            "wrong-type",
            text,
            hint="declare a signal that is computed from this signal, and compare its value",
        )
        return None
    try:
        return fit(value, kind)
    except ValueError as error:
        text = f"signal {signal.name!r}: {error}"
        problems.error(part, "wrong-type", text, hint=fit_hint(value, kind))
        return None


def _reply_to(
    part: Node, test: DocumentTest, driver: Driver, problems: Problems
) -> int | str | None:
    waiting = test.reply_to
    if waiting is None:
        return None
    inner = part.must("reply_to")
    if isinstance(waiting, str):
        names = {poll.name: place for place, poll in enumerate(driver.polls)}
        if waiting in driver.commands:
            if test.feed and driver.commands[waiting].reply is None:
                problems.error(inner, "no-reply", f"the command {waiting!r} expects no reply")
            return waiting
        if waiting not in names:
            problems.error(
                inner,
                "unknown-request",
                f"there is no poll or command {waiting!r}",
                hint=did_you_mean(waiting, (*names, *driver.commands), "names"),
            )
            return None
        waiting = names[waiting]
    if waiting >= len(driver.polls):
        most = len(driver.polls) - 1
        text = f"the last poll is {most}" if most >= 0 else "the driver has no polls"
        problems.error(
            inner,
            "unknown-request",
            f"there is no poll {waiting}: {text}",
            hint="polls are numbered from 0",
        )
        return None
    poll = driver.polls[waiting]
    if test.feed and poll.reply is None:
        problems.error(inner, "no-reply", f"poll {waiting} expects no reply")
    # The poll's own check reports an unknown transport.
    if test.feed and poll.transport in driver.transports and poll.transport not in test.feed:
        problems.error(
            inner,
            "wrong-transport",
            f"poll {waiting} expects its reply on {poll.transport!r}, but this test does not feed"
            f" {poll.transport!r}",
        )
    return waiting


def _check_run(
    part: Node,
    run: str | None,
    arguments: Mapping[str, object],
    driver: Driver,
    problems: Problems,
    *,
    may_fail: bool,
) -> None:
    if run is None:
        if "args" in part.data:
            problems.error(
                part, "misplaced-key", "'args' has no effect without 'run'", at="args", key=True
            )
        return
    command = driver.commands.get(run)
    if command is None:
        problems.unknown(part, "unknown-command", run, driver.commands, at="run")
        return
    for name, inner in part.named("args").items():
        _check_argument(name, inner, command, problems, may_fail=may_fail)
    missing = [
        name for name, one in command.arguments.items()
        if one.is_required and one.default is None and name not in arguments
    ]  # fmt: skip
    if missing and not may_fail:
        problems.error(
            part,
            "missing-argument",
            f"command {run!r} needs {missing[0]!r}",
            at="run",
            hint=f"write args: {{ {missing[0]}: … }}",
        )


def _check_argument(
    name: str, part: Node, command: Command, problems: Problems, *, may_fail: bool
) -> None:
    argument = known_argument(name, part, command, problems)
    if argument is None or may_fail:
        return  # a test of a failure may use invalid values
    try:
        elements = fit_argument(part.data, argument.type, argument.items, argument.size)
    except ValueError as error:
        problems.error(
            part,
            "wrong-type",
            f"argument {name!r}: {error}",
            hint=fit_hint(part.data, argument.type),
        )
        return
    for one in elements:
        check_within(one, argument.min, argument.max, part, problems)
        if argument.choices and one not in argument.choices:
            text = f"{one!r} is not one of the choices of {name!r}"
            problems.error(part, "unknown-word", text)

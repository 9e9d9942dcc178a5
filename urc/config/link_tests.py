"""Names in the tests that documents carry about themselves."""

from collections.abc import Mapping

from urc.config.parse_profile import setting_value
from urc.config.part import Findings, Part
from urc.config.suggest import did_you_mean
from urc.config.values import check_within, fit, fit_hint
from urc.model.driver import Command, Driver
from urc.model.profile import DocumentTest, Setting
from urc.model.values import Signal, Value

__all__ = ["link_test"]


def link_test(
    part: Part,
    test: DocumentTest,
    driver: Driver,
    settings: Mapping[str, Setting],
    findings: Findings,
) -> DocumentTest:
    """Return the test with values of the signals' types and the poll it names by its index."""
    if not test.feed and test.run is None and test.reply_to is None:
        findings.error(
            part, "missing-key", "'feed' or 'run' is missing: this test does nothing", key=True
        )
    elif not test.expect and not test.sent and test.fails is None:
        findings.error(
            part,
            "missing-key",
            "'expect', 'sent' or 'fails' is missing: this test cannot fail",
            key=True,
        )
    for key in ("feed", "sent"):
        for name, inner in part.named(key).items():
            if name not in driver.transports:
                findings.error(
                    inner,
                    "unknown-transport",
                    f"there is no transport {name!r}",
                    key=True,
                    hint=did_you_mean(name, driver.transports, "transports"),
                )
    expect = {}
    for name, inner in part.named("expect").items():
        expect[name] = _expected(name, inner, driver, findings)
    _check_run(part, test, driver, findings)
    return test._replace(
        expect=expect,
        reply_to=_reply_to(part, test, driver, findings),
        settings={
            name: _setting(inner, settings, findings)
            for name, inner in part.named("settings").items()
        },
    )


def _setting(part: Part, settings: Mapping[str, Setting], findings: Findings) -> Value:
    setting = settings.get(part.name)
    if setting is None:
        findings.error(
            part,
            "unknown-setting",
            f"there is no setting {part.name!r}",
            key=True,
            hint=did_you_mean(part.name, settings, "settings"),
        )
        return None
    value = setting_value(part, setting.type, setting.choices, findings)
    check_within(value, setting.min, setting.max, part, findings)
    return value


def _expected(
    name: str, part: Part, driver: Driver, findings: Findings
) -> Value | tuple[Value, ...]:
    signal = driver.signals.get(name)
    if signal is None:
        findings.error(
            part,
            "unknown-signal",
            f"there is no signal {name!r}",
            key=True,
            hint=did_you_mean(name, driver.signals, "signals"),
        )
        return None
    if part.data is None:
        return None
    if (signal.type == "array") != isinstance(part.data, list):
        wanted = f"a list of {signal.of}s" if signal.type == "array" else "no list"
        text = f"signal {name!r} is of type {signal.type}: {wanted} is expected"
        findings.error(part, "wrong-type", text)
        return None
    if signal.type == "array":
        return tuple(_fitting(inner, signal, signal.of, findings) for inner in part.items())
    return _fitting(part, signal, signal.type, findings)


def _fitting(part: Part, signal: Signal, kind: str, findings: Findings) -> Value:
    value: Value = part.data
    if value is None or (isinstance(value, str) and value in dict(signal.states).values()):
        return value
    if kind in ("object", "image", "blob"):
        text = f"signal {signal.name!r}: what is in {kind}s cannot be compared"
        findings.error(part, "wrong-type", text, hint="compare a signal that is computed from it")
        return None
    try:
        return fit(value, kind)
    except ValueError as error:
        text = f"signal {signal.name!r}: {error}"
        findings.error(part, "wrong-type", text, hint=fit_hint(value, kind))
        return None


def _reply_to(
    part: Part, test: DocumentTest, driver: Driver, findings: Findings
) -> int | str | None:
    waiting = test.reply_to
    if waiting is None:
        return None
    inner = part.must("reply_to")
    if isinstance(waiting, str):
        names = {poll.name: place for place, poll in enumerate(driver.polls)}
        if waiting in driver.commands:
            if test.feed and driver.commands[waiting].reply is None:
                findings.error(inner, "no-reply", f"the command {waiting!r} waits for no reply")
            return waiting
        if waiting not in names:
            findings.error(
                inner,
                "unknown-request",
                f"no poll or command is called {waiting!r}",
                hint=did_you_mean(waiting, (*names, *driver.commands), "names"),
            )
            return None
        waiting = names[waiting]
    if waiting >= len(driver.polls):
        most = len(driver.polls) - 1
        text = f"the last one is {most}" if most >= 0 else "there are none"
        findings.error(
            inner,
            "unknown-request",
            f"there is no poll {waiting}: {text}",
            hint="polls are counted from 0",
        )
        return None
    poll = driver.polls[waiting]
    if test.feed and poll.reply is None:
        findings.error(inner, "no-reply", f"poll {waiting} waits for no reply")
    if test.feed and poll.transport not in test.feed:
        findings.error(
            inner,
            "wrong-transport",
            f"poll {waiting} waits on {poll.transport!r}, which is not fed",
        )
    return waiting


def _check_run(part: Part, test: DocumentTest, driver: Driver, findings: Findings) -> None:
    if test.run is None:
        if "args" in part.data:
            findings.error(part, "misplaced-key", "'args' without 'run'", at="args", key=True)
        return
    command = driver.commands.get(test.run)
    if command is None:
        findings.error(
            part,
            "unknown-command",
            f"there is no command {test.run!r}",
            at="run",
            hint=did_you_mean(test.run, driver.commands, "commands"),
        )
        return
    for name, inner in part.named("args").items():
        _check_argument(name, inner, command, test, findings)
    missing = [
        name for name, one in command.arguments.items()
        if one.is_required and one.default is None and name not in test.arguments
    ]  # fmt: skip
    if missing and test.fails is None:
        findings.error(
            part,
            "missing-argument",
            f"command {test.run!r} needs {missing[0]!r}",
            at="run",
            hint=f"write args: {{ {missing[0]}: … }}",
        )


def _check_argument(
    name: str, part: Part, command: Command, test: DocumentTest, findings: Findings
) -> None:
    argument = command.arguments.get(name)
    if argument is None:
        findings.error(
            part,
            "unknown-argument",
            f"command {command.name!r} has no argument {name!r}",
            key=True,
            hint=did_you_mean(name, command.arguments, "arguments"),
        )
        return
    if test.fails is not None:
        return  # a test about a failure may give what is refused
    try:
        value = fit(part.data, argument.type)
    except ValueError as error:
        findings.error(
            part,
            "wrong-type",
            f"argument {name!r}: {error}",
            hint=fit_hint(part.data, argument.type),
        )
        return
    check_within(value, argument.min, argument.max, part, findings)
    if argument.choices and value not in argument.choices:
        findings.error(part, "unknown-word", f"{part.data!r} is not one of the choices of {name!r}")

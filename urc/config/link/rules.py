"""Checks the emulated robot's rules and initial values."""

from collections.abc import Iterable, Mapping

from urc.config.link.flow import Linker, find_command
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import check_within, fit, fit_hint, shown
from urc.expressions import COUNTERS, Template
from urc.model.driver import Driver
from urc.model.payload import ReadSpec
from urc.model.profile import Reaction, SimulatorRule
from urc.model.values import BINARY_TYPES, Reading, Signal, Value
from urc.model.world import WorldSpec

__all__ = ["link_rules", "link_values", "settable"]


def link_values(
    parts: Mapping[str, Node], driver: Driver, problems: Problems
) -> dict[str, Reading]:
    """Return the initial values of the emulated robot, converted to the types of the signals.

    `parts` contains the simulator's nodes `signals` and `state`.
    """
    values: dict[str, Reading] = {}
    if "state" in parts:
        for name, inner in parts["state"].entries().items():
            if name in driver.signals or name in ("now", "settings", "world"):
                is_signal = name in driver.signals
                text = f"{name!r} is {'already a signal' if is_signal else 'a reserved name'}"
                hint = "set the initial value of a signal under 'signals'" if is_signal else ""
                problems.error(inner, "duplicate-name", text, key=True, hint=hint)
            values[name] = tuple(inner.data) if isinstance(inner.data, list) else inner.data
    if "signals" in parts:
        for name, inner in parts["signals"].entries().items():
            signal = settable(name, inner, driver, problems)
            if signal is not None:
                values[name] = _value(inner, signal, problems)
    return values


def settable(name: str, part: Node, driver: Driver, problems: Problems) -> Signal | None:
    """Return the signal `name`; report an unknown or computed signal at `part`."""
    signal = driver.signals.get(name)
    if signal is None:
        text = f"{name!r} is not a signal"
        hint = did_you_mean(name, driver.signals, "signals")
        problems.error(part, "unknown-signal", text, key=True, hint=hint)
        return None
    if signal.formula is not None:
        text = f"{name!r} is computed from other signals"
        problems.error(part, "misplaced-key", text, key=True, hint="set those instead")
        return None
    return signal


def _value(part: Node, signal: Signal, problems: Problems) -> Reading:
    data = part.data
    if data is None:
        return None
    if signal.type in ("object", "transform_tree", *BINARY_TYPES):
        text = f"signal {signal.name!r}: a value of type {signal.type} cannot be set here"
        problems.error(part, "wrong-type", text)
        return None
    if (signal.type == "array") != isinstance(data, list):
        wanted = f"a list of {signal.items}s" if signal.type == "array" else "a single value"
        text = f"signal {signal.name!r} is of type {signal.type}: expected {wanted}"
        problems.error(part, "wrong-type", text)
        return None
    if isinstance(data, list):
        return tuple(_single(inner, signal, signal.items, problems) for inner in part.items())
    return _single(part, signal, signal.type, problems)


def _single(part: Node, signal: Signal, kind: str, problems: Problems) -> Value:
    value: Value = part.data
    if signal.states:
        words = [word for _, word in signal.states]
        if value not in words:
            text = f"signal {signal.name!r}: {shown(value)} is not one of its states"
            near = did_you_mean(str(value), words, "states")
            hint = fit_hint(value, "string") if shown(value) in words else near
            problems.error(part, "unknown-word", text, hint=hint)
        return value
    try:
        value = fit(value, kind)
    except ValueError as error:
        text = f"signal {signal.name!r}: {error}"
        problems.error(part, "wrong-type", text, hint=fit_hint(value, kind))
        return None
    check_within(value, signal.min, signal.max, part, problems)
    return value


def link_rules(
    linker: Linker,
    part: Node,
    rules: Iterable[SimulatorRule],
    state: Iterable[str],
    world: WorldSpec | None = None,
) -> None:
    """Check the rules of one transport.

    `state` contains the names of the emulated robot's state, and `world` describes its world.
    """
    always = {"now", *state, *linker.driver.signals} | ({"world"} if world is not None else set())
    told = frozenset[str]() if world is None else frozenset(world.senses)
    for inner, rule in zip(part.items(), rules, strict=True):
        known = always | _given(linker, inner, rule)
        if rule.when is not None:
            linker.template(inner.must("when"), rule.when, known)
        places = (inner, *inner.listed("then"))
        for place, reaction in zip(places, rule.reactions, strict=True):
            if reaction.until is not None:
                linker.template(place.must("until"), reaction.until, known)
            _link_reaction(linker, place, reaction, known, set(state))
            _check_told(linker, place, told)
        _check_answers(linker, places, rule)


def _given(linker: Linker, part: Node, rule: SimulatorRule) -> set[str]:
    """Check the frame, command or poll that triggers a rule; return the fields of that frame."""
    match = rule.match
    if isinstance(match, ReadSpec):
        fields = set(match.fields)
        for name, inner in part.must("match").named("fields").items():
            if name not in fields:
                text = f"{name!r} is not a field of this frame"
                hint = did_you_mean(name, fields, "fields")
                linker.problems.error(inner, "unknown-field", text, key=True, hint=hint)
        if match.topic is not None:
            linker.template(part.must("match").must("subscribe").must("topic"), match.topic)
        if match.when is not None:
            linker.template(part.must("match").must("when"), match.when, fields)
        return fields
    if match is not None:
        return set(match.groups)
    if "command" in part.data:
        return _of_command(linker, part, rule)
    if "poll" in part.data:
        _check_poll(linker, part, rule)
    return set()


def _of_command(linker: Linker, part: Node, rule: SimulatorRule) -> set[str]:
    inner = part.must("command")
    command = find_command(linker, inner, rule.request)
    if command is None:
        return set()
    if command.steps:
        text = f"{rule.request!r} is a sequence, which sends several frames"
        hint = "write a rule with 'match' for each step of the sequence"
        linker.problems.error(inner, "wrong-command", text, hint=hint)
    elif command.send.form == "frames":
        text = f"{rule.request!r} sends several frames, but a rule matches only one"
        hint = "write a rule with 'match' for each frame of the command"
        linker.problems.error(inner, "wrong-command", text, hint=hint)
    elif command.transport != rule.transport:
        _elsewhere(linker, inner, rule, command.transport)
    return set(command.arguments)


def _check_poll(linker: Linker, part: Node, rule: SimulatorRule) -> None:
    inner = part.must("poll")
    polls = {poll.name: poll for poll in linker.driver.polls}
    poll = polls.get(rule.request)
    if poll is None:
        text = f"there is no poll {rule.request!r}"
        hint = did_you_mean(rule.request, polls, "polls")
        linker.problems.error(inner, "unknown-request", text, hint=hint)
    elif poll.run:
        text = f"the poll {rule.request!r} runs the command {poll.run!r}"
        hint = f"write command: {poll.run}"
        linker.problems.error(inner, "wrong-command", text, hint=hint)
    elif poll.transport != rule.transport:
        _elsewhere(linker, inner, rule, poll.transport)


def _elsewhere(linker: Linker, part: Node, rule: SimulatorRule, transport: str) -> None:
    if transport not in linker.driver.transports:
        return  # reported for the command or poll
    text = f"{rule.request!r} is sent to {transport!r}, but this rule is for {rule.transport!r}"
    linker.problems.error(part, "wrong-transport", text)


def _link_reaction(
    linker: Linker, part: Node, reaction: Reaction, known: set[str], state: set[str]
) -> None:
    for name, inner in part.named("set").items():
        if name not in state and name not in linker.driver.signals:
            text = f"{name!r} is neither a signal nor declared under 'state'"
            names = (*linker.driver.signals, *state)
            hint = did_you_mean(name, names, "names") or "declare it under simulator.state"
            linker.problems.error(inner, "unknown-signal", text, key=True, hint=hint)
        elif name not in state:
            signal = settable(name, inner, linker.driver, linker.problems)
            if signal is not None and not isinstance(inner.data, str):
                _value(inner, signal, linker.problems)
        value = reaction.sets.get(name)
        if isinstance(value, Template):
            linker.template(inner, value, known)
            if value.is_constant and name in linker.driver.signals:
                _check_word(linker, inner, value)
    if reaction.send is not None:
        linker.templates(part.must("send"), reaction.send, {*known, COUNTERS})
    if reaction.message and reaction.message not in linker.driver.messages:
        text = f"there is no message {reaction.message!r}"
        hint = did_you_mean(reaction.message, linker.driver.messages, "messages")
        linker.problems.error(part, "unknown-message", text, at="message", hint=hint)


def _check_told(linker: Linker, part: Node, told: frozenset[str]) -> None:
    """Report each signal that a rule sets although the emulated robot's world also sets it."""
    for name, inner in part.named("set").items():
        if name in told:
            text = f"the world also sets the signal {name!r}"
            hint = "remove the signal here, or from world.signals"
            linker.problems.error(inner, "two-sources", text, key=True, hint=hint)


def _check_word(linker: Linker, part: Node, value: Template) -> None:
    """Check constant text that a rule assigns to a signal."""
    signal = linker.driver.signals[part.name]
    if signal.formula is None and (signal.states or signal.type != "string"):
        text = value.evaluate({})
        if isinstance(text, str) or signal.states:
            _single(Node(part.document, part.path, text), signal, signal.type, linker.problems)


def _check_answers(linker: Linker, places: tuple[Node, ...], rule: SimulatorRule) -> None:
    """Report `auto` replies in a periodic rule, because such a rule has no request to reply to."""
    if rule.every_s is None:
        return
    for place in places:
        if place.text("answer") == "auto":
            text = "a periodic rule has no request to reply to"
            hint = "write message: NAME to send a message of the driver"
            linker.problems.error(place, "misplaced-key", text, at="answer", hint=hint)

"""Parser for drivers: mapping → `Driver`, with compiled patterns and templates."""

from collections.abc import Mapping
from typing import Any

from urc.config.autonomous_motion import with_moving_steps
from urc.config.command_roles import with_roles_of_steps
from urc.config.node import Node, Problems
from urc.config.parse.flow import (
    NOTHING_SENT,
    aged_by_lines,
    command_with_flow,
    line_with_flow,
    parse_choice_questions,
    parse_sequence,
    poll_with_flow,
)
from urc.config.parse.form import FormContext, parse_read, parse_write
from urc.config.parse.form_options import with_collected
from urc.config.parse.frame import with_frame_changes
from urc.config.parse.reply import implied_reply, parse_reply
from urc.config.parse.signal import parse_signal, with_ages
from urc.config.parse.transport import parse_transport
from urc.config.values import check_range, check_within, element_of, fit, fit_hint, shown
from urc.model.driver import Argument, Command, Driver, LogLine, Message, Poll, TransportSpec
from urc.model.values import NOTHING, Reading, Value
from urc.registry import Registries

__all__ = ["parse_driver", "spoken_name"]


def parse_driver(part: Node, problems: Problems, catalog: Registries) -> Driver:
    """Return the driver at `part`; report invalid values and replace them with defaults."""
    transports = {
        name: parse_transport(inner, problems, catalog)
        for name, inner in part.named("transports").items()
    }
    # If there is only one transport, messages and commands need not name it.
    types, enums = _types(part, problems)
    lines = _Lines(transports, FormContext("", _set_by_frames(part), types, enums, catalog))
    transports = {
        name: line_with_flow(
            spec, part.must("transports").must(name), lines.context(name), problems
        )
        for name, spec in transports.items()
    }
    commands = {
        name: _command(inner, lines, problems) for name, inner in part.named("commands").items()
    }
    messages = {
        name: _message(inner, lines, problems) for name, inner in part.named("messages").items()
    }
    polls = tuple(_poll(inner, lines, commands, problems) for inner in part.listed("polls"))
    # The name check reports a sequence that has the same name as a command.
    commands = {**_sequences(part, lines, problems), **commands}
    signals = {
        name: parse_signal(inner, spoken_name(name), problems)
        for name, inner in part.named("signals").items()
    }
    signals = with_frame_changes(signals)
    return Driver(
        transports=transports,
        signals=with_ages(aged_by_lines(signals, transports, messages, polls), polls),
        commands=with_roles_of_steps(with_moving_steps(commands)),
        messages=messages,
        polls=polls,
        discovery=_discovery(part.get("discovery")),
    )


def _discovery(part: Node | None) -> tuple[str, ...]:
    """Return the service types under ``discovery``."""
    return () if part is None else tuple(str(one.data) for one in part.listed("mdns"))


def _set_by_frames(part: Node) -> frozenset[str]:
    """Return the names of all signals without a formula."""
    signals = part.named("signals").items()
    return frozenset(name for name, inner in signals if "value" not in inner.data)


def _sequences(part: Node, lines: "_Lines", problems: Problems) -> dict[str, Command]:
    context = lines.context(lines.only)
    return {
        name: parse_sequence(inner, spoken_name(name), lines.only, context, problems)
        for name, inner in part.named("sequences").items()
    }


def _types(part: Node, problems: Problems) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return the driver's ``types:`` and ``enums:``."""
    if "types" not in part.data and "enums" not in part.data:
        return NOTHING, NOTHING
    from urc.config.parse.struct.numbers import parse_enums
    from urc.config.parse.types import parse_types

    enums = parse_enums(part, problems)
    return parse_types(part, enums, problems), enums


class _Lines:
    """The transports of a driver; a driver's only transport is the default.

    Transports with `mode: forward` are never the default.
    """

    def __init__(self, transports: Mapping[str, TransportSpec], context: FormContext) -> None:
        self._transports = transports
        self._context = context
        own = [one.name for one in transports.values() if one.options.get("mode") != "forward"]
        own = own or list(transports)
        self.only = own[0] if len(own) == 1 else ""

    def name(self, part: Node, key: str) -> str:
        """Return the name of the transport under `key`, or the default transport's name."""
        return part.text(key, self.only)

    def context(self, name: str) -> FormContext:
        """Return the form context of the transport `name`; defaults for an unknown name."""
        spec = self._transports.get(name)
        encoding = spec.encoding if spec else FormContext().encoding
        return self._context._replace(encoding=encoding, framing=spec.framing if spec else None)


def spoken_name(name: str) -> str:
    """Return a readable title for a name: ``joint_1`` → ``Joint 1``."""
    words = name.replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:]


def _message(part: Node, lines: _Lines, problems: Problems) -> Message:
    transport = lines.name(part, "from")
    context, answer = lines.context(transport), part.get("acknowledge")
    read = with_collected(part, parse_read(part, problems, context), problems)
    sent = None if answer is None else parse_write(answer, problems, context)
    return Message(part.name, transport, read, sent, _log_line(part.get("log"), problems))


def _log_line(part: Node | None, problems: Problems) -> LogLine | None:
    if part is None:
        return None
    level = part.get("level")
    text = problems.template(part.must("text"))
    found = problems.expression(level) if level is not None else None
    return None if text is None else LogLine(text, found)


def _poll(part: Node, lines: _Lines, commands: dict[str, Command], problems: Problems) -> Poll:
    transport = lines.name(part, "to")
    context = lines.context(transport)
    send = part.get("send")
    asked = parse_write(send, problems, context) if send else NOTHING_SENT
    poll = Poll(
        name=part.text("name", f"polls.{part.name}"),
        transport=transport,
        every_s=problems.duration(part, "every", 1.0, least=0.005),
        send=asked,
        reply=parse_reply(part.get("reply"), problems, context) or implied_reply(asked),
        phase_s=problems.duration(part, "phase", 0.0, least=0.0, most=3600),
    )
    return poll_with_flow(poll, part, commands, problems)


def _command(part: Node, lines: _Lines, problems: Problems) -> Command:
    transport = lines.name(part, "to")
    context = lines.context(transport)
    send = parse_write(part.must("send"), problems, context)
    command = Command(
        name=part.name,
        transport=transport,
        send=send,
        arguments={name: _argument(inner, problems) for name, inner in part.named("args").items()},
        reply=parse_reply(part.get("reply"), problems, context) or implied_reply(send),
        title=part.text("title", spoken_name(part.name)),
        description=part.text("description"),
    )
    return command_with_flow(command, part, problems)


def _argument(part: Node, problems: Problems) -> Argument:
    kind = part.text("type", "number")
    of = element_of(part, kind, problems)
    low, high = check_range(part, of, problems)
    choices = [_fitting(inner, of, problems) for inner in part.listed("choices")]
    default_part = part.get("default")
    default: Reading = None
    if default_part is not None:
        default = _default(default_part, part, kind, problems)
        for one in default if isinstance(default, tuple) else (default,):
            check_within(one, low, high, default_part, problems)
            if choices and one not in choices:
                text = "the default is not one of the choices"
                problems.error(default_part, "unknown-word", text)
    _check_argument(part, kind, of, problems)
    argument = Argument(
        name=part.name,
        type=kind,  # type: ignore[arg-type]  # the schema's enum is this Literal
        title=part.text("title", spoken_name(part.name)),
        unit=part.text("unit"),
        min=low,
        max=high,
        choices=tuple(choices),
        default=default,
        is_required=part.flag("required", default=default is None),
        allows_control=part.flag("allow_control", default=False),
        description=part.text("description"),
        items=of,  # type: ignore[arg-type]  # as above
        size=part.integer("size"),
    )
    return parse_choice_questions(part, argument, problems)


def _check_argument(part: Node, kind: str, of: str, problems: Problems) -> None:
    """Report a reserved name and keys that have no effect for an argument's type."""
    if part.name in ("settings", "pi"):
        what = "the settings" if part.name == "settings" else "the number"
        problems.error(
            part,
            "bad-name",
            f"an argument cannot have the name {part.name!r}",
            key=True,
            hint=f"in templates, this name already means {what}",
        )
    if of != "string" and "allow_control" in part.data:
        problems.error(
            part,
            "misplaced-key",
            f"'allow_control' has no effect for type {kind}",
            at="allow_control",
            key=True,
        )


def _default(inner: Node, argument: Node, kind: str, problems: Problems) -> Reading:
    """Return an argument's default; report an array default of the wrong size."""
    if kind != "array":
        return _fitting(inner, kind, problems)
    if not isinstance(inner.data, list):
        text = f"expected a list, found {shown(inner.data)}"
        problems.error(inner, "wrong-type", text, hint="such as [0, 0, 0]")
        return None
    size = argument.integer("size")
    if size is not None and len(inner.data) != size:
        text = f"expected {size} elements, found {len(inner.data)}"
        problems.error(inner, "wrong-size", text)
    return tuple(_fitting(one, argument.text("items", "number"), problems) for one in inner.items())


def _fitting(part: Node, kind: str, problems: Problems) -> Value:
    try:
        return fit(part.data, kind)
    except ValueError as error:
        problems.error(part, "wrong-type", str(error), hint=fit_hint(part.data, kind))
        return None

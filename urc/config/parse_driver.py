"""A driver: mapping → `Driver`, patterns and templates compiled."""

from collections.abc import Mapping
from itertools import pairwise

from urc.config.forms import FormContext, parse_read, parse_write
from urc.config.parse_line import parse_transport
from urc.config.part import Findings, Part
from urc.config.values import check_range, check_within, fit, fit_hint
from urc.model.driver import Argument, Command, Driver, Message, Poll, Reply, TransportSpec
from urc.model.values import Limits, Signal, Value
from urc.registry import Catalog

__all__ = ["parse_driver", "spoken_name"]


def parse_driver(part: Part, findings: Findings, catalog: Catalog) -> Driver:
    """Return the driver in the mapping at `part`; what was reported is left at a default."""
    transports = {
        name: parse_transport(inner, findings, catalog)
        for name, inner in part.named("transports").items()
    }
    # Where a message comes from and a command goes to may be left out when there is one line only.
    lines = _Lines(transports)
    polls = tuple(_poll(inner, lines, findings) for inner in part.listed("polls"))
    signals = {name: _signal(inner, findings) for name, inner in part.named("signals").items()}
    return Driver(
        transports=transports,
        signals={name: _with_age(one, polls) for name, one in signals.items()},
        commands={
            name: _command(inner, lines, findings) for name, inner in part.named("commands").items()
        },
        messages={
            name: _message(inner, lines, findings) for name, inner in part.named("messages").items()
        },
        polls=polls,
    )


class _Lines:
    """The transports, for those who name one, or may leave it out because there is only one."""

    def __init__(self, transports: Mapping[str, TransportSpec]) -> None:
        self._transports = transports
        self._only = next(iter(transports)) if len(transports) == 1 else ""

    def name(self, part: Part, key: str) -> str:
        """Return the transport that `part` names under `key`."""
        return part.text(key, self._only)

    def context(self, name: str) -> FormContext:
        """Return what forms must know of the transport `name`, which may not exist."""
        spec = self._transports.get(name)
        return FormContext(spec.encoding) if spec else FormContext()


def spoken_name(name: str) -> str:
    """Return ``joint_1`` as people read it: ``Joint 1``."""
    words = name.replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:]


def reply_timeout_s(reply: Reply, transport: TransportSpec | None) -> float:
    """Return how long the answer may take."""
    if reply.timeout_s is not None:
        return reply.timeout_s
    return transport.timeouts.reply_s if transport else 2.0


def _signal(part: Part, findings: Findings) -> Signal:
    kind = part.text("type", "number")
    low, high = check_range(part, kind, findings)
    precision = part.integer("precision")
    if precision is not None and kind != "number":
        findings.error(
            part, "misplaced-key", f"'precision' means nothing for {kind}", at="precision", key=True
        )
    return Signal(
        name=part.name,
        type=kind,  # type: ignore[arg-type]  # the schema's enum is this Literal
        title=part.text("title", spoken_name(part.name)),
        unit=part.text("unit"),
        min=low,
        max=high,
        precision=precision,
        states=_states(part, kind, findings),
        limits=_limits(part, kind, (low, high), findings),
        stale_after_s=findings.duration(part, "stale_after", 0.0, least=0.05),
        description=part.text("description"),
    )


def _states(part: Part, kind: str, findings: Findings) -> tuple[tuple[str, str], ...]:
    states = part.named("states")
    if kind in ("integer", "number"):
        for raw, inner in states.items():
            try:
                float(raw)
            except ValueError:
                findings.error(
                    inner,
                    "wrong-type",
                    f"the signal is of type {kind}, and {raw!r} is no number",
                    key=True,
                    hint="make it 'type: string', or map numbers to words",
                )
    return tuple((raw, str(inner.data)) for raw, inner in states.items())


def _limits(
    part: Part, kind: str, bounds: tuple[float | None, float | None], findings: Findings
) -> Limits:
    inner = part.get("limits")
    if inner is None:
        return Limits()
    if kind not in ("integer", "number"):
        findings.error(inner, "misplaced-key", f"'limits' mean nothing for {kind}", key=True)
        return Limits()
    names = ("lolo", "low", "high", "hihi")
    values = {name: inner.number(name) for name in names}
    given = [(name, value) for name, value in values.items() if value is not None]
    for (name, value), (after, more) in pairwise(given):
        if value >= more:
            findings.error(
                inner,
                "wrong-order",
                f"{after} {more:g} is not above {name} {value:g}",
                at=after,
                hint="the order is lolo < low < high < hihi",
            )
    for name, value in given:
        check_within(value, *bounds, inner.must(name), findings)
    return Limits(**values, hysteresis=inner.number("hysteresis") or 0.0)


def _with_age(signal: Signal, polls: tuple[Poll, ...]) -> Signal:
    """Return the signal with the age at which it is old: three periods of its fastest poll."""
    if signal.stale_after_s:
        return signal
    periods = [
        poll.every_s for poll in polls if poll.reply and signal.name in poll.reply.read.fields
    ]
    return signal._replace(stale_after_s=max(1.0, 3 * min(periods)) if periods else 5.0)


def _message(part: Part, lines: _Lines, findings: Findings) -> Message:
    transport = lines.name(part, "from")
    return Message(part.name, transport, parse_read(part, findings, lines.context(transport)))


def _poll(part: Part, lines: _Lines, findings: Findings) -> Poll:
    transport = lines.name(part, "to")
    context = lines.context(transport)
    return Poll(
        name=part.text("name", f"polls.{part.name}"),
        transport=transport,
        every_s=findings.duration(part, "every", 1.0, least=0.005),
        send=parse_write(part.must("send"), findings, context),
        reply=_reply(part.get("reply"), findings, context),
        phase_s=findings.duration(part, "phase", 0.0, least=0.0, most=3600),
    )


def _reply(part: Part | None, findings: Findings, context: FormContext) -> Reply | None:
    if part is None:
        return None
    errors = [findings.pattern(inner) for inner in part.listed("errors")]
    return Reply(
        read=parse_read(part, findings, context),
        errors=tuple(error for error in errors if error is not None),
        timeout_s=findings.duration(part, "timeout", 0.0, most=3600) or None,
    )


def _command(part: Part, lines: _Lines, findings: Findings) -> Command:
    transport = lines.name(part, "to")
    context = lines.context(transport)
    return Command(
        name=part.name,
        transport=transport,
        send=parse_write(part.must("send"), findings, context),
        arguments={name: _argument(inner, findings) for name, inner in part.named("args").items()},
        reply=_reply(part.get("reply"), findings, context),
        title=part.text("title", spoken_name(part.name)),
        description=part.text("description"),
    )


def _argument(part: Part, findings: Findings) -> Argument:
    kind = part.text("type", "number")
    low, high = check_range(part, kind, findings)
    if part.name == "settings":
        findings.error(
            part,
            "bad-name",
            "an argument cannot be called 'settings'",
            key=True,
            hint="templates find the settings under that name",
        )
    choices = [_fitting(inner, kind, findings) for inner in part.listed("choices")]
    default_part = part.get("default")
    default = None
    if default_part is not None:
        default = _fitting(default_part, kind, findings)
        check_within(default, low, high, default_part, findings)
        if choices and default not in choices:
            findings.error(default_part, "unknown-word", "the default is not one of the choices")
    if kind != "string" and "allow_control" in part.data:
        findings.error(
            part,
            "misplaced-key",
            f"'allow_control' means nothing for {kind}",
            at="allow_control",
            key=True,
        )
    return Argument(
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
    )


def _fitting(part: Part, kind: str, findings: Findings) -> Value:
    try:
        return fit(part.data, kind)
    except ValueError as error:
        findings.error(part, "wrong-type", str(error), hint=fit_hint(part.data, kind))
        return None

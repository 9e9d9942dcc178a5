"""The manual page of a profile in Markdown: the robot, its signals and its commands.

Layer 4, pure. The same profile always produces the same page. The page is written for operators and
quotes the document's descriptions.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from urc.config.node import shown_duration
from urc.config.values import shown
from urc.expressions import Template
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.exchange import Sight
from urc.model.interface import WidgetUse
from urc.model.payload import each_of, traffic_of
from urc.model.profile import Profile, Setting
from urc.model.values import AlarmLimits, Reading, Signal
from urc.problems import UrcError, printable
from urc.protocol.framing.table import build_framing
from urc.protocol.requests.encode import build_encode
from urc.protocol.values.payload import CodecContext

__all__ = ["manual"]

_SHOWN_BYTES: Final = 48
_SHOWN_TEXTS: Final = 12
_MARKUP: Final = {ord(char): f"\\{char}" for char in "\\`*_[]<>|#"}
_LIMITS: Final = (
    ("lolo", "alarm at or below {}"),
    ("low", "warning at or below {}"),
    ("high", "warning at or above {}"),
    ("hihi", "alarm at or above {}"),
)


def manual(profile: Profile) -> str:
    """Return the manual page as Markdown."""
    driver = profile.driver
    sections = (
        ("Settings", _settings(profile.settings)),
        ("Connections", _connections(driver)),
        ("Signals", _signals(driver.signals)),
        ("Commands", _commands(driver)),
        ("When control is lost", _releases(driver)),
        ("Interfaces", _interfaces(profile)),
        ("Polls", _polls(driver)),
        ("Tests", [f"- {_plain(test.name)}" for test in profile.tests]),
        ("Licence", _origin(profile)),
    )
    lines = [f"# {_plain(profile.title)}", ""]
    if profile.summary:
        lines += [_plain(profile.summary), ""]
    for title, inside in sections:
        text = list(inside)
        if text:
            lines += [f"## {title}", "", *text, ""]
    return "\n".join(lines).rstrip("\n") + "\n"


def _settings(settings: Mapping[str, Setting]) -> Iterator[str]:
    if not settings:
        return
    rows = []
    for setting in settings.values():
        empty = "to be filled in" if setting.is_required else "may stay empty"
        default = empty if setting.default is None else _code(_value(setting.default))
        if setting.is_secret:
            default = f"secret, {empty}"
        allowed = ", ".join(_code(choice) for choice in setting.choices)
        allowed = allowed or _range(setting.min, setting.max, "")
        rows.append((_code(setting.name), _plain(setting.title), setting.type, default, allowed))
    yield from _table(("setting", "", "type", "default", "allowed"), rows)
    yield from _descriptions(settings.values())


def _connections(driver: Driver) -> Iterator[str]:
    rows = []
    for spec in driver.transports.values():
        options = ", ".join(
            f"{name} {_code(option.source if isinstance(option, Template) else str(option))}"
            for name, option in spec.options.items()
        )
        kept = "kept" if spec.connection == "persistent" else "one for each request"
        rows.append((_code(spec.name), spec.type, options, spec.framing.type, kept))
    yield from _table(("name", "type", "to", "framing", "connection"), rows)


def _signals(signals: Mapping[str, Signal]) -> Iterator[str]:
    if not signals:
        return
    rows = [
        (
            _code(signal.name),
            _plain(signal.title),
            signal.type,
            _plain(signal.unit),
            _range(signal.min, signal.max, ""),
            _limits(signal.limits),
            _states(signal),
            shown_duration(signal.stale_after_s),
        )
        for signal in signals.values()
    ]
    header = ("signal", "", "type", "unit", "range", "limits", "states", "stale after")
    yield from _table(header, rows)
    yield from _descriptions(signals.values())
    yield from _alarms(signals.values())


def _alarms(signals: Iterable[Signal]) -> Iterator[str]:
    """Yield the alarm response table: priority, cause and action of each alarm."""
    rows = []
    for signal in signals:
        limits = signal.limits
        for name, text in _LIMITS:
            if (value := getattr(limits, name)) is not None:
                rows.append(_alarm(signal, name, text.format(f"{value:g}")))
        rows += [_alarm(signal, word, _plain(word)) for word in limits.states]
    if any(cause or action or suppressed for *_, cause, action, suppressed in rows):
        yield from ("", "### Alarms", "")
        header = ("signal", "alarm", "priority", "cause", "action", "suppressed when")
        yield from _table(header, rows)


def _alarm(signal: Signal, condition: str, text: str) -> tuple[str, ...]:
    one = signal.limits.attributes_of(condition)
    suppressed = "" if one.suppressed_when is None else _code(one.suppressed_when.source)
    name = _code(signal.name)
    return (name, text, one.priority, _plain(one.cause), _plain(one.action), suppressed)


def _limits(limits: AlarmLimits) -> str:
    told = [
        text.format(f"{value:g}")
        for name, text in _LIMITS
        if (value := getattr(limits, name)) is not None
    ]
    if told and limits.hysteresis:
        told.append(f"hysteresis {limits.hysteresis:g}")
    told += [_plain(word) for word in limits.states[:_SHOWN_TEXTS]]
    return ", ".join(told)


def _states(signal: Signal) -> str:
    shown_ones = signal.states[:_SHOWN_TEXTS]
    more = ", …" if len(signal.states) > _SHOWN_TEXTS else ""
    return ", ".join(f"{_code(raw)} {_plain(word)}" for raw, word in shown_ones) + more


def _commands(driver: Driver) -> Iterator[str]:
    for command in driver.commands.values():
        yield from (f"### {_plain(command.title)}", "")
        if command.description:
            yield from (_plain(command.description), "")
        yield f"- name: {_code(command.name)}"
        yield from _what_goes_out(command, driver.transports.get(command.transport))
        if command.confirm is not None:
            asked = _plain(command.confirm.text) or "yes"
            two = ", two people" if command.confirm.is_two_person else ""
            yield f"- asks first ({command.confirm.level}{two}): {asked}"
        if command.role != "drive":
            yield f"- needs the role {command.role}"
        for argument in command.arguments.values():
            for value, one in argument.confirm.items():
                two = ", two people" if one.is_two_person else ""
                what = f"{_code(argument.name)} {_code(value)}"
                yield f"- asks before {what} ({one.level}{two}): {_plain(one.text)}"
        for requirement in command.requires:
            yield f"- needs {_code(requirement.condition.source)}: {_plain(requirement.text)}"
        if command.verify is not None:
            within = shown_duration(command.verify.within_s)
            yield f"- done when {_code(command.verify.condition.source)}, within {within}"
        if command.hold is not None:
            every = shown_duration(command.hold.repeat_s)
            yield f"- held: sent every {every} while the control is held"
            if (sight := command.hold.sight) is not None:
                yield f"- needs a current image of {_code(sight.signal)}: {_image_limits(sight)}"
        if command.moves:
            where = f" where {_code(command.moves_if.source)}" if command.moves_if else ""
            until = "refused while STOP is latched or another operator is driving"
            yield f"- moves the robot autonomously{where}: {until}"
        if command.stops:
            yield "- sent once when STOP is pressed"
        yield ""
        yield from _arguments(command)


def _what_goes_out(command: Command, spec: TransportSpec | None) -> Iterator[str]:
    if command.steps:
        yield f"- a sequence of {len(command.steps)} step{'' if len(command.steps) == 1 else 's'}"
        return
    data = _constant_bytes(command, spec)
    if data is not None:
        yield f"- sends {_code(_text_of(data))}, in hex {_code(_hex_of(data))}"
    else:
        for one in each_of(command.send):
            template = one.options.get("template")
            if isinstance(template, Template):
                yield f"- sends {_code(template.source)}"
    if command.reply is None:
        yield "- done when the frame is sent"


def _constant_bytes(command: Command, spec: TransportSpec | None) -> bytes | None:
    """Return the bytes that a command sends; None if they are not always the same."""
    if command.send.names or spec is None:
        return None
    try:
        encode = build_encode(
            command.send,
            build_framing(spec.framing),
            CodecContext(spec.encoding, has_keys=spec.has_keys),
        )
        return traffic_of(encode({}))
    except UrcError:
        return None  # a counter, for example, changes the frame each time


def _text_of(data: bytes) -> str:
    text = printable(data[:_SHOWN_BYTES].decode("latin-1"))
    return text + ("…" if len(data) > _SHOWN_BYTES else "")


def _hex_of(data: bytes) -> str:
    return data[:_SHOWN_BYTES].hex(" ") + (" …" if len(data) > _SHOWN_BYTES else "")


def _arguments(command: Command) -> Iterator[str]:
    if not command.arguments:
        return
    rows = [
        (
            _code(argument.name),
            _plain(argument.title),
            argument.type,
            _plain(argument.unit),
            _allowed(argument),
            _need(argument),
        )
        for argument in command.arguments.values()
    ]
    yield from _table(("argument", "", "type", "unit", "allowed", "default"), rows)
    yield from _descriptions(command.arguments.values())


def _allowed(argument: Argument) -> str:
    if argument.choices:
        return ", ".join(_code(_value(choice)) for choice in argument.choices)
    return _range(argument.min, argument.max, "")


def _image_limits(sight: Sight) -> str:
    """Describe the ages of an image at which a motion slows down and ends."""
    stops = f"stops at an age of {shown_duration(sight.stop_after_s)}"
    if sight.slow_after_s is None:
        return stops
    return f"slower from an age of {shown_duration(sight.slow_after_s)}, {stops}"


def _need(argument: Argument) -> str:
    if argument.default is not None:
        return _code(_value(argument.default))
    return "needed" if argument.is_required else ""


def _releases(driver: Driver) -> Iterator[str]:
    """Yield what the server sends after a release, or after it loses contact with the operator."""
    for command in driver.commands.values():
        if command.hold is not None and command.hold.step_s is not None:
            lasts = shown_duration(command.hold.step_s)
            yield f"- {_code(command.name)}: nothing is sent"
            yield f"  - The robot moves in steps of at most {lasts}, and stops after each step."
        elif command.hold is not None:
            values = {
                name: command.hold.release.get(name, argument.default)
                for name, argument in command.arguments.items()
            }
            given = ", ".join(f"{name} {_value(value)}" for name, value in values.items())
            yield f"- {_code(command.name)}: {_code(given) if given else 'nothing more is sent'}"
            yield f"  - {_by_itself(command.hold.watchdog_s)}"


def _by_itself(watchdog_s: float | None) -> str:
    """Describe the robot's reaction if no more frames arrive, not even for a release."""
    if watchdog_s is None:
        return "The document does not state whether the robot stops by itself."
    if math.isinf(watchdog_s):
        return "The robot does not stop by itself: the last command continues."
    after = shown_duration(watchdog_s)
    return f"Without further commands, the robot stops by itself after {after}."


def _interfaces(profile: Profile) -> Iterator[str]:
    """Yield the widgets of all declared interfaces, or of the generated interface."""
    for place, interface in enumerate(profile.interfaces.values()):
        found = {
            slot: interface.widgets.get(slot) or profile.slots.get(slot) for slot in interface.shown
        }
        uses = [use for use in found.values() if use is not None]
        pages = ", ".join(_plain(page.title or page.name) for page in interface.tabs.values())
        if uses:
            yield from ([""] if place else [])
            yield from (f"### {_plain(interface.title or interface.name)}", "")
            if pages:
                yield from (f"Pages: {pages}.", "")
            yield from _table(("slot", "widget", "shows", "gives"), [_use(use) for use in uses])


def _use(use: WidgetUse) -> tuple[str, str, str, str]:
    shows = [*use.inputs.values(), *(name for many in use.lists.values() for name in many)]
    more = ", …" if len(shows) > _SHOWN_TEXTS else ""
    return (
        _code(use.slot),
        use.widget,
        ", ".join(map(_code, shows[:_SHOWN_TEXTS])) + more,
        ", ".join(map(_code, use.outputs.values())),
    )


def _polls(driver: Driver) -> Iterator[str]:
    for poll in driver.polls:
        fields = poll.reply.read.fields if poll.reply else ()
        sets = ", ".join(_code(name) for name in fields if not name.startswith("_"))
        what = f" → {sets}" if sets else ""
        yield f"- {_code(poll.name)} every {shown_duration(poll.every_s)}{what}"


def _origin(profile: Profile) -> Iterator[str]:
    if profile.licence:
        yield _plain(profile.licence)
    if profile.author:
        yield f"By {_plain(profile.author)}."


def _range(low: float | None, high: float | None, otherwise: str) -> str:
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    if low is not None:
        return f"{low:g} or more"
    return otherwise if high is None else f"{high:g} or less"


def _value(value: Reading) -> str:
    return value if isinstance(value, str) else shown(value)


def _descriptions(named: Iterable[Signal | Argument | Setting]) -> Iterator[str]:
    told = [f"- {_code(one.name)}: {_plain(one.description)}" for one in named if one.description]
    if told:
        yield from ("", *told)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a Markdown table without its empty columns."""
    kept = [place for place in range(len(header)) if any(row[place] for row in rows)]
    yield f"| {' | '.join(header[place] for place in kept)} |"
    yield f"|{'---|' * len(kept)}"
    for row in rows:
        yield f"| {' | '.join(row[place] for place in kept)} |"


def _plain(text: str) -> str:
    """Return text from a document, with Markdown characters escaped."""
    return printable(" ".join(text.split())).translate(_MARKUP)


def _code(text: str) -> str:
    """Return text as Markdown code; escape vertical bars, which would end the table cell."""
    clean = printable(text).replace("|", "\\|")
    if "`" in clean:
        return f"`` {clean} ``"
    return f"`{clean}`" if clean else ""

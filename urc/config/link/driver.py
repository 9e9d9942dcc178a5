"""Checks all names of transports, signals, settings and arguments in a driver."""

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from urc.config.link.coordinate_frames import link_coordinate_frames
from urc.config.link.flow import (
    link_command,
    link_keepalives,
    link_poll,
    link_refusals,
    said_on,
)
from urc.config.link.frames import check_frames
from urc.config.link.messages import check_messages, check_via
from urc.config.link.signals import link_signals
from urc.config.link.steps import link_sequences
from urc.config.node import Node, Problems
from urc.config.parse.form import read_form, write_form
from urc.config.parse.reply import refuse
from urc.config.parse.simulator import SimulatorSpec
from urc.config.parse.transport import option_templates
from urc.config.schemas import read_schema
from urc.config.sources import Sources
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import COUNTERS, NONCE, Template
from urc.model.driver import Driver
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.profile import Setting
from urc.model.values import NOTHING, WHOLE_TYPES, Reading
from urc.model.world import WorldSpec

__all__ = ["NameUses", "link_driver", "link_simulator"]


_ONE_SETTING: Final = re.compile(r"\{\{\s*settings\.([a-z]\w*)\s*\}\}")
_LEVELS: Final = ("info", "warning", "error")
_NUMBERS: Final = ("port", "integer", "number")


def check_option(
    part: Node, kind: str, template: Template, settings: Mapping[str, Setting], problems: Problems
) -> None:
    """Report a setting in `template` if its type is wrong for the option at `part`.

    For built-in transports, `kind` is the name of a definition in the driver's schema.
    """
    found = _ONE_SETTING.fullmatch(template.source)
    setting = settings.get(found[1]) if found else None
    if found is None or setting is None:
        return
    schema: Any = read_schema("driver.schema.json")
    option = schema["$defs"].get(kind, {}).get("properties", {}).get(part.name, {})
    wants_number = "pattern" in option and "integer" in option.get("type", ())
    if wants_number and setting.type not in _NUMBERS:
        wanted, hint = "a whole number", "port" if part.name == "port" else "integer"
    elif part.name == "host" and setting.type in (*_NUMBERS, "boolean"):
        wanted, hint = "a name or an address", "host"
    else:
        return
    problems.error(
        part,
        "wrong-type",
        f"'{part.name}' must be {wanted}, but the setting {found[1]!r} has the type {setting.type}",
        hint=f"give the setting 'type: {hint}'",
    )


class NameUses:
    """The declared names that a driver uses, from which the rules find unused declarations."""

    def __init__(self) -> None:
        self.settings: set[str] = set()
        self.transports: set[str] = set()
        self.signals: set[str] = set()
        """Names of the signals that a frame can set."""


class _Linker:
    def __init__(self, driver: Driver, settings: Mapping[str, Setting], problems: Problems) -> None:
        self.driver = driver
        self.settings = settings
        self.problems = problems
        self.uses = NameUses()

    def transport(self, part: Node, key: str, name: str) -> None:
        """Check the transport name under `key`, which is optional if there is one transport."""
        if name in self.driver.transports:
            self.uses.transports.add(name)
            return
        names = self.driver.transports
        if key in part.data:
            self.problems.unknown(part, "unknown-transport", name, names, at=key)
        else:
            self.problems.error(
                part,
                "missing-key",
                f"'{key}' is required, because the driver has {len(names)} transports",
                key=True,
                hint=did_you_mean("", names, "transports"),
            )

    def fields(self, part: Node, read: ReadSpec) -> None:
        """Check that each field of a reply or message is a signal or starts with ``_``."""
        found = read_form(part)
        if found is None:
            return
        inner, form = found
        for field in read.fields:
            if field in read.sets:
                self.field(part.must("set").must(field), field, {"key": True})
            elif field in read.head:
                self.field(part.must("head").must(field), field, {"key": True})
            elif field in read.collects:
                self.field(part.must("collect").must(field), field, {"key": True})
            elif kind := self._whole_type(field, read):
                self.problems.error(
                    inner,
                    "wrong-type",
                    f"signal {field!r} is of type {kind}, which needs the form json",
                    hint=f'write json: {{ {field}: "@" }} for a whole message',
                )
            elif field in self.driver.signals or not field.startswith("_"):
                place, where = form.place_of(inner, field)
                self.field(place, field, where)
        self._beside(part, read)

    def _whole_type(self, field: str, read: ReadSpec) -> str:
        """Return the type of a signal that is a whole message, if this form can't read it."""
        signal = self.driver.signals.get(field)
        is_whole = signal is not None and signal.type in WHOLE_TYPES
        return signal.type if signal is not None and is_whole and read.form != "json" else ""

    def field(self, part: Node, name: str, place: Mapping[str, int | bool]) -> None:
        """Check the name of one signal that `part` sets."""
        if name in self.driver.signals:
            self.uses.signals.add(name)
        elif not name.startswith("_"):
            self.problems.error(
                part,
                "unknown-signal",
                f"{name!r} is not a signal",
                hint=did_you_mean(name, self.driver.signals, "signals"),
                **place,
            )

    def _beside(self, part: Node, read: ReadSpec) -> None:
        known = [
            name for name in read.fields if name not in read.sets and name not in read.collects
        ]
        for name, inner in part.named("fields").items():
            if name not in known:
                self.problems.error(
                    inner,
                    "unknown-field",
                    f"{name!r} is not a field of this frame",
                    key=True,
                    hint=did_you_mean(name, known, "fields"),
                )
        if read.topic is not None:
            self.template(part.must("subscribe").must("topic"), read.topic)
        for name, template in read.sets.items():
            self.template(part.must("set").must(name), template, known)
        if read.when is not None:
            self.template(part.must("when"), read.when, known)
        for name, collect in read.collects.items():
            inner = part.must("collect").must(name)
            for key in ("value", "begin", "end"):
                template = getattr(collect, key)
                if template is not None:
                    self.template(inner.must(key), template, (*known, *read.sets))

    def templates(self, part: Node, spec: WriteSpec, known: Iterable[str] = ()) -> None:
        """Check the names in every template under ``send:``."""
        inner, form = write_form(part)
        for place, template in form.templates(inner, spec):
            self.template(place, template, known)

    def template(
        self,
        part: Node,
        template: Template,
        known: Iterable[str] = (),
        *,
        words: Iterable[str] = (),
    ) -> None:
        """Check every name in a template; a name among `words` is probably text without quotes."""
        allowed = {*known, "settings"}
        for used in sorted(template.names - allowed):
            name, hint = self._meant(used, allowed - {COUNTERS, NONCE})
            if used in words:
                hint = f"text in an expression needs quotes of its own: \"'{used}'\""
            self._unknown(
                part,
                template,
                rf"(?<![\w.]){name}(?!\w)",
                name,
                "unknown-name",
                f"{name!r} is unknown here",
                hint,
            )
        signals = self.driver.signals
        if any(name in signals and signals[name].states for name in template.names & allowed):
            from urc.config.link.states import check_words

            check_words(self.problems, part, template, signals)
        if "world" in template.names and "world" not in self.driver.signals:
            from urc.config.link.world import check_readings

            check_readings(self.problems, part, template)
        self.uses.settings |= template.settings
        for name in sorted(template.settings - self.settings.keys()):
            self._unknown(
                part,
                template,
                rf"settings\W+{name}(?!\w)",
                name,
                "unknown-setting",
                f"there is no setting {name!r}",
                did_you_mean(name, self.settings, "settings"),
            )
        if "settings" in template.names and not template.settings:
            self._unknown(
                part,
                template,
                r"settings",
                "settings",
                "unknown-setting",
                "'settings' contains all settings; name one of them",
                did_you_mean("", self.settings, "settings"),
            )

    def _meant(self, name: str, allowed: Iterable[str]) -> tuple[str, str]:
        """Return the unknown name in the document's notation, and a hint."""
        if name == NONCE:
            return "nonce", "only 'send' can use a nonce"
        if name == COUNTERS:
            return "seq", "only 'send' can use a counter"
        if name in self.settings:
            return name, f"write settings.{name}"
        if name == "params":
            return name, "parameters need single braces: {params.NAME}"
        return name, did_you_mean(name, allowed, "names")

    def _unknown(
        self,
        part: Node,
        template: Template,
        pattern: str,
        name: str,
        code: str,
        message: str,
        hint: str,
    ) -> None:
        found = re.search(pattern, template.source)
        offset = found.end() - len(name) if found else 0
        self.problems.error(part, code, message, offset=offset, length=len(name), hint=hint)


def link_driver(
    part: Node, driver: Driver, settings: Mapping[str, Setting], problems: Problems
) -> NameUses:
    """Check every name in the driver at `part`; return the used names."""
    linker = _Linker(driver, settings, problems)
    answered = {one.transport for one in driver.commands.values() if one.reply}
    answered |= {one.transport for one in driver.polls if one.reply}
    for name, inner in part.named("transports").items():
        link_refusals(linker, inner, driver.transports[name].faults)
        if name not in answered:
            refuse(
                inner, ("errors",), "has no effect, because this transport has no replies", problems
            )
        for place, template in option_templates(inner, driver.transports[name]):
            linker.template(place, template)
            check_option(place, driver.transports[name].type, template, settings, problems)
    linker.uses.transports |= check_via(part.named("transports"), driver.transports, problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        link_poll(linker, inner, poll)
    _check_poll_names(part, driver, problems)
    link_signals(part, driver, linker.template, problems)
    link_coordinate_frames(part, driver, linker.template, problems)
    for name, inner in part.named("commands").items():
        command = driver.commands[name]
        linker.transport(inner, "to", command.transport)
        known = (*command.arguments, *said_on(driver, command.transport))
        linker.templates(inner.must("send"), command.send, known)
        _check_arguments_used(inner, command.send, problems)
        link_command(linker, inner, command)
    link_keepalives(linker, part)
    link_sequences(linker, part)
    check_frames(part, driver, problems)
    check_messages(part, driver, problems)
    for name, inner in part.named("messages").items():
        message = driver.messages[name]
        linker.transport(inner, "from", message.transport)
        linker.fields(inner, message.read)
        if message.acknowledge is not None:
            known = (*message.read.fields, *driver.signals, *said_on(driver, message.transport))
            linker.templates(inner.must("acknowledge"), message.acknowledge, known)
        if message.log is not None:
            line = inner.must("log")
            known = (*message.read.fields, *driver.signals, *said_on(driver, message.transport))
            linker.template(line.must("text"), message.log.text, known)
            if message.log.level is not None:
                linker.template(line.must("level"), message.log.level, known, words=_LEVELS)
    return linker.uses


def _check_poll_names(part: Node, driver: Driver, problems: Problems) -> None:
    """Report a poll that has the same name as another poll or as a command."""
    seen: set[str] = set(driver.commands)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        if poll.name in seen:
            other = "a command" if poll.name in driver.commands else "another poll"
            problems.error(
                inner,
                "duplicate-name",
                f"{other} also has the name {poll.name!r}",
                at="name",
                hint="give each of them its own name",
            )
        seen.add(poll.name)


def _check_arguments_used(part: Node, send: WriteSpec, problems: Problems) -> None:
    for name, inner in part.named("args").items():
        if name in send.names:
            continue
        text = f"nothing sends the argument {name!r}"
        if _has_single_braces(part, name):
            hint = f"write two braces: {{{{ {name} }}}}"
            problems.warn(part, "unused-argument", text, at="send", hint=hint)
        else:
            hint = f"write {{{{ {name} }}}} in 'send', or remove the argument"
            problems.warn(inner, "unused-argument", text, key=True, hint=hint)


def _has_single_braces(part: Node, name: str) -> bool:
    """Return whether 'send' has the argument in single braces, as in a Python f-string."""
    send = part.get("send")
    return send is not None and isinstance(send.data, str) and f"{{{name}}}" in send.data


def link_simulator(
    sources: Sources,
    driver: Driver,
    simulated: SimulatorSpec,
    settings: Mapping[str, Setting],
    problems: Problems,
) -> tuple[Mapping[str, Reading], WorldSpec | None]:
    """Check every name in the emulated robot; return its initial values and world."""
    if not sources.simulator and not sources.rules:
        return NOTHING, None
    from urc.config.link.rules import link_rules, link_values

    linker = _Linker(driver, settings, problems)
    parts, world = sources.simulator, simulated.world
    state = parts["state"].data if "state" in parts else ()
    if world is not None:
        from urc.config.link.world import link_world

        world = link_world(linker, parts["world"], world, state, parts)
    for name, found in simulated.rules.items():
        part = sources.rules[name]
        if name not in driver.transports:
            problems.unknown(part, "unknown-transport", name, driver.transports, key=True)
            continue
        link_rules(linker, part, found, state, world)
    return link_values(parts, driver, problems), world

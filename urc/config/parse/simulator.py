"""The emulated robot of a document: its first values, and the rules of each transport."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.config.parse.form import FormContext, parse_read, parse_write
from urc.config.parse.framing import parse_framing
from urc.config.part import Findings, Part
from urc.config.sources import Sources
from urc.expressions import Template
from urc.model.codec import ReadSpec
from urc.model.driver import Driver
from urc.model.flow import MAX_STEP_S
from urc.model.profile import Reaction, SimulatorRule
from urc.model.values import NOTHING, Reading
from urc.model.world import WorldSpec
from urc.patterns import Pattern
from urc.registry import Catalog

__all__ = ["Simulated", "parse_simulator"]

_TRIGGERS: Final = ("match", "command", "poll", "every")


class Simulated(NamedTuple):
    """The emulated robot of a document, before its names are looked up."""

    rules: Mapping[str, list[SimulatorRule]] = NOTHING
    """By transport."""
    world: WorldSpec | None = None


def parse_simulator(
    sources: Sources, driver: Driver, catalog: Catalog, findings: Findings
) -> Simulated:
    """Return the rules of each transport, and the world; their names are looked up later."""
    found: dict[str, list[SimulatorRule]] = {}
    context = FormContext(catalog=catalog)
    if any(_needs_types(part.data) for part in sources.rules.values()):
        from urc.config.parse.struct.numbers import parse_enums
        from urc.config.parse.types import parse_types

        quiet = Findings()  # the driver has reported them
        enums = parse_enums(sources.driver, quiet)
        types = parse_types(sources.driver, enums, quiet)
        context = context._replace(types=types, enums=enums)
    for name, part in sources.rules.items():
        spec = driver.transports.get(name)
        if spec is not None:
            context = context._replace(encoding=spec.encoding, framing=spec.framing)
        found[name] = [_rule(inner, name, findings, context) for inner in part.items()]
        _check_names(part, found[name], findings)
    world = sources.simulator.get("world")
    if world is None:
        return Simulated(found)
    from urc.config.parse.world import parse_world

    return Simulated(found, parse_world(world, findings))


def _check_names(part: Part, rules: list[SimulatorRule], findings: Findings) -> None:
    """Report two rules of one name: a document that builds on them could not choose one."""
    seen: set[str] = set()
    for inner, rule in zip(part.items(), rules, strict=True):
        if rule.name and rule.name in seen:
            text = f"two rules of {rule.transport!r} are called {rule.name!r}"
            findings.error(inner, "duplicate-name", text, at="name", hint="rename one of them")
        seen.add(rule.name)


def _needs_types(data: object) -> bool:
    """Return whether there is a binary form anywhere."""
    if isinstance(data, dict):
        return "struct" in data or any(map(_needs_types, data.values()))
    return isinstance(data, list) and any(map(_needs_types, data))


def _rule(part: Part, transport: str, findings: Findings, context: FormContext) -> SimulatorRule:
    triggers = [key for key in _TRIGGERS if key in part.data]
    if len(triggers) != 1:
        _not_one_trigger(part, triggers, findings)
    request = part.text("command") or part.text("poll")
    does = any(key in part.data for key in ("set", "send", "message", "close", "then"))
    if "every" in part.data and not does:
        findings.error(
            part, "missing-key", "'send' is missing: what is said every so often?", key=True
        )
    when, match = part.get("when"), part.get("match")
    first = _reaction(part, findings, context, answers=bool(request) and not _speaks(part))
    if "every" in part.data and first.after_s:
        text = "what is done every so often needs no time before it"
        findings.error(part, "misplaced-key", text, at="after", key=True)
    return SimulatorRule(
        transport=transport,
        name=part.text("name"),
        match=None if match is None else _match(match, findings, context),
        request=request,
        every_s=(
            findings.duration(part, "every", 1.0, least=0.005) if "every" in part.data else None
        ),
        when=None if when is None else findings.expression(when),
        reactions=(
            first,
            *(_reaction(inner, findings, context) for inner in part.listed("then")),
        ),
    )


def _speaks(part: Part) -> bool:
    """Return whether a rule has an answer of its own, now or later."""
    return any("send" in one.data or "answer" in one.data for one in (part, *part.listed("then")))


def _not_one_trigger(part: Part, triggers: list[str], findings: Findings) -> None:
    if not triggers:
        findings.error(
            part,
            "missing-key",
            "'match' or 'every' is missing from this rule",
            key=True,
            hint="a rule takes a frame (match, command, poll), or speaks every so often",
        )
        return
    both = f"'{triggers[0]}' and '{triggers[1]}'"
    findings.error(
        part,
        "misplaced-key",
        f"{both} both say when this rule is used",
        at=triggers[1],
        key=True,
        hint="make two rules of it",
    )


def _match(part: Part, findings: Findings, context: FormContext) -> Pattern | ReadSpec | None:
    if isinstance(part.data, str):
        return findings.pattern(part)
    return parse_read(part, findings, context)


def _reaction(
    part: Part, findings: Findings, context: FormContext, *, answers: bool = False
) -> Reaction:
    answer = part.text("answer")
    send, framing = part.get("send"), part.get("framing")
    if framing is not None and send is None:
        text = "'framing' is for what is sent, and there is no 'send'"
        findings.error(part, "misplaced-key", text, at="framing", key=True)
    if framing is not None:
        context = context._replace(framing=None)
    return Reaction(
        after_s=findings.duration(part, "after", 0.0, least=0.0, most=MAX_STEP_S),
        sets=_sets(part.named("set"), findings),
        answers=answers if not answer else answer == "auto",
        send=None if send is None else parse_write(send, findings, context),
        message=part.text("message"),
        framing=(
            parse_framing(framing, context.encoding, findings, context.catalog)
            if framing is not None and context.catalog is not None
            else None
        ),
        closes=part.flag("close", default=False),
    )


def _sets(parts: Mapping[str, Part], findings: Findings) -> dict[str, Template | Reading]:
    values: dict[str, Template | Reading] = {}
    for name, inner in parts.items():
        if isinstance(inner.data, str):
            template = findings.template(inner)
            if template is not None:
                values[name] = template
        else:
            values[name] = tuple(inner.data) if isinstance(inner.data, list) else inner.data
    return values

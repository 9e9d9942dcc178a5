"""Parser for emulated robots: the world and the rules of each transport."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple, TypeVar

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, parse_read, parse_write
from urc.config.parse.framing import parse_framing
from urc.config.sources import Sources
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import given
from urc.expressions import Template
from urc.model.driver import Driver
from urc.model.payload import ReadSpec
from urc.model.profile import Reaction, SimulatorRule
from urc.model.sequence import MAX_STEP_S
from urc.model.values import NOTHING, Reading
from urc.model.world import (
    BODY_KEYS,
    INPUTS,
    BatterySpec,
    BodySpec,
    Box,
    CameraSpec,
    Failsafe,
    LaserSpec,
    OdometrySpec,
    PlanSpec,
    Wall,
    WorldSpec,
)
from urc.patterns import Pattern
from urc.registry import Registries

__all__ = ["SimulatorSpec", "parse_simulator"]


_DEGREES: Final = {
    "body": ("steer", "amplitude", "roughness"),
    "laser": ("first", "last"),
    "camera": ("fov", "tilt"),
}
"""Model fields whose values are in degrees in documents, by part of the world."""
_KEYS: Final = {"first": "from", "last": "to"}
"""Keys of a laser in documents, for the model fields that have other names."""
_LONGEST_S: Final = 3600.0

Spec = TypeVar("Spec", bound=Any)


def parse_world(part: Node, problems: Problems) -> WorldSpec:
    """Return the world at `part`, with unresolved names."""
    if "body" not in part.data:
        text = "this world has no 'body'"
        hint = "write body: { type: differential }, or another type"
        problems.error(part, "missing-key", text, key=True, hint=hint)
        return WorldSpec()
    body = _filled(BodySpec(), part, "body")
    _check_body(part.must("body"), body, problems)
    _check_inputs(part, body, problems)
    laser = _filled(LaserSpec(), part, "laser")
    battery = _filled(BatterySpec(), part, "battery")
    if laser.first >= laser.last:
        text = "the end of the field of view is before its start"
        problems.error(part.must("laser"), "wrong-order", text, key=True)
    if battery.empty >= battery.full:
        text = f"'empty' ({battery.empty:g} V) is not below 'full' ({battery.full:g} V)"
        problems.error(part.must("battery"), "wrong-order", text, key=True)
    plan, start, datum = part.get("map"), part.get("start"), part.get("datum")
    return WorldSpec(
        body=body,
        drive={name: _value(one, problems) for name, one in part.named("drive").items()},  # type: ignore[misc]  # as the schema says
        senses=_templates(part.named("signals"), problems),
        failsafe=_failsafe(part.get("failsafe"), problems),
        map=None if plan is None else _plan(plan),
        start=WorldSpec().start if start is None else _start(start),
        datum=WorldSpec().datum if datum is None else _datum(datum),
        seed=part.integer("seed") or 0 if "seed" in part.data else 1,
        odometry=_filled(OdometrySpec(), part, "odometry"),
        laser=laser,
        camera=_camera(part, problems),
        battery=battery,
    )


def _start(part: Node) -> tuple[float, float, float]:
    x, y = _pair(part, "at") if "at" in part.data else (0.0, 0.0)
    return x, y, math.radians(part.number("yaw") or 0.0)


def _datum(part: Node) -> tuple[float, float, float]:
    found = map(part.number, ("latitude", "longitude", "altitude"))
    latitude, longitude, altitude = (
        default if one is None else one
        for one, default in zip(found, WorldSpec().datum, strict=True)
    )
    return latitude, longitude, altitude


def _pair(part: Node, key: str) -> tuple[float, float]:
    x, y = part.must(key).data
    return x, y


def _filled(spec: Spec, part: Node, key: str) -> Spec:
    """Return `spec` with the values in the document; degrees become radians."""
    values: dict[str, object] = {}
    inner = part.get(key)
    for field in spec._fields:
        one = inner.get(_KEYS.get(field, field)) if inner is not None else None
        if one is None:
            continue
        is_angle = field in _DEGREES.get(key, ())
        is_whole = isinstance(getattr(spec, field), int) and not isinstance(one.data, (bool, str))
        values[field] = (
            math.radians(one.data) if is_angle else int(one.data) if is_whole else one.data
        )
    filled: Spec = spec._replace(**values)
    return filled


def _camera(part: Node, problems: Problems) -> CameraSpec:
    spec, inner = _filled(CameraSpec(), part, "camera"), part.get("camera")
    found: dict[str, Any] = {}
    for key in ("flip", "mirror"):
        if inner is not None and isinstance(inner.data.get(key), str):
            found[key] = problems.template(inner.must(key)) or False
    return spec._replace(**found)


def _check_body(part: Node, body: BodySpec, problems: Problems) -> None:
    for key in part.data:
        kinds = BODY_KEYS.get(key)
        if kinds is not None and body.type not in kinds:
            text = f"'{key}' has no effect for type {body.type}, only for {' and '.join(kinds)}"
            problems.error(part, "misplaced-key", text, at=key, key=True)


def _check_inputs(part: Node, body: BodySpec, problems: Problems) -> None:
    known = INPUTS[body.type]
    for name, inner in part.named("drive").items():
        if name not in known:
            text = f"a body of type {body.type} has no input {name!r}"
            hint = did_you_mean(name, known, "inputs") or f"it has {', '.join(known)}"
            problems.error(inner, "unknown-input", text, key=True, hint=hint)


def _value(part: Node, problems: Problems) -> Template | Reading:
    if isinstance(part.data, str):
        return problems.template(part) or 0.0
    value = given(part.data)
    return float(value) if isinstance(value, bool) else value


def _templates(parts: Mapping[str, Node], problems: Problems) -> dict[str, Template]:
    found = {name: problems.template(inner) for name, inner in parts.items()}
    return {name: template for name, template in found.items() if template is not None}


def _failsafe(part: Node | None, problems: Problems) -> Failsafe | None:
    if part is None:
        return None
    sets = {
        name: problems.template(inner) or None if isinstance(inner.data, str) else given(inner.data)
        for name, inner in part.named("set").items()
    }
    after_s = problems.duration(part, "after", 1.0, least=0.05, most=_LONGEST_S)
    return Failsafe(after_s, tuple(one.data for one in part.listed("without")), sets)


def _plan(part: Node) -> PlanSpec:
    return PlanSpec(
        walls=tuple(
            Wall(*_pair(one, "from"), *_pair(one, "to"), **_look(one))
            for one in part.listed("walls")
        ),
        boxes=tuple(
            Box(*_pair(one, "at"), *_pair(one, "size"), **_look(one))
            for one in part.listed("boxes")
        ),
        holes=tuple(Box(*_pair(one, "at"), *_pair(one, "size")) for one in part.listed("holes")),
        ground=part.text("ground", "floor"),  # type: ignore[arg-type]  # the schema's enum
    )


def _look(part: Node) -> dict[str, Any]:
    return {key: part.must(key).data for key in ("height", "colour") if key in part.data}


_TRIGGERS: Final = ("match", "command", "poll", "every")


class SimulatorSpec(NamedTuple):
    """The parsed emulated robot of a document, with unresolved names."""

    rules: Mapping[str, list[SimulatorRule]] = NOTHING
    """Rules, by transport."""
    world: WorldSpec | None = None


def parse_simulator(
    sources: Sources, driver: Driver, catalog: Registries, problems: Problems
) -> SimulatorSpec:
    """Return the rules of each transport and the world, with unresolved names."""
    found: dict[str, list[SimulatorRule]] = {}
    context = FormContext(catalog=catalog)
    if any(_needs_types(part.data) for part in sources.rules.values()):
        from urc.config.parse.struct.numbers import parse_enums
        from urc.config.parse.types import parse_types

        quiet = Problems()  # the driver already reported these problems
        enums = parse_enums(sources.driver, quiet)
        types = parse_types(sources.driver, enums, quiet)
        context = context._replace(types=types, enums=enums)
    for name, part in sources.rules.items():
        spec = driver.transports.get(name)
        if spec is not None:
            context = context._replace(encoding=spec.encoding, framing=spec.framing)
        found[name] = [_rule(inner, name, problems, context) for inner in part.items()]
        _check_names(part, found[name], problems)
    world = sources.simulator.get("world")
    if world is None:
        return SimulatorSpec(found)

    return SimulatorSpec(found, parse_world(world, problems))


def _check_names(part: Node, rules: list[SimulatorRule], problems: Problems) -> None:
    """Report two rules with the same name, because extending documents refer to rules by name."""
    seen: set[str] = set()
    for inner, rule in zip(part.items(), rules, strict=True):
        if rule.name and rule.name in seen:
            text = f"two rules of {rule.transport!r} have the name {rule.name!r}"
            problems.error(inner, "duplicate-name", text, at="name", hint="rename one of them")
        seen.add(rule.name)


def _needs_types(data: object) -> bool:
    """Return whether the data contains a ``struct`` form."""
    if isinstance(data, dict):
        return "struct" in data or any(map(_needs_types, data.values()))
    return isinstance(data, list) and any(map(_needs_types, data))


def _rule(part: Node, transport: str, problems: Problems, context: FormContext) -> SimulatorRule:
    triggers = [key for key in _TRIGGERS if key in part.data]
    if len(triggers) != 1:
        _not_one_trigger(part, triggers, problems)
    request = part.text("command") or part.text("poll")
    does = any(key in part.data for key in ("set", "send", "message", "close", "then"))
    if "every" in part.data and not does:
        problems.error(part, "missing-key", "a periodic rule needs 'send'", key=True)
    when, match = part.get("when"), part.get("match")
    first = _reaction(part, problems, context, answers=bool(request) and not _speaks(part))
    if "every" in part.data and first.after_s:
        text = "a periodic rule cannot have 'after'"
        problems.error(part, "misplaced-key", text, at="after", key=True)
    return SimulatorRule(
        transport=transport,
        name=part.text("name"),
        match=None if match is None else _match(match, problems, context),
        request=request,
        every_s=(
            problems.duration(part, "every", 1.0, least=0.005) if "every" in part.data else None
        ),
        when=None if when is None else problems.expression(when),
        reactions=(
            first,
            *(_reaction(inner, problems, context, waits=True) for inner in part.listed("then")),
        ),
    )


def _speaks(part: Node) -> bool:
    """Return whether a rule declares its own reply, immediate or delayed."""
    return any("send" in one.data or "answer" in one.data for one in (part, *part.listed("then")))


def _not_one_trigger(part: Node, triggers: list[str], problems: Problems) -> None:
    if not triggers:
        problems.error(
            part,
            "missing-key",
            "this rule lacks 'match' or 'every'",
            key=True,
            hint="a rule matches a frame (match, command, poll), or sends periodically (every)",
        )
        return
    both = f"'{triggers[0]}' and '{triggers[1]}'"
    problems.error(
        part,
        "misplaced-key",
        f"{both} cannot be used together: a rule has one trigger",
        at=triggers[1],
        key=True,
        hint="write two rules",
    )


def _match(part: Node, problems: Problems, context: FormContext) -> Pattern | ReadSpec | None:
    if isinstance(part.data, str):
        return problems.pattern(part)
    return parse_read(part, problems, context)


def _reaction(
    part: Node,
    problems: Problems,
    context: FormContext,
    *,
    answers: bool = False,
    waits: bool = False,
) -> Reaction:
    answer = part.text("answer")
    send, framing = part.get("send"), part.get("framing")
    until = part.get("until") if waits else None
    if framing is not None and send is None:
        text = "'framing' has no effect without 'send'"
        problems.error(part, "misplaced-key", text, at="framing", key=True)
    if framing is not None:
        context = context._replace(framing=None)
    return Reaction(
        after_s=problems.duration(part, "after", 0.0, least=0.0, most=MAX_STEP_S),
        sets=_sets(part.named("set"), problems),
        until=None if until is None else problems.expression(until),
        answers=answers if not answer else answer == "auto",
        refuses=answer == "refused",
        send=None if send is None else parse_write(send, problems, context),
        message=part.text("message"),
        framing=(
            parse_framing(framing, context.encoding, problems, context.catalog)
            if framing is not None and context.catalog is not None
            else None
        ),
        closes=part.flag("close", default=False),
    )


def _sets(parts: Mapping[str, Node], problems: Problems) -> dict[str, Template | Reading]:
    values: dict[str, Template | Reading] = {}
    for name, inner in parts.items():
        if isinstance(inner.data, str):
            template = problems.template(inner)
            if template is not None:
                values[name] = template
        else:
            values[name] = tuple(inner.data) if isinstance(inner.data, list) else inner.data
    return values

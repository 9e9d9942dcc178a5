"""The world of an emulated robot: its document → `WorldSpec`."""

import math
from collections.abc import Mapping
from typing import Any, Final, TypeVar

from urc.config.part import Findings, Part
from urc.config.suggest import did_you_mean
from urc.config.values import given
from urc.expressions import Template
from urc.model.values import Reading
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

__all__ = ["parse_world"]

_DEGREES: Final = {
    "body": ("steer", "amplitude", "roughness"),
    "laser": ("first", "last"),
    "camera": ("view", "tilt"),
}
"""Part → numbers that documents write in degrees."""
_KEYS: Final = {"first": "from", "last": "to"}
"""Fields of a laser → its keys."""
_LONGEST_S: Final = 3600.0

Spec = TypeVar("Spec", bound=Any)


def parse_world(part: Part, findings: Findings) -> WorldSpec:
    """Return the world that stands at `part`; its names are looked up later."""
    if "body" not in part.data:
        text = "'body' is missing from this world"
        hint = "write body: { type: differential }, or another kind"
        findings.error(part, "missing-key", text, key=True, hint=hint)
        return WorldSpec()
    body = _filled(BodySpec(), part, "body")
    _check_body(part.must("body"), body, findings)
    _check_inputs(part, body, findings)
    laser = _filled(LaserSpec(), part, "laser")
    battery = _filled(BatterySpec(), part, "battery")
    if laser.first >= laser.last:
        text = "the field of view ends before it begins"
        findings.error(part.must("laser"), "wrong-order", text, key=True)
    if battery.empty >= battery.full:
        text = f"empty at {battery.empty:g} V is not below full at {battery.full:g} V"
        findings.error(part.must("battery"), "wrong-order", text, key=True)
    plan, start, datum = part.get("plan"), part.get("start"), part.get("datum")
    return WorldSpec(
        body=body,
        drive={name: _value(one, findings) for name, one in part.named("drive").items()},  # type: ignore[misc]  # as the schema says
        senses=_templates(part.named("signals"), findings),
        failsafe=_failsafe(part.get("failsafe"), findings),
        plan=None if plan is None else _plan(plan),
        start=WorldSpec().start if start is None else _start(start),
        datum=WorldSpec().datum if datum is None else _datum(datum),
        seed=part.integer("seed") or 0 if "seed" in part.data else 1,
        odometry=_filled(OdometrySpec(), part, "odometry"),
        laser=laser,
        camera=_camera(part, findings),
        battery=battery,
    )


def _start(part: Part) -> tuple[float, float, float]:
    x, y = _pair(part, "at") if "at" in part.data else (0.0, 0.0)
    return x, y, math.radians(part.number("yaw") or 0.0)


def _datum(part: Part) -> tuple[float, float, float]:
    found = map(part.number, ("latitude", "longitude", "altitude"))
    latitude, longitude, altitude = (
        default if one is None else one
        for one, default in zip(found, WorldSpec().datum, strict=True)
    )
    return latitude, longitude, altitude


def _pair(part: Part, key: str) -> tuple[float, float]:
    x, y = part.must(key).data
    return x, y


def _filled(spec: Spec, part: Part, key: str) -> Spec:
    """Return `spec` with the plain values that the document gives; degrees become radians."""
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


def _camera(part: Part, findings: Findings) -> CameraSpec:
    spec, inner = _filled(CameraSpec(), part, "camera"), part.get("camera")
    found: dict[str, Any] = {}
    for key in ("flip", "mirror"):
        if inner is not None and isinstance(inner.data.get(key), str):
            found[key] = findings.template(inner.must(key)) or False
    return spec._replace(**found)


def _check_body(part: Part, body: BodySpec, findings: Findings) -> None:
    for key in part.data:
        kinds = BODY_KEYS.get(key)
        if kinds is not None and body.type not in kinds:
            text = f"'{key}' means nothing for {body.type}; it is for {' and '.join(kinds)}"
            findings.error(part, "misplaced-key", text, at=key, key=True)


def _check_inputs(part: Part, body: BodySpec, findings: Findings) -> None:
    known = INPUTS[body.type]
    for name, inner in part.named("drive").items():
        if name not in known:
            text = f"a body of type {body.type} has no input {name!r}"
            hint = did_you_mean(name, known, "inputs") or f"it has {', '.join(known)}"
            findings.error(inner, "unknown-input", text, key=True, hint=hint)


def _value(part: Part, findings: Findings) -> Template | Reading:
    if isinstance(part.data, str):
        return findings.template(part) or 0.0
    value = given(part.data)
    return float(value) if isinstance(value, bool) else value


def _templates(parts: Mapping[str, Part], findings: Findings) -> dict[str, Template]:
    found = {name: findings.template(inner) for name, inner in parts.items()}
    return {name: template for name, template in found.items() if template is not None}


def _failsafe(part: Part | None, findings: Findings) -> Failsafe | None:
    if part is None:
        return None
    sets = {
        name: findings.template(inner) or None if isinstance(inner.data, str) else given(inner.data)
        for name, inner in part.named("set").items()
    }
    after_s = findings.duration(part, "after", 1.0, least=0.05, most=_LONGEST_S)
    return Failsafe(after_s, tuple(one.data for one in part.listed("without")), sets)


def _plan(part: Part) -> PlanSpec:
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
        ground=part.text("ground", "floor"),  # type: ignore[arg-type]  # one of them
    )


def _look(part: Part) -> dict[str, Any]:
    return {key: part.must(key).data for key in ("height", "colour") if key in part.data}

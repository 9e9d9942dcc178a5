"""Parser for signals: mapping → `Signal`, with conversion, limits, axes and formula."""

from collections.abc import Mapping
from typing import Final

from urc.config.node import Node, Problems
from urc.config.parse.conversion import CONVERSION_KEYS, parse_conversion, parse_states
from urc.config.parse.frame import parse_frame, parse_frame_change
from urc.config.parse.limits import parse_limits
from urc.config.values import check_range
from urc.expressions import Template
from urc.model.driver import Poll
from urc.model.values import MAX_POINTS, Signal

__all__ = ["parse_signal", "with_ages"]

_NUMBERS: Final = ("integer", "number")
_ANGLE_UNITS: Final = ("rad", "deg", "°")
_ROTATIONS: Final = ("roll", "pitch", "yaw")
_SIZED: Final = ("array", "image", "blob", "point_cloud")
_FILMED: Final = ("image", "video")
_LATCHED_S: Final = 86400.0
"""Default age of an occupancy grid, in seconds: a robot may send its map only once."""


def parse_signal(part: Node, title: str, problems: Problems) -> Signal:
    """Return the signal at `part`; `title` is the default title."""
    kind = part.text("type", "number")
    element = part.text("items", "number") if kind == "array" else kind
    _check_vector(part, kind, problems)
    low, high = check_range(part, element, problems)
    if part.name == "pi":
        text, hint = "a signal cannot have the name 'pi'", "in expressions, 'pi' means the number"
        problems.error(part, "bad-name", text, key=True, hint=hint)
    precision = part.integer("precision")
    if precision is not None and element != "number":
        problems.error(
            part,
            "misplaced-key",
            f"'precision' has no effect for type {kind}",
            at="precision",
            key=True,
        )
    axes = _axes(part, kind, problems)
    states = parse_states(part, element, problems)
    frame = parse_frame(part, element, problems)
    return Signal(
        name=part.name,
        type=kind,  # type: ignore[arg-type]  # the schema's enum is this Literal
        title=part.text("title", title),
        unit=part.text("unit"),
        min=low,
        max=high,
        precision=precision,
        states=states,
        limits=parse_limits(part, element, (low, high), states, problems),
        stale_after_s=problems.duration(part, "stale_after", 0.0, least=0.05),
        description=part.text("description"),
        conversion=parse_conversion(part, problems, element),
        items=element if kind == "array" else "number",  # type: ignore[arg-type]  # as above
        size=part.integer("size"),
        axes=axes,  # type: ignore[arg-type]  # as above
        formula=_formula(part, problems),
        deadband=_deadband(part, element, (low, high), problems),
        debounce_s=_debounce_s(part, kind, problems),
        colour=part.text("colour"),
        frame=frame,
        transform=parse_frame_change(part, frame, kind, problems),
        has_capture_time=_has_capture_time(part, kind, problems),
        frozen_after_s=_frozen_after_s(part, kind, problems),
    )


def with_ages(signals: Mapping[str, Signal], polls: tuple[Poll, ...]) -> dict[str, Signal]:
    """Return the signals, each with the age in seconds at which it becomes stale.

    The default age is three periods of the signal's fastest poll, but at least 1 s. Without a poll,
    the default age is 5 s; for an occupancy grid, it is one day. The default age of a computed
    signal is the smallest age of its inputs.
    """
    aged = {name: _with_age(one, polls) for name, one in signals.items()}
    for name, one in signals.items():
        if one.formula is not None and not one.stale_after_s:
            ages = [aged[base].stale_after_s for base in sorted(_bases(name, signals))]
            aged[name] = one._replace(stale_after_s=min(ages, default=5.0))
    return aged


def _bases(name: str, signals: Mapping[str, Signal]) -> set[str]:
    """Return the received signals that a computed signal depends on; cycles are allowed."""
    found: set[str] = set()
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        one = signals.get(waiting.pop())
        if one is None or one.name in seen:
            continue
        seen.add(one.name)
        if one.formula is None:
            found.add(one.name)
        else:
            waiting += one.inputs
    return found


def _with_age(signal: Signal, polls: tuple[Poll, ...]) -> Signal:
    if signal.stale_after_s:
        return signal
    periods = [
        poll.every_s for poll in polls if poll.reply and signal.name in poll.reply.read.fields
    ]
    usual_s = _LATCHED_S if signal.type == "occupancy_grid" else 5.0
    return signal._replace(stale_after_s=max(1.0, 3 * min(periods)) if periods else usual_s)


def _check_vector(part: Node, kind: str, problems: Problems) -> None:
    wanted = (("items", ("array",)), ("size", _SIZED), ("colour", ("point_cloud",)))
    for key, kinds in wanted:
        if part.get(key) is not None and kind not in kinds:
            problems.error(
                part,
                "misplaced-key",
                f"'{key}' has no effect for type {kind}",
                at=key,
                key=True,
                hint=f"this key needs 'type: {kinds[0]}'",
            )
    if kind == "point_cloud" and (part.integer("size") or 0) > MAX_POINTS:
        problems.error(
            part,
            "out-of-range",
            f"a point cloud has at most {MAX_POINTS} points",
            at="size",
            hint="larger clouds are thinned on arrival; pages draw 20000 points smoothly",
        )


def _check_rotation(part: Node, kind: str, problems: Problems) -> None:
    """Warn about a received rotation signal without an axis convention."""
    is_named = not {*part.name.split("_")}.isdisjoint(_ROTATIONS)
    is_angle = kind in _NUMBERS and part.text("unit") in _ANGLE_UNITS
    if is_named and is_angle and "value" not in part.data:
        problems.warn(
            part,
            "no-axes",
            f"{part.name!r} has no axis convention",
            key=True,
            hint="write axes: FLU (x forward, y left, z up) or axes: FRD (z down); see the robot's"
            " manual",
        )


def _axes(part: Node, kind: str, problems: Problems) -> str:
    inner = part.get("axes")
    if inner is None:
        _check_rotation(part, kind, problems)
        return ""
    axes = str(inner.data)
    size = part.integer("size")
    if axes == "bearing":
        fits = kind in _NUMBERS and part.text("unit") in _ANGLE_UNITS
        wanted = f"a bearing must be a number in one of the units {', '.join(_ANGLE_UNITS)}"
    elif kind in _NUMBERS:
        fits = part.text("unit") != ""
        wanted = "a number with axes needs a unit"
    else:
        fits = kind == "object" or (kind == "array" and size in (2, 3, 4))
        wanted = "declare an object, or an array of size 2 or 3 (a vector) or 4 (a quaternion)"
    if not fits:
        problems.error(inner, "wrong-axes", f"axes {axes} do not fit this signal", hint=wanted)
    return axes


def _deadband(
    part: Node, element: str, bounds: tuple[float | None, float | None], problems: Problems
) -> float:
    band = part.number("deadband") or 0.0
    if not band:
        return 0.0
    low, high = bounds
    if element not in _NUMBERS:
        text = f"'deadband' has no effect for type {element}"
        problems.error(part, "misplaced-key", text, at="deadband", key=True)
    elif low is not None and high is not None and band > high - low:
        problems.error(
            part,
            "out-of-range",
            f"a change of {band:g} is impossible between {low:g} and {high:g}, so no change would"
            " count",
            at="deadband",
        )
    return band


def _debounce_s(part: Node, kind: str, problems: Problems) -> float:
    if kind not in (*_NUMBERS, "boolean", "string") and "debounce" in part.data:
        text = f"'debounce' has no effect for type {kind}"
        problems.error(part, "misplaced-key", text, at="debounce", key=True)
    return problems.duration(part, "debounce", 0.0, most=3600)


def _has_capture_time(part: Node, kind: str, problems: Problems) -> bool:
    if kind not in _FILMED and "capture_time" in part.data:
        problems.error(
            part,
            "misplaced-key",
            f"'capture_time' has no effect for type {kind}",
            at="capture_time",
            key=True,
            hint="this key needs 'type: image' or 'type: video'",
        )
    return part.flag("capture_time", default=True)


def _frozen_after_s(part: Node, kind: str, problems: Problems) -> float:
    if kind not in _FILMED and "frozen_after" in part.data:
        problems.error(
            part,
            "misplaced-key",
            f"'frozen_after' has no effect for type {kind}",
            at="frozen_after",
            key=True,
            hint="this key needs 'type: image' or 'type: video'",
        )
    return problems.duration(part, "frozen_after", 0.0, least=0.2, most=60)


def _formula(part: Node, problems: Problems) -> Template | None:
    inner = part.get("value")
    if inner is None:
        return None
    for key in CONVERSION_KEYS:
        if key in part.data:
            problems.error(
                part,
                "misplaced-key",
                f"'{key}' has no effect for a computed signal",
                at=key,
                key=True,
                hint="put the conversion into the formula under 'value'",
            )
    return problems.expression(inner)

"""Text of a frame → typed samples, with the limit each value has passed.

Floor 3, pure. Converters are made once per signal, when an engine is built; a value that is not of
the declared type or range is a fault to be counted, never a reading: a wrong number on the screen
is worse than an old one.
"""

import math
from collections.abc import Callable, Mapping

from urc.model.values import Alarm, Limits, Sample, Signal, Value

__all__ = ["BadValue", "Decode", "alarm_of", "build_converter", "build_decode"]

Convert = Callable[[object], Value]
Decode = Callable[[Mapping[str, object], float], tuple[list[Sample], list[str]]]
"""Fields of a frame and the time → the samples, and a line for each value that was refused."""

_TRUE = frozenset(("1", "true", "on", "yes"))
_FALSE = frozenset(("0", "false", "off", "no"))


class BadValue(ValueError):
    """Text that is no value of the signal; the message says what was found and expected."""


def build_converter(signal: Signal) -> Convert:
    """Return the function from a raw field to a value of `signal`."""
    if signal.states:
        return _states_converter(dict(signal.states))
    if signal.type == "string":
        return _to_string
    if signal.type == "boolean":
        return _to_boolean
    return _number_converter(signal)


def build_decode(signals: Mapping[str, Signal], fields: tuple[str, ...]) -> Decode:
    """Return the function that turns the fields of a frame into samples.

    Fields whose name starts with ``_`` are the document's own and become no samples. The function
    owns the alarm state of its signals, so hysteresis works from one reading to the next.
    """
    set_here = [signals[name] for name in fields if not name.startswith("_")]
    converters = {signal.name: build_converter(signal) for signal in set_here}
    limited = {one.name: one.limits for one in set_here if one.limits != Limits()}
    alarms: dict[str, Alarm] = {}

    def decode(found: Mapping[str, object], now: float) -> tuple[list[Sample], list[str]]:
        samples: list[Sample] = []
        refused: list[str] = []
        for name, raw in found.items():
            convert = converters.get(name)
            if convert is None:
                continue
            try:
                value = convert(raw)
            except BadValue as error:
                refused.append(f"{name}: {error}")
                continue
            alarm: Alarm = ""
            if name in limited:
                alarm = alarms[name] = alarm_of(limited[name], value, alarms.get(name, ""))
            samples.append(Sample(name, value, now, alarm))
        return samples, refused

    return decode


def alarm_of(limits: Limits, value: Value, before: Alarm) -> Alarm:
    """Return which limit `value` has passed; an alarm ends only `hysteresis` inside its limit."""
    if isinstance(value, str) or value is None:
        return ""
    back = limits.hysteresis
    levels: tuple[tuple[Alarm, float | None, bool], ...] = (
        ("lolo", limits.lolo, True),
        ("hihi", limits.hihi, False),
        ("low", limits.low, True),
        ("high", limits.high, False),
    )
    for name, limit, is_lower in levels:
        if limit is None:
            continue
        # Past "lolo" one is past "low" as well, so coming back from it keeps "low" alive too.
        holds = back if before and (before == name or _is_deeper(before, name)) else 0.0
        if value < limit + holds if is_lower else value > limit - holds:
            return name
    return ""


def _is_deeper(before: Alarm, name: Alarm) -> bool:
    return (before, name) in (("lolo", "low"), ("hihi", "high"))


def _states_converter(states: Mapping[str, str]) -> Convert:
    known = ", ".join(sorted(states))

    def convert(raw: object) -> Value:
        if raw is None:
            return None
        word = states.get(_spelt(raw))
        if word is None:
            raise BadValue(f"{_short(raw)} is none of the states {known}")
        return word

    return convert


def _to_string(raw: object) -> Value:
    if raw is None or isinstance(raw, str):
        return raw
    if isinstance(raw, (bool, int, float)):
        return _spelt(raw)
    raise BadValue(f"{_short(raw)} is no text")


def _to_boolean(raw: object) -> Value:
    if raw is None or isinstance(raw, bool):
        return raw
    word = _spelt(raw).strip().lower()
    if word in _TRUE:
        return True
    if word in _FALSE:
        return False
    raise BadValue(f"{_short(raw)} is neither true nor false")


def _number_converter(signal: Signal) -> Convert:
    is_integer = signal.type == "integer"
    least = -math.inf if signal.min is None else signal.min
    most = math.inf if signal.max is None else signal.max

    def convert(raw: object) -> Value:
        if raw is None:
            return None
        value = _integer_of(raw) if is_integer else _number_of(raw)
        if value != value:
            return None
        if least <= value <= most and value not in (math.inf, -math.inf):
            return value
        low = f" below its minimum {signal.min}" if value < least else ""
        raise BadValue(f"{_short(raw)} is{low or f' above its maximum {signal.max}'}")

    return convert


def _integer_of(raw: object) -> int:
    if isinstance(raw, int) and not isinstance(raw, bool):
        return raw
    if isinstance(raw, float) and raw.is_integer():
        return int(raw)
    if isinstance(raw, str) and _is_plain(raw):
        try:
            return int(raw)
        except ValueError:
            pass
    raise BadValue(f"{_short(raw)} is not a whole number")


def _number_of(raw: object) -> float:
    if isinstance(raw, (int, float)) and not isinstance(raw, bool):
        return raw
    if isinstance(raw, str) and _is_plain(raw):
        try:
            return float(raw)
        except ValueError:
            pass
    raise BadValue(f"{_short(raw)} is not a number")


def _is_plain(text: str) -> bool:
    """Python's int and float take '1_0' and other scripts' digits, which no robot means."""
    return text.isascii() and "_" not in text and len(text) <= 400


def _spelt(raw: object) -> str:
    """Return a raw value as it is written in documents: ``true``, ``3``, ``2.5``."""
    if isinstance(raw, bool):
        return "true" if raw else "false"
    if isinstance(raw, float) and raw.is_integer():
        return str(int(raw))
    return str(raw)


def _short(raw: object) -> str:
    text = repr(raw)
    return text if len(text) <= 40 else text[:37] + "..."

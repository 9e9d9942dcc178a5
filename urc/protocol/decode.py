"""Text of a frame → typed samples, with the limit each value has passed.

Floor 3, pure. Converters are made once per signal, when an engine is built; a value that is not of
the declared type or range is a fault to be counted, never a reading: a wrong number on the screen
is worse than an old one.
"""

import math
from collections.abc import Callable, Mapping

from urc.model.values import Alarm, Limits, Sample, Signal, Value

__all__ = ["BadValue", "Decode", "alarm_of", "build_converter", "build_decode"]

Convert = Callable[[str], Value]
Decode = Callable[[Mapping[str, str | None], float], tuple[list[Sample], list[str]]]
"""Groups of a match and the time → the samples, and a line for each value that was refused."""

_TRUE = frozenset(("1", "true", "on", "yes"))
_FALSE = frozenset(("0", "false", "off", "no"))


class BadValue(ValueError):
    """Text that is no value of the signal; the message says what was found and expected."""


def build_converter(signal: Signal) -> Convert:
    """Return the function from a frame's text to a value of `signal`."""
    if signal.states:
        return _states_converter(dict(signal.states))
    if signal.type == "string":
        return lambda text: text
    if signal.type == "boolean":
        return _to_boolean
    return _number_converter(signal)


def build_decode(signals: Mapping[str, Signal], groups: tuple[str, ...]) -> Decode:
    """Return the function that turns the named groups of a match into samples.

    It owns the alarm state of its signals, so hysteresis works from one reading to the next.
    """
    converters = {name: build_converter(signals[name]) for name in groups}
    limited = {name: signals[name].limits for name in groups if signals[name].limits != Limits()}
    alarms: dict[str, Alarm] = {}

    def decode(found: Mapping[str, str | None], now: float) -> tuple[list[Sample], list[str]]:
        samples: list[Sample] = []
        refused: list[str] = []
        for name, text in found.items():
            if text is None:
                continue
            try:
                value = converters[name](text)
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

    def convert(text: str) -> Value:
        word = states.get(text)
        if word is None:
            raise BadValue(f"{text!r} is none of the states {known}")
        return word

    return convert


def _to_boolean(text: str) -> Value:
    word = text.strip().lower()
    if word in _TRUE:
        return True
    if word in _FALSE:
        return False
    raise BadValue(f"{text!r} is neither true nor false")


def _number_converter(signal: Signal) -> Convert:
    is_integer = signal.type == "integer"
    least = -math.inf if signal.min is None else signal.min
    most = math.inf if signal.max is None else signal.max
    kind = "a whole number" if is_integer else "a number"

    def convert(text: str) -> Value:
        try:
            # Python's int and float take '1_0' and other scripts' digits, which no robot means.
            if "_" in text or not text.isascii() or len(text) > 400:
                raise ValueError
            value = int(text) if is_integer else float(text)
        except ValueError:
            raise BadValue(f"{text[:40]!r} is not {kind}") from None
        if value != value:
            return None
        if least <= value <= most and value not in (math.inf, -math.inf):
            return value
        low = f" below its minimum {signal.min}" if value < least else ""
        raise BadValue(f"{text[:40]!r} is{low or f' above its maximum {signal.max}'}")

    return convert

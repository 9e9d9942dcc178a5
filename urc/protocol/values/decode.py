"""Decoding of raw fields into typed values.

Pure. Each engine builds the converters once per signal. A value of the wrong type or outside its
range counts as a violation and never becomes a sample. For an operator, a wrong number on the
screen is worse than an old one.
"""

import math
from collections.abc import Callable, Mapping
from typing import cast

from urc.expressions import quoted
from urc.model.values import ElementType, Reading, Signal, Value
from urc.protocol.values.convert import (
    BadValue,
    Unusable,
    build_conversion,
    build_inverse,
    number_of,
    spelt,
    whole_of,
)
from urc.protocol.values.occupancy_grid import GridConverter, grid_message
from urc.protocol.values.point_cloud import cloud_converter, cloud_message
from urc.protocol.values.transform_tree import tree_message
from urc.protocol.values.vectors import (
    Elements,
    array_converter,
    bytes_converter,
    object_converter,
)
from urc.protocol.values.video_message import VideoConverter

__all__ = ["BadValue", "Convert", "build_converter", "build_raw"]

Convert = Callable[[object], Reading]

_TRUE = frozenset(("1", "true", "on", "yes"))
_FALSE = frozenset(("0", "false", "off", "no"))
_BOTH = frozenset(("true", "false"))
_NUMBER_OR_NONE = frozenset((float, type(None)))


def build_converter(signal: Signal) -> Convert:
    """Return a function that converts a raw field to a value of `signal`, or raises `BadValue`."""
    if signal.type in ("object", "transform_tree"):
        return _usable(object_converter)
    if signal.type == "occupancy_grid":
        return GridConverter()
    if signal.type == "point_cloud":
        return cloud_converter(signal)
    if signal.type == "video":
        return VideoConverter()
    if signal.type in ("image", "blob"):
        return _usable(bytes_converter(signal))
    element = _element_converter(signal)
    if signal.type == "array":
        return _usable(array_converter(signal, element, _numbers_check(signal)))
    return _usable(element)


def build_raw(signal: Signal) -> Callable[[object], object]:
    """Return a function that converts a value of `signal` to a raw field, for the emulated robot.

    The returned function raises `BadValue` if a value has no corresponding raw field.
    """
    if signal.type == "occupancy_grid":
        return lambda value: grid_message(value) if isinstance(value, bytes) else value
    if signal.type == "point_cloud":
        return lambda value: cloud_message(value) if isinstance(value, bytes) else value
    if signal.type == "transform_tree":
        return tree_message
    conversion = signal.conversion._replace(states=signal.states or signal.conversion.states)
    back = build_inverse(conversion)
    if back is None:
        return lambda value: value
    if signal.type == "boolean" and signal.states:
        return lambda value: back(value if value is None else spelt(value))
    if signal.type != "array":
        return back
    return lambda value: [back(item) for item in value] if isinstance(value, tuple) else value


def _usable(convert: Callable[[object], Reading]) -> Convert:
    def checked(raw: object) -> Reading:
        if isinstance(raw, Unusable):
            raise BadValue(raw.why)
        return convert(raw)

    return checked


def _element_converter(signal: Signal) -> Callable[[object], Value]:
    """Return the function that converts a single value, or one element of an array."""
    kind = signal.items if signal.type == "array" else signal.type
    conversion = build_conversion(signal.conversion)
    typed = _typed_converter(signal, kind, rounds=bool(conversion))
    if conversion is None:
        return typed
    return lambda raw: typed(conversion(raw))


def _typed_converter(
    signal: Signal, kind: ElementType | str, *, rounds: bool
) -> Callable[[object], Value]:
    if signal.states:
        states = dict(signal.states)
        word_of = _states_converter(states, is_number=kind in ("integer", "number"))
        if kind == "boolean" and _BOTH.issuperset(states.values()):
            return lambda raw: _to_boolean(word_of(raw))  # the robot's words for true and false
        return word_of
    if kind == "string":
        return _to_string
    if kind == "boolean":
        return _to_boolean
    return _number_converter(signal, is_integer=kind == "integer", rounds=rounds)


def _states_converter(states: Mapping[str, str], *, is_number: bool) -> Callable[[object], Value]:
    known = ", ".join(sorted(states))

    def convert(raw: object) -> Value:
        if raw is None:
            return None
        word = states.get(spelt(raw))
        if word is None and is_number and isinstance(raw, str):
            word = states.get(_as_number(raw))
        if word is None:
            raise BadValue(f"{quoted(raw)} is not one of the states {known}")
        return word

    return convert


def _as_number(text: str) -> str:
    """Return a number without leading zeros (``3`` for ``03``), because robots may pad numbers."""
    try:
        return spelt(number_of(text))
    except BadValue:
        return text


def _to_string(raw: object) -> Value:
    if raw is None or isinstance(raw, str):
        return raw
    if isinstance(raw, (bool, int, float)):
        return spelt(raw)
    raise BadValue(f"{quoted(raw)} is not text")


def _to_boolean(raw: object) -> Value:
    if raw is None or isinstance(raw, bool):
        return raw
    word = spelt(raw).strip().lower()
    if word in _TRUE:
        return True
    if word in _FALSE:
        return False
    raise BadValue(f"{quoted(raw)} is neither true nor false")


def _number_converter(
    signal: Signal, *, is_integer: bool, rounds: bool
) -> Callable[[object], Value]:
    least = -math.inf if signal.min is None else signal.min
    most = math.inf if signal.max is None else signal.max

    def convert(raw: object) -> Value:
        if raw is None:
            return None
        value = number_of(raw) if rounds or not is_integer else whole_of(raw)
        if value != value:
            return None
        if rounds and is_integer and abs(value) < math.inf:
            value = round(value)
        if least <= value <= most and abs(value) != math.inf:
            return value
        raise BadValue(f"{quoted(raw)} is {_outside(signal, value)}")

    return convert


def _numbers_check(signal: Signal) -> Callable[[Elements], bool]:
    """Return a function that checks whether all elements of an array are valid numbers or None.

    The function also returns False for some valid arrays. The rays of a laser scan are checked
    together, because a check of each ray takes thirty times as long.
    """
    if signal.items != "number" or signal.states or build_conversion(signal.conversion) is not None:
        return lambda items: False
    least, most = signal.min, signal.max

    def are_numbers(items: Elements) -> bool:
        if not _NUMBER_OR_NONE.issuperset(map(type, items)):
            return False
        numbers = [one for one in cast("list[float | None]", items) if one is not None]
        total = sum(numbers)
        if total - total != 0:  # one of them is not finite
            return False
        is_low = bool(numbers) and least is not None and min(numbers) < least
        return not (is_low or (numbers and most is not None and max(numbers) > most))

    return are_numbers


def _outside(signal: Signal, value: float) -> str:
    if abs(value) == math.inf:
        return "not finite"
    if signal.min is not None and value < signal.min:
        return f"below its minimum {signal.min}"
    return f"above its maximum {signal.max}"

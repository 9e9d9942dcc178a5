"""Signals: the named, typed values of a robot, and one reading of one of them.

The model's values are named tuples: as frozen and as typed as frozen dataclasses, a tenth of their
cost to define (every command pays it) and a third to make (every sample does).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

from urc.expressions import Template

__all__ = [
    "PLAIN",
    "Alarm",
    "Axes",
    "Conversion",
    "ElementType",
    "Limits",
    "NOTHING",
    "Reading",
    "Sample",
    "Signal",
    "SignalType",
    "Value",
]

NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})
"""The default of every mapping."""

ElementType = Literal["integer", "number", "boolean", "string"]
"""The words are JSON Schema's."""
SignalType = Literal["integer", "number", "boolean", "string", "array", "object", "image", "blob"]
"""What a signal may be: one value, several of one kind, a mapping, or bytes."""
Value = bool | int | float | str | None
"""One plain value; None means the robot said "not available"."""
Reading = Value | bytes | tuple[Any, ...] | Mapping[str, Any]
"""What a signal may hold: bytes for ``image`` and ``blob``, a tuple for ``array``."""
Axes = Literal["", "FLU", "FRD", "ENU", "NED", "bearing"]
"""Which way the axes point; "" says nothing of it."""
Alarm = Literal["", "lolo", "low", "high", "hihi"]
"""Which limit a value has passed; "" is normal."""


class Limits(NamedTuple):
    """Alarm limits in the signal's unit; EPICS' names."""

    lolo: float | None = None
    low: float | None = None
    high: float | None = None
    hihi: float | None = None
    hysteresis: float = 0.0
    """How far a value must come back before the alarm ends, in the signal's unit."""
    for_s: float = 0.0
    """How long a value must stay past a limit before the alarm begins, in seconds."""


class Conversion(NamedTuple):
    """From a raw field to the value that is meant; applied in the order of the attributes."""

    base: int = 0
    """Of whole numbers that are written as text: 2 to 36. 0: text stays what it is."""
    not_available: tuple[Value, ...] = ()
    """Raw values that say "not available"."""
    polynomial: tuple[float, ...] = ()
    """Coefficients c0, c1, c2 …: value = c0 + c1·raw + c2·raw² …; () leaves the value alone."""
    points: tuple[tuple[float, float], ...] = ()
    """(raw, value) pairs, raw rising; linear between them, clamped outside."""
    states: tuple[tuple[str, str], ...] = ()
    """Raw text → word."""


PLAIN = Conversion()
"""Takes the raw value as it is."""


class Signal(NamedTuple):
    """A declared value of a robot."""

    name: str
    type: SignalType = "number"
    title: str = ""
    unit: str = ""
    """UCUM-like symbol as in documents: ``%``, ``m/s``, ``rad``, ``degC``."""
    min: float | None = None
    """Smallest value the robot can mean; what is below is a fault, not a reading."""
    max: float | None = None
    precision: int | None = None
    """Digits after the decimal point that mean something."""
    states: tuple[tuple[str, str], ...] = ()
    """Raw text → word shown, for signals that are states."""
    limits: Limits = Limits()
    stale_after_s: float = 0.0
    """Age in seconds after which a reading is shown as old. Always > 0 in a loaded driver."""
    description: str = ""
    conversion: Conversion = PLAIN
    """From what the robot says to the value in `unit`; of an array, each element's."""
    of: ElementType = "number"
    """Kind of the elements of an array."""
    size: int | None = None
    """Elements of an array; most bytes of an image or blob."""
    axes: Axes = ""
    """Which way its axes point."""
    formula: Template | None = None
    """What it is computed from, over other signals; None: frames set it."""
    deadband: float = 0.0
    """A change smaller than this is no news, in `unit`; of an array, when every element's is."""
    debounce_s: float = 0.0
    """A value that lasts shorter than this is no news, in seconds."""


class Sample(NamedTuple):
    """One reading: the value, when its first byte arrived, and the limit it has passed."""

    signal: str
    value: Reading
    time_s: float
    """Monotonic seconds, on the clock that was passed into the engine."""
    alarm: Alarm = ""

"""Signals: the named, typed values of a robot, and their samples.

The values of the model are named tuples. Named tuples are as immutable and typed as frozen
dataclasses. The definition of a named tuple takes a tenth of the time, which every start of the
command line saves. The construction takes a third, which every sample saves.
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
    "AlarmLimits",
    "NOTHING",
    "Reading",
    "Sample",
    "Signal",
    "SignalType",
    "Value",
]

NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})
"""An empty mapping, the default of every mapping attribute."""

ElementType = Literal["integer", "number", "boolean", "string"]
"""Element types, in the words of JSON Schema."""
SignalType = Literal["integer", "number", "boolean", "string", "array", "object", "image", "blob"]
"""Types of a signal: one value, several values of one type, a mapping, or bytes."""
Value = bool | int | float | str | None
"""One plain value; None means that the robot reports "not available"."""
Reading = Value | bytes | tuple[Any, ...] | Mapping[str, Any]
"""A value of a signal: bytes for ``image`` and ``blob``, a tuple for ``array``."""
Axes = Literal["", "FLU", "FRD", "ENU", "NED", "bearing"]
"""Axis conventions; "" if undeclared."""
Alarm = Literal["", "lolo", "low", "high", "hihi"]
"""The limit that a value has passed; "" for normal."""


class AlarmLimits(NamedTuple):
    """Alarm limits in the unit of the signal, with the names of EPICS."""

    lolo: float | None = None
    low: float | None = None
    high: float | None = None
    hihi: float | None = None
    hysteresis: float = 0.0
    """Hysteresis of the alarm, in the unit of the signal."""
    for_s: float = 0.0
    """Time past a limit before the alarm begins, in seconds."""


class Conversion(NamedTuple):
    """The conversion of a raw field to a value; the attributes apply in their order."""

    base: int = 0
    """Base of whole numbers in text, 2 to 36; 0: text stays text."""
    not_available: tuple[Value, ...] = ()
    """Raw values that mean "not available"."""
    polynomial: tuple[float, ...] = ()
    """Coefficients c0, c1, c2 …: value = c0 + c1·raw + c2·raw² …; () for no polynomial."""
    points: tuple[tuple[float, float], ...] = ()
    """(raw, value) pairs with rising raw values; linear between them, clamped outside."""
    states: tuple[tuple[str, str], ...] = ()
    """Raw text → word."""


PLAIN = Conversion()
"""The identity conversion."""


class Signal(NamedTuple):
    """A declared value of a robot."""

    name: str
    type: SignalType = "number"
    title: str = ""
    unit: str = ""
    """UCUM-like symbol as in documents: ``%``, ``m/s``, ``rad``, ``degC``."""
    min: float | None = None
    """Smallest valid value; a smaller one is a violation and no sample."""
    max: float | None = None
    precision: int | None = None
    """Number of significant digits after the decimal point."""
    states: tuple[tuple[str, str], ...] = ()
    """Raw text → displayed word, for enumerated signals."""
    limits: AlarmLimits = AlarmLimits()
    stale_after_s: float = 0.0
    """Age in seconds after which a sample is stale. Always > 0 in a loaded driver."""
    description: str = ""
    conversion: Conversion = PLAIN
    """Conversion from the raw value to `unit`; for an array, of each element."""
    items: ElementType = "number"
    """Type of the elements of an array."""
    size: int | None = None
    """Number of elements of an array; most bytes of an image or blob."""
    axes: Axes = ""
    """Axis convention of the value."""
    formula: Template | None = None
    """Formula over other signals; None: frames set the signal."""
    deadband: float = 0.0
    """Dead band in `unit`: smaller changes are not reported. An array is reported if any element
    changes enough."""
    debounce_s: float = 0.0
    """Debounce time, in seconds: shorter-lived values are not reported."""


class Sample(NamedTuple):
    """One reading: the value, the arrival time of its first byte, and the passed limit."""

    signal: str
    value: Reading
    time_s: float
    """Monotonic time in seconds, from the clock of the engine."""
    alarm: Alarm = ""

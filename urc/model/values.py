"""Signals (named, typed values of a robot) and their samples.

All values in `urc.model` are named tuples. Named tuples are immutable and typed, like frozen
dataclasses. Python defines a named tuple class in a tenth of the time of a dataclass, and
constructs an instance in a third. The definition time affects every start of the command line; the
construction time affects every sample.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

from urc.expressions import Template

__all__ = [
    "BINARY_TYPES",
    "MAX_POINTS",
    "PICTURE_TYPES",
    "PLAIN",
    "Alarm",
    "AlarmAttributes",
    "AlarmLimits",
    "AlarmPriority",
    "Axes",
    "Conversion",
    "ElementType",
    "FrameChange",
    "NOTHING",
    "Reading",
    "Sample",
    "Signal",
    "SignalType",
    "Value",
    "WHOLE_TYPES",
    "state_texts",
]

NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})
"""Immutable empty mapping, the default for every mapping attribute."""

ElementType = Literal["integer", "number", "boolean", "string"]
"""Element types of an array, named as in JSON Schema."""
SignalType = Literal[
    "integer",
    "number",
    "boolean",
    "string",
    "array",
    "object",
    "image",
    "blob",
    "occupancy_grid",
    "point_cloud",
    "transform_tree",
    "video",
]
"""Signal types: a single value, an array of one type, a mapping, or bytes. The value of a transform
tree is a mapping."""
BINARY_TYPES: Final[tuple[SignalType, ...]] = (
    *("image", "blob", "occupancy_grid", "point_cloud", "video"),
)
"""Types of signals whose values are bytes, which pages receive as binary messages."""
WHOLE_TYPES: Final[tuple[SignalType, ...]] = ("occupancy_grid", "point_cloud", "transform_tree")
"""Types of signals that are whole messages, which only the form ``json`` can read."""
PICTURE_TYPES: Final[tuple[SignalType, ...]] = ("image", "occupancy_grid")
"""Types of signals whose values are image files; an occupancy grid is a PNG image."""
MAX_POINTS: Final = 100_000
"""Maximum number of points that a point cloud can keep. Converting this many points takes up to
100 ms."""
Value = bool | int | float | str | None
"""A plain value; None means that the robot reports "not available"."""
Reading = Value | bytes | tuple[Any, ...] | Mapping[str, Any]
"""Value of a signal: bytes for `BINARY_TYPES`, a tuple for ``array``."""
Axes = Literal["", "FLU", "FRD", "ENU", "NED", "bearing"]
"""Axis convention of a value; "" means that the driver declares none."""
Alarm = Literal["", "lolo", "low", "high", "hihi", "minor", "major"]
"""Alarm limit that a value has crossed, or severity of an alarm state, both named as in EPICS; ""
means no alarm."""
AlarmPriority = Literal["low", "medium", "high"]
"""Priority of an alarm, as in ISA-18.2."""


class AlarmAttributes(NamedTuple):
    """Attributes of one alarm for operators, named as in ISA-18.2."""

    priority: AlarmPriority = "medium"
    cause: str = ""
    """Usual cause of the alarm."""
    action: str = ""
    """Operator action."""
    command: str = ""
    """Command that carries out the action; "" means none."""
    suppressed_when: Template | None = None
    """Expression using signals; while the expression is true, the alarm is suppressed by design."""


class AlarmLimits(NamedTuple):
    """Alarm limits in the unit of the signal, named as in EPICS, and alarm states."""

    lolo: float | None = None
    low: float | None = None
    high: float | None = None
    hihi: float | None = None
    hysteresis: float = 0.0
    """Hysteresis of the alarm, in the unit of the signal."""
    for_s: float = 0.0
    """On-delay: minimum time beyond a limit before the alarm begins, in seconds."""
    off_delay_s: float = 0.0
    """Off-delay: minimum time for which the value must be normal before the alarm ends, in
    seconds."""
    states: tuple[str, ...] = ()
    """Values that cause an alarm, as text; a boolean is ``true`` or ``false``."""
    attributes: tuple[tuple[str, AlarmAttributes], ...] = ()
    """Pairs of a limit or alarm state and the attributes of its alarm."""

    @property
    def is_empty(self) -> bool:
        """Whether no value can cause an alarm."""
        limits = (self.lolo, self.low, self.high, self.hihi)
        return not self.states and all(limit is None for limit in limits)

    @property
    def is_timed(self) -> bool:
        """Whether an alarm can begin or end after a delay, without a new value."""
        return self.for_s > 0 or self.off_delay_s > 0

    def attributes_of(self, condition: str) -> AlarmAttributes:
        """Return the attributes of a limit or alarm state, or default attributes."""
        usual = AlarmAttributes("high" if condition in ("lolo", "hihi") else "medium")
        return next((one for name, one in self.attributes if name == condition), usual)


def state_texts(value: Reading) -> tuple[str, ...]:
    """Return a value, or each element of an array, as text to compare with alarm states."""
    if isinstance(value, bool):
        return ("true" if value else "false",)
    if isinstance(value, str):
        return (value,)
    if isinstance(value, int):
        return (str(value),)
    if isinstance(value, tuple):
        return tuple(text for one in value for text in state_texts(one))
    return ()


class Conversion(NamedTuple):
    """The conversion of a raw field to a value. The steps run in the order of the attributes."""

    base: int = 0
    """Base of whole numbers in text, 2 to 36; 0 means that text is not converted."""
    not_available: tuple[Value, ...] = ()
    """Raw values that mean "not available"."""
    polynomial: tuple[float, ...] = ()
    """Coefficients c0, c1, c2 … of the polynomial c0 + c1·raw + c2·raw² …; () means no
    polynomial."""
    points: tuple[tuple[float, float], ...] = ()
    """Interpolation table of (raw, value) pairs with increasing raw values, linear between points
    and clamped outside the table."""
    states: tuple[tuple[str, str], ...] = ()
    """Pairs of raw text and the corresponding word."""


PLAIN = Conversion()
"""The identity conversion."""


class FrameChange(NamedTuple):
    """The change of a computed value to another coordinate frame."""

    shape: Literal["pose", "points"]
    """Shape of the value: a pose, or points as x and y in turn."""
    source: Template
    """Name of the coordinate frame of the formula's result."""
    tree: str
    """Name of the signal with the transform tree."""


class Signal(NamedTuple):
    """A named, typed value of a robot, as declared in the driver."""

    name: str
    type: SignalType = "number"
    title: str = ""
    unit: str = ""
    """Unit symbol, similar to UCUM: ``%``, ``m/s``, ``rad``, ``degC``."""
    min: float | None = None
    """Minimum valid value; URC discards a smaller value and counts it as a fault."""
    max: float | None = None
    precision: int | None = None
    """Number of digits after the decimal point."""
    states: tuple[tuple[str, str], ...] = ()
    """Pairs of raw text and its displayed word, for enumerated signals."""
    limits: AlarmLimits = AlarmLimits()
    stale_after_s: float = 0.0
    """Age in seconds after which a sample is stale; greater than 0 in a loaded driver."""
    description: str = ""
    conversion: Conversion = PLAIN
    """Conversion from the raw value to `unit`, applied to each element of an array."""
    items: ElementType = "number"
    """Type of an array's elements."""
    size: int | None = None
    """Number of elements in an array, maximum size of an image or blob in bytes, or maximum number
    of points in a point cloud."""
    axes: Axes = ""
    """Axis convention of the value."""
    formula: Template | None = None
    """Formula using other signals; None means that frames set the signal."""
    deadband: float = 0.0
    """Dead band in `unit`: smaller changes are not reported. An array is reported when any element
    changes by at least the dead band."""
    debounce_s: float = 0.0
    """Debounce time in seconds: a new value is reported only after it has been stable for this
    time."""
    colour: str = ""
    """Name of the field that gives the points of a point cloud their colour; "" means the usual
    field."""
    frame: Template | None = None
    """Name of the coordinate frame to which the value refers, from settings and text signals; None
    means that the driver declares none."""
    transform: FrameChange | None = None
    """Change of the formula's result to `frame`; None means no change."""
    has_capture_time: bool = True
    """Whether the time of capture in an image's message can make the image older."""
    frozen_after_s: float = 0.0
    """Time in seconds after which equal images count as one old image; 0 means never. Images are
    equal if their bytes are, and images of a video if their decoded images are."""

    @property
    def inputs(self) -> frozenset[str]:
        """Names that a computed value depends on: signals, and others such as ``settings``."""
        if self.formula is None:
            return frozenset()
        if self.transform is None or self.frame is None:
            return self.formula.names
        frames = self.frame.names | self.transform.source.names
        return self.formula.names | frames | {self.transform.tree}


class Sample(NamedTuple):
    """One reading of a signal: value, arrival time of the first byte, and alarm."""

    signal: str
    value: Reading
    time_s: float
    """Arrival time in seconds, from the engine's monotonic clock."""
    alarm: Alarm = ""

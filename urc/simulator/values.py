"""The state of an emulated robot: signal values and internal variables.

Pure. All connections of one robot share the same state.
"""

import math
from binascii import a2b_base64
from collections.abc import Iterator, Mapping
from typing import Final
from zlib import crc32

from urc.expressions import ExpressionError, Template
from urc.model.driver import Driver
from urc.model.values import NOTHING, AlarmLimits, ElementType, Reading, Signal, SignalType, Value
from urc.model.world import WorldSpec
from urc.problems import UrcError
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_converter
from urc.protocol.values.occupancy_grid import Grid, encode_grid
from urc.protocol.values.point_cloud import encode_cloud, packed_cloud
from urc.simulator.faults import Faults
from urc.simulator.simulated_body import SimulatedBody, has_rendering, rendered_signals
from urc.simulator.world.world import PLAIN
from urc.video import VideoUnit, encode_unit

__all__ = ["Names", "Unsettable", "Values"]


_PERIOD_S: Final = 60.0
"""Period of the slow wave in plausible signal values, in seconds."""
_WIDTH: Final = (0.0, 100.0)
"""Range of a number whose signal declares no range."""
_ELEMENTS: Final = 4
_PIXEL: Final = a2b_base64(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)
"""A PNG image of one grey pixel."""
_ROOM: Final = encode_grid(
    Grid(4, 4, 1.0, -2.0, -2.0, 0.0, "map", bytes(5) + bytes((100, 255)) + bytes(9))
)
"""An occupancy grid of 4 by 4 m with one occupied and one unknown cell."""
_TREE: Final = {
    "frames": (
        {"name": "map", "parent": "", "depth": 0},
        {
            "name": "odom",
            "parent": "map",
            "depth": 1,
            "translation": (0.0, 0.0, 0.0),
            "rotation": (0.0, 0.0, 0.0, 1.0),
            "age": 0.0,
        },
    )
}
"""A transform tree with one transform."""


_POINTS: Final = encode_cloud(packed_cloud("", "", 2, {"x": [1.0, 1.0], "y": [0.5, -0.5]}))
"""A point cloud of two points in front of the robot."""


_FILM: Final = encode_unit(
    VideoUnit(
        "avc1.42C00A",
        is_key=True,
        width=16,
        height=16,
        time_s=0.0,
        data=a2b_base64("AAAAAWdCwAraehAAAAMAEAAAAwPI8SJqAAAAAWjOD8gAAAABZYiEOieA"),
    )
)
"""An access unit of a grey image. Only `urc.simulator.servers.camera` sends the world's images."""


def plausible(signal: Signal, now_s: float) -> Reading:
    """Return a value for `signal` at `now_s` that is within all limits."""
    if signal.type in ("image", "blob"):
        return _PIXEL if signal.size is None or signal.size >= len(_PIXEL) else b""
    if signal.type == "occupancy_grid":
        return _ROOM
    if signal.type == "point_cloud":
        return _POINTS
    if signal.type == "video":
        return _FILM
    if signal.type == "transform_tree":
        return _TREE
    if signal.type == "object":
        return _quaternion(now_s) if signal.axes else {}
    if signal.type != "array":
        return _single(signal, signal.type, 0, now_s)
    if signal.axes and signal.size == 4:
        return tuple(_quaternion(now_s).values())
    size = _ELEMENTS if signal.size is None else signal.size
    return tuple(_single(signal, signal.items, place, now_s) for place in range(size))


def _single(signal: Signal, kind: ElementType | SignalType, place: int, now_s: float) -> Value:
    if signal.states:
        words = [word for _, word in signal.states]
        return next((word for word in words if word not in signal.limits.states), words[0])
    if kind == "boolean":
        return "false" in signal.limits.states
    if kind == "string":
        return signal.name
    low, high = _range(signal)
    # Each signal has its own phase of the same slow wave.
    phase = crc32(signal.name.encode()) / 2**32 + place / 8
    value = low + (high - low) * (0.5 + 0.4 * math.sin(2 * math.pi * (now_s / _PERIOD_S + phase)))
    if kind == "integer":
        return round(value)
    return round(value, 2 if signal.precision is None else signal.precision)


def _range(signal: Signal) -> tuple[float, float]:
    """Return the range of values that cause no alarm."""
    limits: AlarmLimits = signal.limits
    lowest, highest = signal.min, signal.max
    floors = [one for one in (signal.min, limits.lolo, limits.low) if one is not None]
    tops = [one for one in (signal.max, limits.high, limits.hihi) if one is not None]
    low = max(floors, default=None)
    high = min(tops, default=None)
    if low is None and high is None:
        return _WIDTH
    if low is None and high is not None:
        low = min(0.0, high - 1) if lowest is None else lowest
    if high is None and low is not None:
        high = max(_WIDTH[1], low + 1) if highest is None else highest
    return low or 0.0, high or 0.0


def _quaternion(now_s: float) -> dict[str, Value]:
    half = math.pi * now_s / _PERIOD_S
    return {"x": 0.0, "y": 0.0, "z": round(math.sin(half), 4), "w": round(math.cos(half), 4)}


_DIGITS: Final = 7
"""Number of decimal places in world values; for a latitude in degrees, the last place is about a
centimetre."""
_DEEPEST: Final = 16
"""Maximum length of a chain of computed signals."""


class Unsettable(UrcError):
    """Raised for a value that is invalid for its signal; the message is for people."""


class Values:
    """The signal values and state variables of one emulated robot."""

    def __init__(
        self,
        driver: Driver,
        settings: Mapping[str, Value],
        initial: Mapping[str, Reading] = NOTHING,
        world: WorldSpec | None = None,
        *,
        is_plain: bool = False,
    ) -> None:
        """Create the values from `initial` signals and state variables, and optionally a world."""
        self.driver = driver
        self.settings: Mapping[str, Value] = dict(settings)
        self.state: dict[str, Reading] = {}
        """State variables that are not signals, keyed by name."""
        self.chosen: dict[str, Reading] = {}
        """Explicitly set signal values, keyed by name."""
        self.body: SimulatedBody | None = None
        """The simulated body and its sensors; None if there is no world."""
        self.senses: Mapping[str, object] = NOTHING
        """Signals whose values come from the world."""
        drawn = PLAIN if is_plain else frozenset[str]()
        is_blind = world is not None and not has_rendering()
        missing = rendered_signals(world, drawn) if world and is_blind else frozenset[str]()
        self.faults = Faults(missing)
        """Injected faults of the robot."""
        for name, value in initial.items():
            self.set(name, value)
        if world is not None:
            self.body, self.senses = (
                SimulatedBody(world, driver, self.evaluate, self.set, is_plain=is_plain),
                world.senses,
            )

    def remember(self, arguments: Mapping[str, object]) -> None:
        """Store the value of each command argument that has the name of a signal."""
        for name, value in arguments.items():
            signal = self.driver.signals.get(name)
            if signal is None or name in self.senses:
                continue
            if signal.formula is None and value is not None:
                try:
                    self.chosen[name] = _kept(signal, value)
                except BadValue:
                    continue  # the command uses the name with another meaning

    def set(self, name: str, value: object) -> None:
        """Set a signal, clamped to its range, or a state variable.

        Raises:
            Unsettable: the value is invalid for the signal.
        """
        signal = self.driver.signals.get(name)
        if signal is None:
            self.state[name] = value  # type: ignore[assignment]  # expressions give nothing else
            return
        try:
            self.chosen[name] = _kept(signal, _within(signal, value))
        except BadValue as error:
            raise Unsettable(f"{name}: {error}") from None

    def of(self, name: str, now_s: float, depth: int = 0) -> Reading:
        """Return the value of a signal: explicitly set, computed or plausible."""
        if name in self.faults.stuck:
            return self.faults.stuck[name]
        signal = self.driver.signals[name]
        if self.body is not None and name in self.senses:
            return _sensed(self.body, signal, now_s)
        if name in self.chosen:
            return self.chosen[name]
        if signal.formula is not None and depth < _DEEPEST:
            try:
                return build_converter(signal)(
                    signal.formula.evaluate(Names(self, now_s, depth=depth + 1))
                )
            except (ExpressionError, BadValue):
                return None
        return plausible(signal, now_s)

    def evaluate(self, template: Template, now_s: float) -> object:
        """Evaluate a template with the robot's values, or raise `ExpressionError`."""
        return template.evaluate(Names(self, now_s))


class Names(Mapping[str, object]):
    """A namespace that contains given names, ``now``, ``settings``, state variables and signals."""

    __slots__ = ("_depth", "_given", "_now_s", "_values")

    def __init__(
        self,
        values: Values,
        now_s: float,
        given: Mapping[str, object] = NOTHING,
        *,
        depth: int = 0,
    ) -> None:
        self._values = values
        self._now_s = now_s
        self._given = given
        self._depth = depth

    def __getitem__(self, name: str) -> object:
        if name in self._given:
            return self._given[name]
        if name == "now":
            return self._now_s
        if name == "settings":
            return self._values.settings
        if name == "world" and self._values.body is not None:
            return self._values.body.view(self._now_s)
        if name in self._values.state:
            return self._values.state[name]
        if name in self._values.driver.signals:
            return self._values.of(name, self._now_s, self._depth)
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        values = self._values
        names = (*self._given, "now", "settings", *values.state, *values.driver.signals)
        return iter(dict.fromkeys(names))

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _sensed(body: SimulatedBody, signal: Signal, now_s: float) -> Reading:
    """Return the world's value of a signal; None if the value is invalid."""
    try:
        value = body.sense(signal.name, now_s)
        if isinstance(value, bytes):
            return _FILM if signal.type == "video" else value
        if isinstance(value, float):
            value = round(value, _DIGITS)
        return None if value is None else _kept(signal, _within(signal, value))
    except (ExpressionError, BadValue):
        return None


def _kept(signal: Signal, value: object) -> Reading:
    """Return the stored form of `value` for `signal`, or raise `BadValue`."""
    words = dict(signal.states)
    if words and value is not None:
        word = str(value)
        if word in words.values():
            return word
        if word in words:
            return words[word]
        raise BadValue(f"{value!r} is not one of the states {', '.join(words.values())}")
    plain = signal._replace(conversion=signal.conversion._replace(polynomial=(), points=(), base=0))
    return build_converter(plain)(value)


def _within(signal: Signal, value: object) -> object:
    """Return a number, clamped to the range of its signal."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or signal.states:
        return value
    if signal.type == "integer":
        value = round(value) if abs(value) < float("inf") else value
    if signal.min is not None:
        value = max(value, signal.min)
    return value if signal.max is None else min(value, signal.max)

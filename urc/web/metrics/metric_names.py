"""Names of metrics: the readings that an option selects, and units as OpenMetrics writes them.

Layer 5. Pure.
"""

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

from urc.model.values import Signal
from urc.problems import UrcError

__all__ = ["ReadingChoice", "is_chosen", "is_numeric", "metric_name", "reading_choice", "unit_name"]

ANY: Final = "*"
_CHOICE: Final = re.compile(r"(\*|[a-z][a-z0-9-]{0,63})\.(\*|[A-Za-z_][\w.-]{0,199})", re.ASCII)
_WORDS: Final = {
    "%": "percent", "m": "meters", "km": "kilometers", "dm": "decimeters", "cm": "centimeters",
    "mm": "millimeters", "um": "micrometers", "in": "inches", "ft": "feet", "mi": "miles",
    "nmi": "nautical_miles", "mph": "miles_per_hour", "kn": "knots", "m2": "square_meters",
    "m3": "cubic_meters", "m/s2": "meters_per_second_squared",
    "m/s^2": "meters_per_second_squared", "mm/s2": "millimeters_per_second_squared",
    "rad": "radians", "mrad": "milliradians", "deg": "degrees", "°": "degrees", "turn": "turns",
    "rpm": "revolutions_per_minute", "rev/min": "revolutions_per_minute", "s": "seconds",
    "ms": "milliseconds", "us": "microseconds", "min": "minutes", "h": "hours", "Hz": "hertz",
    "kHz": "kilohertz", "MHz": "megahertz", "kg": "kilograms", "g": "grams", "t": "tonnes",
    "lb": "pounds", "N": "newtons", "kN": "kilonewtons", "mN": "millinewtons",
    "Nm": "newton_meters", "N.m": "newton_meters", "Pa": "pascals", "hPa": "hectopascals",
    "kPa": "kilopascals", "bar": "bars", "V": "volts", "mV": "millivolts", "A": "amperes",
    "mA": "milliamperes", "W": "watts", "kW": "kilowatts", "Wh": "watt_hours", "J": "joules",
    "Ah": "ampere_hours", "mAh": "milliampere_hours", "Ohm": "ohms", "Ω": "ohms",
    "Cel": "celsius", "°C": "celsius", "degC": "celsius", "[degF]": "fahrenheit",
    "°F": "fahrenheit", "K": "kelvin", "L": "liters", "lx": "lux", "T": "teslas", "dBm": "dbm",
}  # fmt: skip
_ONE: Final = {
    "s": "second", "min": "minute", "h": "hour", "m": "meter", "m2": "square_meter",
    "m3": "cubic_meter", "kg": "kilogram", "L": "liter",
}  # fmt: skip
_OTHER: Final = re.compile(r"[^a-z0-9]+")


class ReadingChoice(NamedTuple):
    """Readings to publish: one signal or all signals, of one robot or all robots."""

    robot: str
    """Name of the robot; `ANY` for all."""
    signal: str
    """Name of the signal; `ANY` for all numeric signals."""

    def __str__(self) -> str:
        """Return the choice as on the command line."""
        return f"{self.robot}.{self.signal}"

    def covers(self, robot: str, signal: str) -> bool:
        """Return whether the choice contains a signal of a robot."""
        return self.robot in (ANY, robot) and self.signal in (ANY, signal)


def reading_choice(text: str) -> ReadingChoice:
    """Return the choice in ``ROBOT.SIGNAL``; raise `UrcError` for another form."""
    match = _CHOICE.fullmatch(text)
    if match is None:
        raise UrcError(
            f"expected ROBOT.SIGNAL, such as cart.battery, *.battery or cart.*, found {text[:80]!r}"
        )
    return ReadingChoice(match[1], match[2])


def is_chosen(choices: Iterable[ReadingChoice], robot: str, signal: str) -> bool:
    """Return whether any choice contains a signal of a robot."""
    return any(one.covers(robot, signal) for one in choices)


def is_numeric(signal: Signal) -> bool:
    """Return whether a signal's readings are numbers."""
    return signal.type in ("integer", "number")


def unit_name(unit: str) -> str:
    """Return a unit in the words of OpenMetrics: ``m/s`` → ``meters_per_second``; "" for none.

    An unknown unit keeps its letters and digits.
    """
    if unit in _WORDS:
        return _WORDS[unit]
    first, slash, rest = unit.partition("/")
    if slash and rest in _ONE and (first in _WORDS or not first):
        return f"{_WORDS.get(first, '')}_per_{_ONE[rest]}".lstrip("_")
    return _OTHER.sub("_", unit.lower()).strip("_")


def metric_name(signal: str) -> str:
    """Return the name of a reading's metric, without its unit."""
    return f"urc_reading_{_OTHER.sub('_', signal.lower()).strip('_')}"

"""Units by quantity, and the conversion of values between units. Pure.

The unit table contains only units that occur in robot documents. Unit symbols follow UCUM, unless
the UCUM symbol is uncommon. A value in an unknown unit can be converted only to the same unit.
"""

import math
from typing import Final, NamedTuple

__all__ = ["Scale", "are_apart", "conversion", "quantity_of"]


class Scale(NamedTuple):
    """A conversion between two units: ``value * factor + offset``."""

    factor: float
    offset: float = 0.0

    def __call__(self, value: float) -> float:
        """Return `value` in the target unit."""
        return value * self.factor + self.offset


_DEGREE: Final = math.pi / 180
_NAUTICAL: Final = 1852.0

# Quantity → symbol → conversion to the SI unit of the quantity.
_KINDS: Final[dict[str, dict[str, Scale]]] = {
    "length": {
        "m": Scale(1),
        "km": Scale(1e3),
        "dm": Scale(0.1),
        "cm": Scale(1e-2),
        "mm": Scale(1e-3),
        "um": Scale(1e-6),
        "in": Scale(0.0254),
        "ft": Scale(0.3048),
        "mi": Scale(1609.344),
        "nmi": Scale(_NAUTICAL),
    },
    "speed": {
        "m/s": Scale(1),
        "mm/s": Scale(1e-3),
        "cm/s": Scale(1e-2),
        "km/h": Scale(1 / 3.6),
        "mph": Scale(1609.344 / 3600),
        "kn": Scale(_NAUTICAL / 3600),
        "ft/s": Scale(0.3048),
    },
    "acceleration": {
        "m/s2": Scale(1),
        "m/s^2": Scale(1),
        "mm/s2": Scale(1e-3),
        "g": Scale(9.80665),
        "mg": Scale(9.80665e-3),
    },
    "angle": {
        "rad": Scale(1),
        "mrad": Scale(1e-3),
        "deg": Scale(_DEGREE),
        "°": Scale(_DEGREE),
        "turn": Scale(2 * math.pi),
    },
    "rotation": {
        "rad/s": Scale(1),
        "deg/s": Scale(_DEGREE),
        "°/s": Scale(_DEGREE),
        "rpm": Scale(2 * math.pi / 60),
        "rev/min": Scale(2 * math.pi / 60),
    },
    "time": {
        "s": Scale(1),
        "ms": Scale(1e-3),
        "us": Scale(1e-6),
        "min": Scale(60),
        "h": Scale(3600),
    },
    "frequency": {"Hz": Scale(1), "kHz": Scale(1e3), "MHz": Scale(1e6)},
    "mass": {"kg": Scale(1), "t": Scale(1e3), "lb": Scale(0.45359237)},
    "force": {"N": Scale(1), "kN": Scale(1e3), "mN": Scale(1e-3)},
    "torque": {"N.m": Scale(1), "Nm": Scale(1), "N*m": Scale(1), "mN.m": Scale(1e-3)},
    "temperature": {
        "K": Scale(1),
        "degC": Scale(1, 273.15),
        "°C": Scale(1, 273.15),
        "degF": Scale(5 / 9, 459.67 * 5 / 9),
        "°F": Scale(5 / 9, 459.67 * 5 / 9),
    },
    "pressure": {
        "Pa": Scale(1),
        "hPa": Scale(1e2),
        "mbar": Scale(1e2),
        "kPa": Scale(1e3),
        "bar": Scale(1e5),
        "MPa": Scale(1e6),
        "psi": Scale(6894.757293168),
    },
    "voltage": {"V": Scale(1), "mV": Scale(1e-3), "uV": Scale(1e-6), "kV": Scale(1e3)},
    "current": {"A": Scale(1), "mA": Scale(1e-3), "uA": Scale(1e-6)},
    "power": {"W": Scale(1), "mW": Scale(1e-3), "kW": Scale(1e3)},
    "energy": {"J": Scale(1), "Wh": Scale(3600), "W.h": Scale(3600), "kWh": Scale(3.6e6)},
    "charge": {"C": Scale(1), "Ah": Scale(3600), "A.h": Scale(3600), "mAh": Scale(3.6)},
    "share": {"%": Scale(0.01), "1": Scale(1)},
    "data": {
        "B": Scale(1),
        "kB": Scale(1e3),
        "MB": Scale(1e6),
        "GB": Scale(1e9),
        "KiB": Scale(1024),
        "MiB": Scale(1024**2),
        "GiB": Scale(1024**3),
    },
}
_KIND_OF: Final = {symbol: kind for kind, units in _KINDS.items() for symbol in units}


def conversion(have: str, want: str) -> Scale | None:
    """Return the conversion from unit `have` to unit `want`; None for incompatible units.

    Two identical symbols are always compatible, even for an unknown unit.
    """
    if have == want:
        return Scale(1)
    kind = _KIND_OF.get(have)
    if kind is None or kind != _KIND_OF.get(want):
        return None
    source, target = _KINDS[kind][have], _KINDS[kind][want]
    return Scale(source.factor / target.factor, (source.offset - target.offset) / target.factor)


def are_apart(one: str, other: str) -> bool:
    """Return whether the same number certainly means different values in the two units.

    If a unit is missing, the result is False.
    """
    scale = conversion(one, other)
    return bool(one and other) and (scale is None or scale != (1.0, 0.0))


def quantity_of(unit: str) -> str:
    """Return the quantity of a unit, such as ``length``; "" for an unknown unit."""
    return _KIND_OF.get(unit, "")

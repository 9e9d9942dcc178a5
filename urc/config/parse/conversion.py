"""Parser for the conversion of a signal or field."""

import re
from itertools import pairwise
from math import isfinite
from typing import Final

from urc.config.node import Node, Problems
from urc.config.values import fraction_of
from urc.model.values import Conversion

__all__ = ["CONVERSION_KEYS", "parse_conversion", "parse_states"]

CONVERSION_KEYS: Final = ("base", "scale", "offset", "polynomial", "points", "not_available")
"""All keys of a conversion, except ``states``."""
_A_NUMBER: Final = re.compile(r"[+-]?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]{1,3})?")
_OF_NUMBERS: Final = ("base", "scale", "offset", "polynomial", "points")


def parse_conversion(part: Node, problems: Problems, kind: str = "number") -> Conversion:
    """Return the conversion that the keys of `part` declare, without its states.

    `kind` is the type of the converted value. If it is a string or a boolean, keys such as `scale`
    are reported.
    """
    if kind not in ("integer", "number"):
        for key in _OF_NUMBERS:
            if part.get(key) is not None:
                problems.error(
                    part,
                    "misplaced-key",
                    f"'{key}' has no effect for type {kind}",
                    at=key,
                    key=True,
                    hint="this key needs the type integer or number",
                )
    absent = tuple(inner.data for inner in part.listed("not_available"))
    if kind in ("integer", "number"):
        absent = (*absent, *(number for one in absent for number in _numbers_in(one)))
    return Conversion(
        base=part.integer("base") or 0,
        not_available=absent,
        polynomial=_polynomial(part, problems),
        points=_points(part.get("points"), problems),
    )


def _numbers_in(absent: object) -> tuple[float, ...]:
    """Return the number that a string represents, if any; some frame forms read values as text.

    A string with leading zeros is not a number: ``"000"`` does not mean 0.
    """
    if not isinstance(absent, str) or _A_NUMBER.fullmatch(absent) is None:
        return ()
    number = float(absent)
    return (number,) if isfinite(number) else ()


def parse_states(part: Node, kind: str, problems: Problems) -> tuple[tuple[str, str], ...]:
    """Return the states of a signal or conversion as pairs of raw text and state."""
    states = part.named("states")
    if kind in ("integer", "number"):
        for raw, inner in states.items():
            try:
                float(raw)
            except ValueError:
                problems.error(
                    inner,
                    "wrong-type",
                    f"the signal has the type {kind}, but {raw!r} is not a number",
                    key=True,
                    hint="write 'type: string', or map numbers to words",
                )
    return tuple((raw, str(inner.data)) for raw, inner in states.items())


def _polynomial(part: Node, problems: Problems) -> tuple[float, ...]:
    written = part.get("scale")
    is_fraction = written is not None and isinstance(written.data, str)
    scale = fraction_of(part.text("scale")) if is_fraction else part.number("scale")
    offset = part.number("offset")
    coefficients = part.listed("polynomial")
    if coefficients:
        for key in ("scale", "offset"):
            if key in part.data:
                problems.error(
                    part,
                    "two-conversions",
                    f"'{key}' and 'polynomial' both convert the value",
                    at=key,
                    key=True,
                    hint="in a polynomial, the offset is the first coefficient, and the scale is"
                    " the second",
                )
        return tuple(inner.data for inner in coefficients)
    if scale == 0:
        problems.error(
            part.must("scale"),
            "zero-scale",
            "a scale of 0 makes every value the same",
            hint="remove 'scale', or set it to the change in value for each raw step",
        )
    if scale is None and offset is None:
        return ()
    return (offset or 0, 1 if scale is None else scale)


def _points(part: Node | None, problems: Problems) -> tuple[tuple[float, float], ...]:
    if part is None:
        return ()
    pairs = part.items()
    for before, after in pairwise(pairs):
        if before.data[0] >= after.data[0]:
            problems.error(
                after,
                "wrong-order",
                f"{after.data[0]:g} is not above {before.data[0]:g}, the raw number of the"
                " previous point",
                hint="the first number of each pair is the raw number, which must increase",
            )
    return tuple((inner.data[0], inner.data[1]) for inner in pairs)

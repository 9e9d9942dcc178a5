"""Checks typed values in documents, such as defaults, choices and ranges."""

from typing import Any, Final

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.model.driver import Argument, Command
from urc.model.values import Reading, Value

__all__ = [
    "check_range",
    "check_within",
    "element_of",
    "fit",
    "fit_argument",
    "fit_hint",
    "fraction_of",
    "given",
    "known_argument",
    "shown",
]

_TYPE_WORDS: Final = {
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "string": "text",
}


def shown(value: object) -> str:
    """Return a value in the notation of documents, for messages."""
    if value is None:
        return "nothing"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def fraction_of(text: str) -> float:
    """Return the value of a fraction such as ``1/65536``; the schema has checked the format."""
    above, _, below = text.partition("/")
    return int(above) / int(below)


def given(data: Any) -> Reading:
    """Return a document's data as a value, with lists converted to tuples."""
    return tuple(data) if isinstance(data, list) else data


def fit(value: Value, kind: str) -> Value:
    """Return `value` converted to type `kind`; 3.0 counts as a whole number.

    Raises:
        ValueError: the value has another type.
    """
    if kind == "string" and isinstance(value, str):
        return value
    if kind == "boolean" and isinstance(value, bool):
        return value
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if kind == "number":
            return value
        if kind == "integer" and (isinstance(value, int) or value.is_integer()):
            return int(value)
    raise ValueError(f"expected {_TYPE_WORDS[kind]}, found {shown(value)}")


def fit_argument(value: Any, kind: str, of: str, size: int | None) -> tuple[Value, ...]:
    """Return the elements of an array argument, or the value of any other argument as a tuple.

    Raises:
        ValueError: the value has another type or size.
    """
    if kind != "array":
        return (fit(value, kind),)
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"expected a list, found {shown(value)}")
    if size is not None and len(value) != size:
        raise ValueError(f"expected {size} elements, found {len(value)}")
    return tuple(fit(one, of) for one in value)


def element_of(part: Node, kind: str, problems: Problems) -> str:
    """Return the element type of an array, or `kind` itself for another type."""
    if kind == "array":
        return part.text("items", "number")
    for key in ("items", "size"):
        if key in part.data:
            text = f"'{key}' has no effect for type {kind}"
            hint = "write type: array"
            problems.error(part, "misplaced-key", text, at=key, key=True, hint=hint)
    return kind


def fit_hint(value: Value, kind: str) -> str:
    """Return a hint for converting a value to type `kind`, such as a change of quotes."""
    if kind in ("integer", "number") and isinstance(value, str):
        try:
            float(value)
        except ValueError:
            return ""
        return f"remove the quotes: {value}"
    if kind == "string" and value is not None:
        return f'quote it: "{shown(value)}"'
    if kind == "boolean" and isinstance(value, str):
        return "yes, no, on and off are text in YAML 1.2; write true or false"
    return ""


def check_range(part: Node, kind: str, problems: Problems) -> tuple[float | None, float | None]:
    """Return the ``min`` and ``max`` of a signal, argument or setting; report an empty range."""
    low, high = part.number("min"), part.number("max")
    if kind not in ("integer", "number"):
        for key in ("min", "max"):
            if key in part.data:
                problems.error(
                    part,
                    "misplaced-key",
                    f"'{key}' has no effect for type {kind}",
                    at=key,
                    key=True,
                    hint="a range needs the type integer or number",
                )
    elif low is not None and high is not None and low >= high:
        widen = "remove 'min' or 'max', or make the range wider"
        hint = "swap the two values" if low > high else widen
        text = f"min {low:g} is not below max {high:g}"
        problems.error(part, "wrong-order", text, at="min", hint=hint)
    return low, high


def check_within(
    value: Value, low: float | None, high: float | None, part: Node, problems: Problems
) -> None:
    """Report a number at `part` below ``min`` or above ``max``."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return
    if low is not None and value < low:
        problems.error(part, "out-of-range", f"{value:g} is below min {low:g}")
    elif high is not None and value > high:
        problems.error(part, "out-of-range", f"{value:g} is above max {high:g}")


def known_argument(
    name: str, part: Node, command: Command, problems: Problems, *, key: bool = True
) -> Argument | None:
    """Return the argument with this name; report an unknown name and return None."""
    argument = command.arguments.get(name)
    if argument is None:
        problems.error(
            part,
            "unknown-argument",
            f"command {command.name!r} has no argument {name!r}",
            key=key,
            hint=did_you_mean(name, command.arguments, "arguments"),
        )
    return argument

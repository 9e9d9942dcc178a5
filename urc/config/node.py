"""A typed view of a valid document for the parsers, and a class that collects problems.

The parsers read documents only through `Node`. Problems can therefore state the position of every
value, and a test can record the keys in use. All functions in this module assume a document that
fits its schema.
"""

import math
import re
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import ExpressionError, Template, compile_expression, compile_template
from urc.model.values import Value
from urc.patterns import Pattern, PatternError, compile_pattern
from urc.problems import Problem, Severity
from urc.source import Document, Path

__all__ = ["Problems", "Node", "duration_s"]

_DURATION = re.compile(r"([0-9]+(?:\.[0-9]+)?)(ms|s|m|h)")
_UNITS_S: Final = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0}
_LONGEST_S: Final = 86400.0


def duration_s(text: str) -> float:
    """Return a duration such as ``250ms`` in seconds; the schema has checked the format."""
    found = _DURATION.fullmatch(text)
    if found is None:
        raise ValueError(f"{text!r} is not a duration")
    # Division rounds correctly: 9 / 1000 is 0.009, but 9 * 0.001 is 0.009000000000000001.
    number, unit = float(found[1]), found[2]
    return number / 1000 if unit == "ms" else number * _UNITS_S[unit]


class Node(NamedTuple):
    """A value in a document and its path."""

    document: Document
    path: Path
    data: Any

    @property
    def name(self) -> str:
        """The last key or index of the path."""
        return str(self.path[-1]) if self.path else ""

    def get(self, key: str) -> "Node | None":
        """Return the child under `key`; None if the key is missing."""
        if key not in self.data:
            return None
        return Node(self.document, (*self.path, key), self.data[key])

    def must(self, key: str) -> "Node":
        """Return the child under `key`; the schema ensures that the key exists."""
        return Node(self.document, (*self.path, key), self.data[key])

    def named(self, key: str) -> dict[str, "Node"]:
        """Return the entries of the mapping under `key`; empty if the key is missing."""
        inner = self.get(key)
        return inner.entries() if inner else {}

    def entries(self) -> dict[str, "Node"]:
        """Return the entries of a mapping by name."""
        return {
            name: Node(self.document, (*self.path, name), item) for name, item in self.data.items()
        }

    def listed(self, key: str) -> list["Node"]:
        """Return the items of the list under `key`; empty if the key is missing."""
        inner = self.get(key)
        return inner.items() if inner else []

    def items(self) -> list["Node"]:
        """Return the items of a list."""
        return [
            Node(self.document, (*self.path, place), item) for place, item in enumerate(self.data)
        ]

    def text(self, key: str, default: str = "") -> str:
        """Return the text under `key`, or the default."""
        inner = self.get(key)
        return default if inner is None else str(inner.data)

    def flag(self, key: str, *, default: bool) -> bool:
        """Return the boolean under `key`, or the default."""
        inner = self.get(key)
        return default if inner is None else bool(inner.data)

    def number(self, key: str) -> float | None:
        """Return the number under `key`; None if the key is missing."""
        inner = self.get(key)
        return None if inner is None else inner.data

    def integer(self, key: str) -> int | None:
        """Return the whole number under `key`; as in JSON Schema, 3.0 is a whole number."""
        inner = self.get(key)
        return None if inner is None else int(inner.data)

    def scalar(self, key: str) -> Value:
        """Return the text, number or boolean under `key`; None if the key is missing."""
        inner = self.get(key)
        value: Value = None if inner is None else inner.data
        return value


class Problems:
    """Collects the problems of one pass."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def __iter__(self) -> Iterator[Problem]:
        return iter(self.problems)

    def error(self, part: Node, code: str, message: str, **place: Any) -> None:
        """Add an error; `place` is ``at`` (a key of `part`) or arguments of `Document.problem`."""
        self._add(part, code, message, "error", **place)

    def warn(self, part: Node, code: str, message: str, **place: Any) -> None:
        """Add a warning."""
        self._add(part, code, message, "warning", **place)

    def unknown(self, part: Node, code: str, name: str, known: Iterable[str], **place: Any) -> None:
        """Report an unknown name and suggest a `known` name; `code` is ``unknown-NOUN``."""
        noun = code.removeprefix("unknown-")
        hint = did_you_mean(name, known, f"{noun}s")
        self.error(part, code, f"there is no {noun} {name!r}", hint=hint, **place)

    def _add(
        self, part: Node, code: str, message: str, severity: Severity, *, at: str = "", **place: Any
    ) -> None:
        path = (*part.path, at) if at else part.path
        self.problems.append(part.document.problem(path, code, message, severity=severity, **place))

    def duration(
        self,
        part: Node,
        key: str,
        default: float,
        *,
        least: float = 0.001,
        most: float = _LONGEST_S,
    ) -> float:
        """Return the duration under `key` in seconds; report a value out of range."""
        inner = part.get(key)
        if inner is None:
            return default
        seconds = duration_s(inner.data)
        if not least <= seconds <= most:
            self.error(
                inner,
                "out-of-range",
                f"expected {shown_duration(least)} to {shown_duration(most)}, found {inner.data}",
            )
            return default
        return seconds

    def pattern(self, part: Node, *, is_over_bytes: bool = False) -> Pattern | None:
        """Compile the pattern at `part`; report an invalid pattern and return None."""
        try:
            return compile_pattern(part.data, is_over_bytes=is_over_bytes)
        except PatternError as error:
            self.error(part, "bad-pattern", str(error), offset=error.offset)
            return None

    def template(self, part: Node) -> Template | None:
        """Compile the template at `part`; report an invalid template and return None."""
        try:
            return compile_template(part.data)
        except ExpressionError as error:
            self.error(part, "bad-template", str(error), offset=error.offset)
            return None

    def expression(self, part: Node, *, allows_bytes: bool = False) -> Template | None:
        """Compile the expression at `part`; report an invalid expression and return None."""
        try:
            return compile_expression(part.data, allows_bytes=allows_bytes)
        except ExpressionError as error:
            braces = "{{" in part.data
            hint = "write the expression without braces" if braces else ""
            self.error(part, "bad-expression", str(error), offset=error.offset, hint=hint)
            return None


def shown_duration(seconds: float) -> str:
    """Return a duration in the notation of documents, such as ``250ms``."""
    if seconds and seconds < 1:
        return f"{seconds * 1000:g}ms"
    for unit in ("h", "m"):
        if seconds >= _UNITS_S[unit] and math.fmod(seconds, _UNITS_S[unit]) == 0:
            return f"{seconds / _UNITS_S[unit]:g}{unit}"
    return f"{seconds:g}s"

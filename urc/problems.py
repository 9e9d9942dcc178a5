"""Problems in documents, and their output for people and programs.

This module is independent of YAML, robots and the command line. The loader's passes, document tests
and widget manifests report mistakes as `Problem`. Text output, JSON output and the web editor show
the same values.
"""

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

__all__ = [
    "Problem",
    "ProblemsError",
    "UrcError",
    "has_errors",
    "printable",
    "printable_json",
    "to_json",
    "to_text",
]

Severity = Literal["error", "warning"]

# Control characters including C1, characters that reorder a terminal's text, and line ends. Text
# from a robot must not imitate a line of URC's output. Lone surrogates cannot be encoded.
_CONTROLS = (*range(0x20), *range(0x7F, 0xA0))
_MARKS = (0x061C, 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A))
_HALVES = range(0xD800, 0xE000)
_CONTROL = {code: f"\\x{code:02x}" for code in _CONTROLS}
_CONTROL |= {code: f"\\u{code:04x}" for code in (*_MARKS, *_HALVES)}
_IN_JSON = {code: f"\\u{code:04x}" for code in (*_CONTROLS[0x20:], *_MARKS, *_HALVES)}


class UrcError(Exception):
    """An expected error, with a one-line message for people.

    An exception that is not a `UrcError` is a bug in URC.
    """


class ProblemsError(UrcError):
    """Raised for an invalid document, with all problems from the pass that rejected it."""

    def __init__(self, problems: Sequence["Problem"]) -> None:
        self.problems = tuple(problems)
        first = self.problems[0]
        more = len(self.problems) - 1
        rest = f" (and {more} more: run 'urc validate')" if more else ""
        super().__init__(f"{first.headline}{rest}")


class Problem(NamedTuple):
    """One problem: position, message and hint."""

    code: str
    """Code of the problem, such as ``unknown-key``."""
    message: str
    """One-line message that states the actual and the expected content."""
    file: str
    line: int = 1
    """Line number, 1-based."""
    column: int = 1
    """Column number, 1-based, in characters."""
    end_column: int = 0
    """End column of the underlined text on the same line, 1-based and exclusive; 0 if unknown.
    """
    path: str = ""
    """Path of the value in the document, such as ``transports.wire.port``."""
    hint: str = ""
    """Suggested correction; "" if there is no suggestion."""
    source: str = ""
    """Source line of the problem, shown above the caret line."""
    severity: Severity = "error"

    @property
    def headline(self) -> str:
        """Headline ``file:line:column: severity CODE path: message``."""
        where = f" {self.path}" if self.path else ""
        text = f"{self.file}:{self.line}:{self.column}: {self.severity} {self.code}{where}: "
        return printable(text + self.message)


def printable(text: str) -> str:
    """Return `text` with control and bidirectional characters as escapes."""
    return text.translate(_CONTROL)


def printable_json(text: str) -> str:
    """Return the JSON text with control and bidirectional characters as JSON escapes."""
    return text.translate(_IN_JSON)


def has_errors(problems: Iterable[Problem]) -> bool:
    """Return whether any problem is an error rather than a warning."""
    return any(problem.severity == "error" for problem in problems)


def to_text(problem: Problem) -> str:
    """Return the problem as text: headline, source line, caret line and hint."""
    lines = [problem.headline]
    if problem.source.strip():
        lines += _excerpt(problem)
    if problem.hint:
        lines.append(f"     = {printable(problem.hint)}")
    return "\n".join(lines)


def to_json(problem: Problem) -> dict[str, object]:
    """Return the problem as a JSON object; the keys are a stable interface."""
    return {
        "file": problem.file,
        "line": problem.line,
        "column": problem.column,
        "end_column": problem.end_column or problem.column,
        "severity": problem.severity,
        "code": problem.code,
        "path": problem.path,
        "message": problem.message,
        "hint": problem.hint,
    }


def _excerpt(problem: Problem, width: int = 96) -> list[str]:
    """Return the source line, truncated to `width` around the error, and the caret line."""
    start = problem.column - 1
    end = max(problem.end_column - 1, start + 1)
    left = max(0, start - width // 2) if len(problem.source) > width else 0
    shown = problem.source[left : left + width]
    before, marked = shown[: start - left], shown[start - left : end - left]
    # Escape sequences are wider than the original characters, so the caret is placed after
    # escaping.
    caret = " " * len(printable(before)) + "^" * max(1, len(printable(marked)))
    gutter = f"{problem.line:>5} | "
    return [gutter + printable(shown), " " * (len(gutter) - 2) + "| " + caret]

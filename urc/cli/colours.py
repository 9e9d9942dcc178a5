"""Colours of terminal output, according to https://no-color.org and the type of terminal.

Layer 6. Colours never add information, because the coloured words already state it.
"""

import os
import sys
from collections.abc import Mapping
from typing import Literal, TextIO

from urc.problems import Problem, to_text

__all__ = ["Style", "coloured_problem", "has_colours", "is_terminal", "painted"]

Style = Literal["bad", "warning", "good", "quiet", "title"]
_CODES: dict[str, str] = {
    "bad": "1;31",
    "warning": "33",
    "good": "32",
    "quiet": "2",
    "title": "1",
}
"""SGR parameters of each style, for control sequences (ECMA-48, 8.3.117)."""


def is_terminal(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether a stream is a terminal that supports control sequences."""
    try:
        return stream.isatty() and environment.get("TERM") != "dumb"
    except ValueError:  # a closed stream
        return False


def has_colours(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether output to a stream may be coloured.

    A non-empty `NO_COLOR` disables colours. A non-empty `FORCE_COLOR` enables colours for pipes and
    files, such as the logs of CI servers.
    """
    if environment.get("NO_COLOR"):
        return False
    return bool(environment.get("FORCE_COLOR")) or is_terminal(stream, environment)


def painted(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return the text in a style, or unchanged if the stream has no colours.

    The default stream is standard output.
    """
    if not text or not has_colours(stream or sys.stdout):
        return text
    return f"\x1b[{_CODES[style]}m{text}\x1b[0m"


def coloured_problem(problem: Problem) -> str:
    """Return a problem as text for standard output, with colours if they are enabled."""
    text = to_text(problem)
    if not has_colours(sys.stdout):
        return text
    style: Style = "bad" if problem.severity == "error" else "warning"
    headline, *others = text.splitlines()
    word = f" {problem.severity} {problem.code}"
    lines = [headline.replace(word, f" {painted(word[1:], style)}", 1)]
    for line in others:
        before, carets = line.rstrip("^"), line.lstrip(" |")
        if carets and not carets.strip("^"):
            lines.append(before + painted(carets, style))
        else:
            lines.append(painted(line, "good") if line.startswith("     = ") else line)
    return "\n".join(lines)

"""Functions that generate pieces of Markdown for the reference pages."""

import re
from collections.abc import Iterable

__all__ = ["cell", "fence", "plain", "table"]

_ROLE = re.compile(r"``([^`]+)``|`([^`]+)`")


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return the lines of a Markdown table, followed by an empty line."""
    titles = list(head)
    lines = [f"| {' | '.join(titles)} |", f"|{'---|' * len(titles)}"]
    lines += [f"| {' | '.join(map(cell, row))} |" for row in rows]
    return [*lines, ""]


def cell(text: str) -> str:
    """Return the text as one table cell: on one line, with escaped vertical bars."""
    return " ".join(text.split()).replace("|", "\\|")


def fence(text: str, language: str = "text") -> list[str]:
    """Return the lines of a fenced code block, followed by an empty line."""
    return [f"```{language}", *text.rstrip("\n").split("\n"), "```", ""]


def plain(docstring: str) -> str:
    """Return a docstring as Markdown: literals in single backticks, without angle brackets."""
    text = _ROLE.sub(lambda found: f"`{found[1] or found[2]}`", docstring)
    return "".join(
        part if part.startswith("`") else part.replace("<", "\\<")
        for part in re.split(r"(`[^`]*`)", text)
    )

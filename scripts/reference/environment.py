"""The reference page for environment variables, generated from the table in the code."""

from collections.abc import Mapping

from urc._environment import SYSTEM, VARIABLES

__all__ = ["page"]


def page() -> str:
    """Return the page: one section for each variable."""
    lines = ["# Environment variables", "", "Environment variables that `urc` reads.", ""]
    lines += ["## Variables of URC", "", *_sections(VARIABLES)]
    lines += ["## System variables", "", *_sections(SYSTEM)]
    return "\n".join(lines).rstrip() + "\n"


def _sections(table: Mapping[str, str]) -> list[str]:
    return [line for name, text in table.items() for line in (f"### {name}", "", text, "")]

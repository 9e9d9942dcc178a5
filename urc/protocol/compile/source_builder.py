"""Builder for the source text of a generated struct function.

Pure. WARNING: the source is compiled and run. The source may contain only text from this package,
the `repr()` of constants, and names from `SourceBuilder.bind`. Text from a document must never
become part of the source.
"""

from collections.abc import Callable
from typing import Any

from urc.protocol.compile.source import function_of

__all__ = ["BUILTINS", "SourceBuilder"]

BUILTINS = {"bytes": bytes, "int": int, "len": len, "round": round, "type": type}


class SourceBuilder:
    """The source text of a generated function, to which lines are added one by one."""

    def __init__(self) -> None:
        self.scope: dict[str, Any] = dict(BUILTINS)
        """Global variables of the function, keyed by name."""
        self.lines: list[str] = []

    def bind(self, word: str, value: object) -> str:
        """Bind `value` to a new global name that starts with `word`; return the name."""
        name = f"_{word}{len(self.scope) - len(BUILTINS)}"
        self.scope[name] = value
        return name

    def add(self, line: str, depth: int = 1) -> None:
        """Add a source line with `depth` levels of indentation."""
        self.lines.append("    " * depth + line)

    def compile(self, name: str, argument: str) -> Callable[[Any], Any]:
        """Return the function."""
        return function_of(name, argument, self.lines, self.scope)

"""The lines of a function for one struct, while they are collected.

Floor 3, pure. WARNING: the lines are compiled and run. Whatever goes into them is the text of this
package, a repr() of a constant, or a name made by `Lines.bind`; never text of a document.
"""

from collections.abc import Callable
from typing import Any

from urc.protocol.generate import function_of

__all__ = ["BUILTINS", "Lines"]

BUILTINS = {"bytes": bytes, "int": int, "len": len, "round": round, "type": type}


class Lines:
    """A function under construction."""

    def __init__(self) -> None:
        self.scope: dict[str, Any] = dict(BUILTINS)
        """What the function sees beside its argument."""
        self.lines: list[str] = []

    def bind(self, word: str, value: object) -> str:
        """Return a name, made of `word`, under which the function sees `value`."""
        name = f"_{word}{len(self.scope) - len(BUILTINS)}"
        self.scope[name] = value
        return name

    def add(self, line: str, depth: int = 1) -> None:
        """Add a line, indented `depth` times."""
        self.lines.append("    " * depth + line)

    def compile(self, name: str, argument: str) -> Callable[[Any], Any]:
        """Return the function."""
        return function_of(name, argument, self.lines, self.scope)

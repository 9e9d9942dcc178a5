"""Builds functions with readable tracebacks from generated source text.

The callers of `function_of` build the source from fixed names and from the `repr()` of constants.
Text from a document enters the generated source only inside the `repr()` of a constant. `linecache`
keeps the source as long as the function exists, so tracebacks show the generated lines.
"""

import weakref
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import Any

__all__ = ["function_of"]

_numbers = count(1)


def function_of(
    name: str, arguments: str, lines: Sequence[str], scope: Mapping[str, object]
) -> Callable[..., Any]:
    """Compile `lines` as the body of a new function, and return the function.

    Args:
        name: name of the function, a Python identifier.
        arguments: parameter list of the function, in Python syntax.
        lines: source lines of the function body, indented by at least four spaces.
        scope: global variables of the function, keyed by name.
    """
    import linecache  # imported here, because functions are generated only in live sessions

    source = "\n".join([f"def {name}({arguments}):", *lines, ""])
    file = f"<generated {name} {next(_numbers)}>"
    made: dict[str, Any] = {"__builtins__": {}, **scope}
    exec(compile(source, file, "exec"), made)  # noqa: S102  # see the module docstring
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    function: Callable[..., Any] = made[name]
    # Remove the source together with the function, which lives as long as its engine.
    weakref.finalize(function, linecache.cache.pop, file, None).atexit = False
    return function

"""Functions made at load for one declaration: source text → function, seen in tracebacks.

Floor 3. Whatever stands in the source is written by the modules that call `function_of`, out of
names of their own and `repr()` of constants; nothing of a document gets into it in any other way.
The source is registered with `linecache` for as long as the function lives, so that a traceback
shows the generated line.
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
    """Return the function whose body is `lines`.

    Args:
        name: of the function, a Python identifier.
        arguments: as in a ``def``.
        lines: of the body, indented by four blanks and more.
        scope: the only names that it sees beside its arguments.
    """
    import linecache  # what is made is made late, so that what makes it is imported late

    source = "\n".join([f"def {name}({arguments}):", *lines, ""])
    file = f"<generated {name} {next(_numbers)}>"
    made: dict[str, Any] = {"__builtins__": {}, **scope}
    exec(compile(source, file, "exec"), made)  # noqa: S102  # see the module's own words
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    function: Callable[..., Any] = made[name]
    # With its engine goes the function, and with the function its source.
    weakref.finalize(function, linecache.cache.pop, file, None).atexit = False
    return function

r"""A stand-in for `re2`: patterns in the dialect of RE2, matched by Python's `re`.

`urc.patterns` has already refused what RE2 lacks, such as look-ahead. The stand-in restores the
differences that remain: ``$`` matches only the end of the text, and classes such as ``\d`` contain
only ASCII. Matching may take longer than linear time; the page ends a worker that takes too long.
"""

import re
from enum import Enum
from re import _compiler, _constants, _parser  # type: ignore[attr-defined]  # no public interface
from typing import Any, Final

__all__ = ["Options", "compile", "error"]

_AT: Final = _constants.AT
_UNKNOWN_ESCAPE: Final = re.compile(r"(?<!\\)(?:\\\\)*(\\[ZuUN])")
_UNKNOWN_FLAGS: Final = re.compile(r"(?<!\\)(?:\\\\)*(\(\?(?:#|[imsU-]*[aLux]))")


class error(Exception):  # noqa: N801  # the name in re2
    """An invalid pattern; the first argument is the reason as bytes, as in `re2`."""


class Options:
    """The options of a pattern; the stand-in needs none of them."""

    class Encoding(Enum):
        """Encoding of the text."""

        UTF8 = 1
        LATIN1 = 2

    def __init__(self) -> None:
        """Set the defaults of RE2."""
        self.log_errors = True
        self.max_mem = 8 << 20
        self.encoding = Options.Encoding.UTF8


def compile(text: str | bytes, options: Options | None = None) -> Any:
    """Return a pattern with the methods of `re.Pattern`; raise `error` if `text` is invalid."""
    shown = text if isinstance(text, str) else text.decode("latin-1")
    if found := _UNKNOWN_ESCAPE.search(shown):
        raise error(f"invalid escape sequence: {found[1]}".encode())
    if found := _UNKNOWN_FLAGS.search(shown):
        raise error(f"invalid perl operator: {found[1]}".encode())
    flags = int(re.ASCII)
    try:
        tree = _parser.parse(text, flags)
        if not tree.state.flags & re.MULTILINE:
            _end_at_end(tree)
        return _compiler.compile(tree, flags)
    except (re.error, OverflowError, RecursionError) as fault:
        raise error(str(fault).encode()) from None


def _end_at_end(tree: Any) -> None:
    """Let every ``$`` in a syntax tree match only the end of the text."""
    for place, item in enumerate(tree.data):
        operation, argument = item
        if operation is _AT and argument is _constants.AT_END:
            tree.data[place] = (_AT, _constants.AT_END_STRING)
        else:
            _within(argument)


def _within(argument: Any) -> None:
    if isinstance(argument, _parser.SubPattern):
        _end_at_end(argument)
    elif isinstance(argument, tuple | list):
        for part in argument:
            _within(part)
